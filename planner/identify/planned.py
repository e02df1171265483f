"""Planned throws as a data set, to learn from what came of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from ...models import LinearRelease, TableRelease
from ...problems import InputError, MeasuredThrow, Scene, Shared, ThrowData
from ..check import hand_samples
from ..result import Plan, sent_throw
from .predict import Predictor, parameter_sets

Array = npt.NDArray[np.float64]

#: What is recorded of the hand: from so long before the command to so long after the
#: opening [s], every `TICK` seconds.
BEFORE, AFTER, TICK = 0.05, 0.06, 0.001


def throw_data(
    plans: Sequence[Plan],
    landings: Sequence[tuple[float, float]] | None = None,
    position_noise: float = 0.005,
    angle_noise: float = np.radians(2.0),
) -> ThrowData:
    """Throws of solved plans of one scene as a data set: the hand's motion, command and grip.

    landings: x [m], theta [rad] where each came down, None where that is not known yet.
    position_noise [m], angle_noise [rad]: their standard deviations. Raises InputError for
    no plan at all and for targets at several heights.
    """
    if not plans:
        raise InputError("no throws: give at least one plan")
    scene, height = plans[0].scene, plans[0].target.z
    if any(abs(plan.target.z - height) > 1e-9 for plan in plans):
        raise InputError("the plans' targets must be at one height")
    shared = Shared(
        landing_height=height,
        gravity=scene.gravity,
        faces=scene.contact.faces,
        torsion=scene.contact.torsion,
        position_noise=position_noise,
        angle_noise=angle_noise,
    )
    places = [None] * len(plans) if landings is None else landings
    pairs = enumerate(zip(plans, places, strict=True), start=1)
    throws = [_recorded(f"throw-{number}", plan, place) for number, (plan, place) in pairs]
    return ThrowData(scene.name, shared, tuple(throws))


def thrown(data: ThrowData, model: str, contact: Mapping[str, float]) -> Array:
    """Landings (T, 2), x [m] and theta [rad], of the throws with this contact: a stand-in
    for reality. contact: friction, patch_radius, and delay [s], grip_scale if they differ."""
    return Predictor(data).landings(model, parameter_sets(**contact))[:, 0]


def _recorded(name: str, plan: Plan, landing: tuple[float, float] | None) -> MeasuredThrow:
    """A plan's throw as a recording, on the plan's clock.

    The command goes out earlier by the delay that the scene knows.
    """
    sent = sent_throw(plan)
    command, end = sent.command_time, sent.detach_time + AFTER
    first, last = max(command - BEFORE, 0.0), min(end, sent.until)
    times = np.linspace(first, last, round((last - first) / TICK) + 1)
    return MeasuredThrow(
        name=name,
        object=sent.scene.object,
        grasp=sent.scene.grasp,
        times=times,
        motion=hand_samples(sent.mover, sent.motion, times).pose.T,
        command=command,
        grip=_recorded_grip(sent.scene),
        landing=None if landing is None else (landing[0], sent.target.z, landing[1]),
        track=None,
        factors={},
    )


def _recorded_grip(scene: Scene) -> TableRelease:
    """The grip force from the command on, as a recording has it."""
    profile = scene.gripper.profile()
    if not isinstance(profile, LinearRelease):
        return profile
    ends = [profile.dwell, profile.dwell + profile.opening]
    start = [] if profile.dwell == 0 else [0.0]
    return TableRelease([*start, *ends], [*[profile.full] * (len(start) + 1), 0.0])
