"""Why there is no throw, in words: starts from which none can begin, bounds that contradict the
target, and what the attempts broke."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ...models import Array, FlightState, HandSamples
from ...problems import InputError, Pose, Scene
from ..clearance import column_distance, grasp_distance, held_bar, lowest_of_bar
from ..samples import Releases
from ..throw import (
    Manipulator,
    column_of,
    friction_use,
    outline,
    rest_torques,
    torque_limits,
)
from .attempt import Attempt

#: Random start poses that are checked where the start is free.
STARTS = 4000
#: Share of the random start poses that an arm can hold at rest with an empty hand, at which its
#: torque limits are refused. A robot holds all. With smaller limits no built-in scene had a plan in
#: 20 s at a tenth; `iiwa14` had one at a fifth.
HELD_SHARE = 0.1
#: A bound contradicts the target if all near sampled releases miss it by more than this factor.
FACTOR = 2.0


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
    _check_palm(scene)
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
    use = torques / limits[:, None]
    if float((use.max(axis=0) <= 1.0).mean()) > HELD_SHARE:
        return
    worst = int(use.max(axis=1).argmax())
    need, most = torques[worst].max(), limits[worst]
    what = "the arm and the object at rest in [robot] start" if given else "the arm at rest"
    other = ", or begin elsewhere" if given else ""
    raise InputError(
        f"{scene.place}: {manipulator.joints[worst]} needs {'' if given else 'up to '}{need:.3g} "
        f"N m to hold {what}, its limit is {most:g} N m: take limits from the data sheet, as "
        f"[limits] torque in the arm's file or [torque] limits{other}"
    )


def _check_palm(scene: Scene) -> None:
    """InputError if the object as gripped reaches into the hand's body."""
    if scene.arm is None or not scene.arm.tool.palm_half_width:
        return
    away, angle = grasp_distance(scene), math.degrees(scene.grasp.angle)
    if away < 0.0:
        raise InputError(
            f"{scene.place}: [grasp] angle_deg = {angle:g}, offset = {scene.grasp.offset:g}: the "
            f"object as gripped reaches {-1e3 * away:.0f} mm into the palm, which begins "
            f"{1e3 * scene.arm.tool.palm_front:.0f} mm behind the pads' centre"
        )


def in_column(scene: Scene, target: Pose) -> bool:
    """Whether the bar would be inside the base column at all poses that the tolerance allows."""
    column, most = column_of(scene), scene.tolerance
    if column is None:
        return False
    x, theta = target.grid(21)
    if target.theta is None:
        x, theta = np.array(np.meshgrid(x, np.linspace(0.0, math.pi, 181))).reshape(2, -1)
    poses = np.array([x, np.full(x.size, target.z), theta])
    room = column_distance(scene.object, poses, *column).max()
    return bool(room < -most.position - most.angle * scene.object.length)


def contradiction(scene: Scene, releases: Callable[[], Releases], target: Pose) -> tuple[str, str]:
    """The first bound of [landing], or latest arrival, that contradicts the target: name and words.

    The 200 sampled releases that land nearest decide; both are empty without a contradiction.
    """
    bounds, latest = scene.landing, target.window[1]
    if bounds is None and not math.isfinite(latest):
        return "", ""
    table = releases()
    x, theta, flown = table.landings(target.z, scene.flight)
    if not np.isfinite(x).any():
        return "", ""
    off = scene.object.pose_error(*target.miss(x, theta))
    near = np.argsort(off)[: min(200, int(np.isfinite(off).sum()))]
    end = scene.flight.after(FlightState(*table.detach[near].T), flown[near])
    speed, omega = np.hypot(end.v_x, end.v_z), end.omega
    # Rates of either sign pass through zero.
    rate = np.abs(omega) if (omega > 0).all() or (omega < 0).all() else 0 * omega
    time = table.run_up[near] + scene.gripper.profile().opening + flown[near]
    bounds_of: list[tuple[str, float | None, Array, str]] = [
        ("[target] arrival", latest, time, "s")
    ]
    if bounds is not None:
        bounds_of += [
            ("[landing] speed_max", bounds.speed_max, speed, "m/s"),
            ("[landing] rate_max", bounds.rate_max, rate, "rad/s"),
            ("[landing] speed_min", bounds.speed_min or None, -speed, "m/s"),
        ]
    for name, bound, values, unit in bounds_of:
        words = _words(name, bound, values, unit)
        if words:
            return name.split()[1], words
    return "", ""


def _words(name: str, bound: float | None, values: Array, unit: str) -> str:
    """Why values contradict an upper bound, or (values negative) a lower one; else empty."""
    least = float(values.min())
    if bound is None:
        return ""
    if least > 0 and least > FACTOR * bound:
        how = f"at least about {least:.2g} {unit}"
    elif least < 0 and -least * FACTOR < bound:
        how = f"at most about {-least:.2g} {unit}"
    else:
        return ""
    kind = "after" if unit == "s" else "with"
    return f"{name} = {bound:g}: throws to this target land {kind} {how}"


def nothing_found(tried: Sequence[Attempt], broken: Sequence[Attempt], late: bool) -> str:
    """Why there is no throw, in words: how many attempts there were, and what they broke."""
    if not tried:
        begun = "time was over before the first attempt"
        words = f"no throw found: {begun if late else 'no feasible release to start from'}"
    else:
        words = f"no throw found in {len(tried)} attempts"
        if len(broken) < len(tried):
            words += f": {len(tried) - len(broken)} led to no motion that keeps all constraints"
        if broken:
            words += f"; what a throw broke: {broken[0].reason}"
    return words + ("; time is over, more patience may help" if late else "")
