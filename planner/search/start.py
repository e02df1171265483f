"""Whether the grip can hold the object at rest where the throw may start."""

from __future__ import annotations

import math

import numpy as np

from ...models import HandSamples
from ...problems import InputError, Scene
from ..check import Mover, friction_use

#: Random start poses looked at when the start is free.
POSES = 4000


def check_start(scene: Scene, mover: Mover) -> None:
    """InputError if no permitted start pose lets the full grip hold the object at rest."""
    limits = mover.planning
    if (limits.q_min > limits.q_max).any():
        raise InputError(f"{scene.place}: [robot] position_margin leaves no room")
    if mover.start is not None:
        q = mover.start[:, None]
        _check_margin(scene, mover)
    else:
        rng = np.random.default_rng(0)
        q = rng.uniform(limits.q_min, limits.q_max, (POSES, mover.size)).T
    zero = np.zeros_like(q)
    hand = HandSamples(np.zeros(q.shape[1]), *(np.array(o) for o in mover.motion(q, zero, zero)))
    force, torque = friction_use(scene, hand)
    use = float(np.sqrt(force**2 + torque**2).min())
    allowed = 1.0 - scene.mesh.sticking_margin
    if use > allowed:
        full = scene.gripper.profile().full
        table = scene.gripper.table
        given = f"force = {full:g}:" if table is None else f"table = {table}: {full:g} N is"
        where = "its start pose" if mover.start is not None else "any permitted start pose"
        raise InputError(
            f"{scene.place}: [gripper] {given} too weak to hold the object at rest in "
            f"{where}, needs at least {full * use / allowed:.3g} N"
        )


def _check_margin(scene: Scene, mover: Mover) -> None:
    """InputError if a given start of an arm is nearer a limit than the planner's margin."""
    limits = mover.planning
    if scene.robot is None or mover.start is None:
        return
    for name, *values in zip(mover.joints, mover.start, limits.q_min, limits.q_max, strict=True):
        value, low, high = (math.degrees(v) for v in values)
        if not low <= value <= high:
            raise InputError(
                f"{scene.place}: [robot] start_deg: {name} at {value:.2f} must be within "
                f"[{low:.2f}, {high:.2f}], the limits less position_margin"
            )
