"""Measured throws: landing poses, conditions; planned throws as data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..models import Array, TableGrip
from ..planner import TICK, Plan
from ..problems import InputError, Scene, checked
from .throws import MeasuredThrow, Shared, ThrowData

#: Fewest samples of a flight that a parabola is fitted to.
SAMPLES = 21
#: Column with the pads' surface, which has contact parameters of its own.
SURFACE = "surface"
#: Column that tells throws of one condition from each other.
REPEAT = "repeat"


#: Pose error [m] of a throw for which a model predicts no landing.
MISSED = 10.0


def pose_errors(data: ThrowData, off: Array) -> Array:
    """Pose errors (39) (T,) [m] of predicted less measured landings (T, 2).

    Position plus angle times half the length; `MISSED` without a predicted landing.
    """
    lever = np.array([throw.object.half_length for throw in data.throws])
    return np.asarray(np.nan_to_num(np.abs(off[:, 0]) + np.abs(off[:, 1]) * lever, nan=MISSED))


def measured(data: ThrowData) -> Array:
    """Measured landings (T, 2): x [m], theta [rad] at the landing height.

    InputError for a track that never lands.
    """
    landing = []
    for throw in data.throws:
        if throw.landing is not None:
            landing.append((throw.landing[0], throw.landing[2]))
        elif throw.track is not None:
            landing.append(_from_track(data, throw, throw.track))
        else:
            raise InputError(f"throw {throw.name}: has no landing: add it to the data")
    return np.array(landing)


def _from_track(data: ThrowData, throw: MeasuredThrow, track: Array) -> tuple[float, float]:
    """x [m], theta [rad] as the CoM falls through the landing height."""
    start = throw.opening + throw.grip.opening
    flying = track[:, 0] >= start
    if flying.sum() < SAMPLES:
        raise InputError(
            f"throw {throw.name}: the track has {int(flying.sum())} samples after the opening, "
            f"must have at least {SAMPLES}"
        )
    height, gravity = data.shared.landing_height, data.shared.gravity
    times, x, z, theta = track[flying].T
    below = np.flatnonzero((z[1:] <= height) & (z[:-1] > height))
    if not below.size or gravity == 0:
        raise InputError(f"throw {throw.name}: no landing: the track never falls to {height:g} m")
    # A parabola through all samples has less noise than the last two samples.
    last = below[0] + 2
    t = times[:last] - start
    forward, turning = np.polyfit(t, x[:last], 1), np.polyfit(t, theta[:last], 1)
    rising = np.polyfit(t, z[:last] + gravity * t**2 / 2, 1)
    # Noise may put the top of the fitted parabola a little below the height.
    root = max(rising[0] ** 2 + 2 * gravity * (rising[1] - height), 0.0)
    time = (rising[0] + np.sqrt(root)) / gravity
    return float(np.polyval(forward, time)), float(np.polyval(turning, time))


def batch_surface(data: ThrowData) -> list[int]:
    """Rows of the throws on the most frequent surface: one contact fits one surface."""
    labels = [throw.factors.get(SURFACE, "") for throw in data.throws]
    frequent = max(dict.fromkeys(labels), key=labels.count)
    return [i for i, label in enumerate(labels) if label == frequent]


def conditions(data: ThrowData) -> list[tuple[str, ...]]:
    """The condition of each throw, its labels but the repeat's; without labels each has its own."""
    columns = [name for name in data.factors if name != REPEAT]
    if not columns:
        return [(throw.name,) for throw in data.throws]
    return [tuple(throw.factors[name] for name in columns) for throw in data.throws]


def throw_data(
    plans: Sequence[Plan],
    landings: Sequence[tuple[float, float] | None] | None = None,
    position_noise: float = 0.005,
    angle_noise: float = math.radians(2.0),
) -> ThrowData:
    """Throws of solved plans of one scene as a data set: the hand's motion, command and grip.

    landings: x [m], theta [rad] of each, None for one that is not known yet. position_noise [m],
    angle_noise [rad]: their standard deviations. Raises InputError for an empty list, for targets
    at several heights, and for landings that are not pairs of numbers.
    """
    if not plans:
        raise InputError("plans: must be a list of at least one plan")
    scene, height = plans[0].scene, plans[0].target.z
    if any(abs(plan.target.z - height) > 1e-9 for plan in plans):
        raise InputError("plans: their targets must be at one height")
    if any((p.scene.contact, p.scene.gripper) != (scene.contact, scene.gripper) for p in plans):
        raise InputError("plans: must be of one scene: their contacts or grippers differ")
    shared = Shared(
        landing_height=height,
        gravity=scene.gravity,
        faces=scene.contact.faces,
        torsion=scene.contact.torsion,
        position_noise=position_noise,
        angle_noise=angle_noise,
    )
    places = [None] * len(plans) if landings is None else landings
    if len(places) != len(plans):
        raise InputError(f"landings: must be {len(plans)}, one per plan, not {len(places)}")
    for number, place in enumerate(places, start=1):
        checked(f"landing {number}", place, tuple[float, float] | None, {})
    pairs = enumerate(zip(plans, places, strict=True), start=1)
    throws = [_recorded(f"throw-{number}", plan, place) for number, (plan, place) in pairs]
    return ThrowData(scene.name, shared, tuple(throws))


def _recorded(name: str, plan: Plan, landing: tuple[float, float] | None) -> MeasuredThrow:
    """A plan's throw as a recording on the plan's clock, from 50 ms before the command to 60 ms
    after the opening; the command leads by the mean delay."""
    sent = plan.sent_throw()
    first = max(sent.command_time - 0.05, 0.0)
    last = min(sent.detach_time + 0.06, sent.path.end)
    times = np.linspace(first, last, round((last - first) / TICK) + 1)
    return MeasuredThrow(
        name=name,
        object=sent.scene.object,
        grasp=sent.scene.grasp,
        times=times,
        motion=sent.hand(times).pose.T,
        command=sent.command_time,
        grip=_recorded_grip(sent.scene),
        landing=None if landing is None else (landing[0], sent.target.z, landing[1]),
        track=None,
        factors={},
    )


def delayed(data: ThrowData, delay: float) -> ThrowData:
    """The data set whose grip forces fall later by `delay` [s]."""
    throws = [replace(throw, grip=throw.grip.delayed(delay)) for throw in data.throws]
    return replace(data, throws=tuple(throws))


def _recorded_grip(scene: Scene) -> TableGrip:
    """The grip force from the command on, as a recording has it, without a delay beyond `dwell`."""
    profile = scene.gripper.profile()
    if isinstance(profile, TableGrip):
        return profile
    ends = [profile.dwell, profile.dwell + profile.opening]
    start = [] if profile.dwell == 0 else [0.0]
    return TableGrip([*start, *ends], [*[profile.full] * (len(start) + 1), 0.0])
