"""Whether a scene can have throws at all: starts from which none can begin."""

from __future__ import annotations

import math

import numpy as np

from ...models import Array, HandSamples
from ...problems import InputError, Scene
from ..throw import Manipulator, column_of, friction_use, outline, rest_torques, torque_limits
from ..verdict import column_distance, grasp_distance, hand_pairs, held_bar, lowest_of_bar

#: Random start poses that are checked where the start is free.
STARTS = 4000
#: Share of the random start poses that an arm can hold at rest with an empty hand, at which its
#: torque limits are refused. A robot holds all. With smaller limits no built-in scene had a plan in
#: 20 s at a tenth; `iiwa14` had one at a fifth.
HELD_SHARE = 0.1


def check_start(scene: Scene, manipulator: Manipulator) -> None:
    """InputError if no motion can begin as the scene says, in its start or any of `STARTS` random
    ones if that is free.

    That is where the object as gripped reaches into the palm, the grip does not hold it at rest,
    the arm does not hold itself, or the start is too near a limit, below the floor or in the base
    column.
    """
    _check_margin(scene, manipulator)
    limits, given = manipulator.planning, manipulator.start
    rng, size = np.random.default_rng(0), (STARTS, manipulator.size)
    q = rng.uniform(limits.q_min, limits.q_max, size).T if given is None else given[:, None]
    _check_grip(scene, manipulator, q)
    _check_palm(scene, manipulator)
    _check_torques(scene, manipulator, q)
    _check_place(scene, manipulator, q)


def _check_margin(scene: Scene, manipulator: Manipulator) -> None:
    """InputError if the planner's margin leaves a joint no range, or if a given start of an arm is
    nearer a limit."""
    limits, start = manipulator.planning, manipulator.start
    if (limits.q_min > limits.q_max).any():
        raise InputError(f"{scene.place}: [robot] position_margin leaves no room")
    if scene.robot is None or start is None:
        return
    for name, *values in zip(manipulator.joints, start, limits.q_min, limits.q_max, strict=True):
        value, low, high = (math.degrees(v) for v in values)
        if not low <= value <= high:
            raise InputError(
                f"{scene.place}: [robot] start_deg: {name} at {value:.2f} must be within "
                f"[{low:.2f}, {high:.2f}], the limits less position_margin"
            )


def _check_grip(scene: Scene, manipulator: Manipulator, q: Array) -> None:
    """InputError if the full grip holds the object at rest in none of the starts q (n, K)."""
    still = np.zeros_like(q)
    hand = HandSamples(np.zeros(q.shape[1]), *manipulator.motion(q, still, still))
    use = float(friction_use(scene, hand).min())
    allowed = 1.0 - scene.gripper.sticking_margin
    if use > allowed:
        full, table = scene.gripper.profile().full, scene.gripper.table
        given = f"force = {full:g}:" if table is None else f"table = {table}: {full:g} N is"
        where = "its start pose" if manipulator.start is not None else "any permitted start pose"
        raise InputError(
            f"{scene.place}: [gripper] {given} too weak to hold the object at rest in "
            f"{where}, needs at least {full * use / allowed:.3g} N"
        )


def _check_place(scene: Scene, manipulator: Manipulator, q: Array) -> None:
    """InputError if hand, arm or held bar is below the floor, or the bar in the base column, in all
    of the starts q (n, K)."""
    workspace, given = scene.workspace, manipulator.start is not None
    if workspace is None:
        return
    section = "robot" if scene.robot is not None else "hand"
    pose, heights = outline(manipulator, q)
    bar = held_bar(scene, pose)
    if workspace.floor is not None:
        lowest = np.minimum(heights, lowest_of_bar(scene.object, bar))
        below = workspace.floor - float(lowest.max())
        if below > 0:
            start = f"[{section}] start" if given else "every start"
            raise InputError(
                f"{scene.place}: {start} contradicts [workspace] floor = {workspace.floor:g}: "
                f"hand, arm or held bar begins {1e3 * below:.0f} mm below it"
            )
    column = column_of(scene)
    if column is not None and (column_distance(scene.object, bar, *column) < 0).all():
        raise InputError(
            f"{scene.place}: [{section}] start contradicts [workspace] column_radius = "
            f"{column[0]:g}: the held bar begins inside the base column"
        )


def _check_torques(scene: Scene, manipulator: Manipulator, q: Array) -> None:
    """InputError if the arm cannot hold the object at rest in its given start, or itself in more
    than `HELD_SHARE` of the random starts q (n, K): such limits are no robot's."""
    limits, given = torque_limits(scene), manipulator.start is not None
    if limits is None:
        return
    torques = np.abs(rest_torques(scene, manipulator, q, held=given))
    limits = limits * (1.0 - scene.torque_margin)
    use = torques / limits[:, None]
    if float((use.max(axis=0) <= 1.0).mean()) > HELD_SHARE:
        return
    worst = int(use.max(axis=1).argmax())
    need, most = torques[worst].max(), limits[worst]
    what = "the arm and the object at rest in [robot] start" if given else "the arm at rest"
    other = ", or begin elsewhere" if given else ""
    raise InputError(
        f"{scene.place}: {manipulator.joints[worst]} needs {'' if given else 'up to '}{need:.3g} "
        f"N m to hold {what}, its limit less the margin is {most:.4g} N m: take limits from the "
        f"data sheet, as [limits] torque in the arm's file or [torque] limits{other}"
    )


def _check_palm(scene: Scene, manipulator: Manipulator) -> None:
    """InputError if the object as gripped reaches into the hand's body."""
    if scene.arm is None:
        return
    if not scene.arm.tool.has_palm:
        _check_hand_shapes(scene, manipulator)
        return
    away, angle = grasp_distance(scene), math.degrees(scene.grasp.angle)
    if away < 0.0:
        raise InputError(
            f"{scene.place}: [grasp] angle_deg = {angle:g}, offset = {scene.grasp.offset:g}: the "
            f"object as gripped reaches {-1e3 * away:.0f} mm into the palm, which begins "
            f"{1e3 * scene.arm.tool.palm_front:.0f} mm behind the pads' centre"
        )


def _check_hand_shapes(scene: Scene, manipulator: Manipulator) -> None:
    """InputError if a clearance to a hand without a palm is required and no capsule keeps it."""
    arm, clearance, capsules = scene.arm, scene.bounds.palm_clearance, manipulator.capsules
    if arm is None or clearance is None:
        return
    pairs = [] if capsules is None else hand_pairs(scene, capsules)
    if capsules is None or not any(capsules.number[i] == capsules.hand for i, *_ in pairs):
        raise InputError(
            f"{scene.place}: [workspace] palm_clearance = {clearance:g}: the arm {arm.name} has "
            "neither a palm nor capsules of the hand farther than that from the object as gripped; "
            "give its file palm_back, palm_front and palm_half_width (import-robot --palm), or "
            "leave palm_clearance out"
        )
