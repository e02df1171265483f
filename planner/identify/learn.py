"""Learning from few throws: what was planned and thrown, as data; a prior, then a posterior."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...models import LinearRelease, TableRelease
from ...problems import InputError, MeasuredThrow, Scene, Shared, ThrowData
from ..check import hand_samples
from ..result import Plan, sent_throw
from .fit import fit_to
from .fit_belief import Belief
from .fit_scene import applied
from .fit_starts import starts_from_prior
from .measured import measured
from .predict import Parameters, Predictor

Array = npt.NDArray[np.float64]

#: What is recorded of the hand: from so long before the command to so long after the
#: opening [s], every `TICK` seconds.
BEFORE, AFTER, TICK = 0.05, 0.06, 0.001


def recorded(
    plan: Plan, landing: tuple[float, float] | None = None, name: str = "throw"
) -> MeasuredThrow:
    """A solved plan's throw as a recording: the hand's motion, the command, the grip force.

    landing: x [m] and theta [rad] where it came down, None where that is not known yet.
    The clock is the plan's; the command goes out earlier by the delay that the scene knows.
    """
    sent = sent_throw(plan)
    command, end = sent.command_time, sent.detach_time + AFTER
    first, last = max(command - BEFORE, 0.0), min(end, sent.until)
    times = np.linspace(first, last, round((last - first) / TICK) + 1)
    hand = hand_samples(sent.mover, sent.motion, times)
    pose = None if landing is None else (landing[0], sent.target.z, landing[1])
    scene = sent.scene
    return MeasuredThrow(
        name, scene.object, scene.grasp, times, hand.pose.T, command, _table(scene), pose, None, {}
    )


def throw_data(
    plans: list[Plan],
    landings: list[tuple[float, float]] | None = None,
    position_noise: float = 0.005,
    angle_noise: float = np.radians(2.0),
) -> ThrowData:
    """Throws of one scene as a data set; the landings as in `recorded`, in the same order."""
    if not plans:
        raise InputError("no throws: give at least one plan")
    scene = plans[0].scene
    height = plans[0].target.z
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
    throws = [
        recorded(plan, landing, f"throw-{number}")
        for number, (plan, landing) in enumerate(zip(plans, places, strict=True), start=1)
    ]
    return ThrowData(scene.name, shared, tuple(throws))


def thrown(data: ThrowData, model: str, contact: dict[str, float]) -> Array:
    """Landings (T, 2), x [m] and theta [rad], of the throws with this contact: a stand-in
    for reality. contact: friction, patch_radius, and delay [s], grip_scale if they differ."""
    columns = {name: np.array([value]) for name, value in contact.items()}
    return np.asarray(Predictor(data).predict(model, Parameters(**columns)).landing[:, 0, :2])


def updated(prior: Belief, data: ThrowData, model: str = "sp") -> Belief:
    """The posterior of the prior's unknowns after the throws."""
    predictor, truth = Predictor(data), measured(data)
    starts = starts_from_prior(predictor, model, truth, prior)
    return fit_to(predictor, model, truth, prior.names, starts, prior).posterior


def apply(posterior: Belief, scene: Scene) -> Scene:
    """The scene with the posterior as its contact and uncertainty, to plan anew."""
    return applied(posterior, scene)


def _table(scene: Scene) -> TableRelease:
    """The grip force from the command on, as a recording has it."""
    profile = scene.gripper.profile()
    if isinstance(profile, LinearRelease):
        ends = [profile.dwell, profile.dwell + profile.opening]
        start = [] if profile.dwell == 0 else [0.0]
        return TableRelease([*start, *ends], [*[profile.full] * (len(start) + 1), 0.0])
    return profile
