"""A motion played on a Franka: slowly to the start pose, thrown at 1 kHz, and recorded."""

from __future__ import annotations

import dataclasses
import gc
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array
from ...models.robot import Arm
from ...problems import InputError, ThrowPlane
from ..clearance import BAR, CollisionScene, SweptBodies, bar_ends, held_bar
from ..throw import TICK, Samples, joint_limits, within_limits
from ..verdict import Code, Finding, collision
from .controller_files import OPEN_WIDTH, JointMotion
from .franka import STILL, Franka, GripperLink, GripperState, controller_errors, load_franka
from .learning import corrected
from .recording import Recording

#: Largest speed [m/s] of the gripper.
GRIPPER_SPEED = 0.2


def throws(
    franka: Franka, plan: JointMotion, sent: JointMotion, ask: Callable[[str], None]
) -> Iterator[Recording]:
    """Throw repeatedly: first `sent`, then each time the motion corrected by the last recording.

    ask: called with what comes next before anything moves; its exceptions stop the throws.
    """
    grasp: GripperState | None = None
    while True:
        start, gripper = franka.check(plan.arm)
        grasp, way = grasp or gripper, approach(sent, start)
        away = np.abs(start - sent.q[0])
        ask(
            f"{plan.arm.name} at {franka.host}: to the start pose (joint {away.argmax() + 1} moves "
            f"{away.max():.2f} rad), then the throw in {sent.times[-1]:.2f} s; the gripper "
            f"{_closes(gripper, grasp)}"
        )
        if not _equal(gripper, grasp):
            _close_again(franka.gripper, grasp)
        recording = play(franka, sent, way)
        yield recording
        sent, _ = corrected(plan, recording)


def play(franka: Franka, motion: JointMotion, way: Array) -> Recording:
    """Move along `way` (N, joints) [rad] to the motion's start; throw; record.

    InputError for errors of the controller, and if the arm does not come to rest at the goal.
    """
    binding, gripper = load_franka(), franka.gripper
    # The commands are made before the stream begins.
    first, sent = ([binding.JointPositions(row) for row in q.tolist()] for q in (way, motion.q))
    # The order is sent in the command's cycle; the gripper's process waits for the rest of it.
    command = motion.throw.command_time
    orders: list[float] = []
    before = gripper.state().width
    widths = [(0.0, before)]

    def cycle(elapsed: float) -> None:
        if not orders and elapsed + TICK > command:
            wait = max(command - elapsed, 0.0)
            gripper.order("move", OPEN_WIDTH, GRIPPER_SPEED, after=wait)
            orders.append(elapsed + wait)
        elif len(widths) < 2 and orders and gripper.has_answer():
            widths.append((elapsed, gripper.answer().width))

    gc.disable()
    try:
        with controller_errors(franka.host):
            mode = binding.ControllerMode.JointImpedance
            control = franka.robot.start_joint_position_control(mode)
            _stream(control, first, motion.q[0])
            seen = _stream(control, sent, motion.q[-1], cycle)
            sent[-1].motion_finished = True
            control.readOnce()
            control.writeOnce(sent[-1])
    finally:
        gc.enable()
    if len(widths) < 2:
        gripper.answer()
    times = np.array([elapsed for elapsed, _ in seen])
    rows = np.minimum(np.rint(times / TICK).astype(int), len(motion.q) - 1)
    known = np.searchsorted([time for time, _ in widths], times, "right") - 1
    return Recording(
        times,
        np.array([state.q for _, state in seen]),
        np.array([state.dq for _, state in seen]),
        motion.q[rows],
        np.array([width for _, width in widths])[known],
        orders[0],
    )


def _closes(now: GripperState, grasp: GripperState) -> str:
    """The gripper's action before the throw, in words."""
    what = "an object" if grasp.holds else "nothing"
    if _equal(now, grasp):
        return f"is {1e3 * now.width:.0f} mm open and holds {what}"
    return f"closes to {1e3 * grasp.width:.0f} mm again, on {what}"


def _equal(one: GripperState, other: GripperState) -> bool:
    return one.holds == other.holds and abs(one.width - other.width) < 2e-3


def _close_again(gripper: GripperLink, grasp: GripperState) -> None:
    """Close the gripper as before the first throw; InputError if it lacks the object."""
    if grasp.holds:
        force = 70.0  # N, the largest continuous one
        gripper.order("grasp", grasp.width, GRIPPER_SPEED, force)
    else:
        gripper.order("move", grasp.width, GRIPPER_SPEED)
    if gripper.answer().holds != grasp.holds:
        raise InputError(
            f"{gripper.host}: its gripper holds nothing: put the object between the pads"
        )


def _stream(
    control: Any, commands: Sequence[Any], goal: Array, cycle: Callable[[float], None] | None = None
) -> list[tuple[float, Any]]:
    """Send a command per millisecond of the robot's clock, the last one until the arm stands.

    It stands once it has been at rest for 0.1 s, within 0.03 rad of the goal (joints,) [rad], which
    is the last command; InputError if it does not within 5 s. cycle: called in each cycle with the
    time [s] since the first command. Returns that time and the robot's state in each cycle.
    """
    seen: list[tuple[float, Any]] = []
    last, first, still = len(commands) - 1, None, 0
    while True:
        state, _ = control.readOnce()
        now = state.time.to_sec()
        first = now if first is None else first
        elapsed = now - first
        # The motion follows the clock: missed cycles are skipped.
        sample = min(round(elapsed / TICK), last)
        control.writeOnce(commands[sample])
        seen.append((elapsed, state))
        if cycle is not None:
            cycle(elapsed)
        if sample < last:
            continue
        still = still + 1 if max(map(abs, state.dq)) < STILL else 0
        away = np.abs(np.array(state.q) - goal)
        if still >= 0.1 / TICK and away.max() < 0.03:
            return seen
        if elapsed > TICK * last + 5.0:
            raise InputError(
                f"the arm does not come to stand where it was sent: joint {away.argmax() + 1} is "
                f"{away.max():.3f} rad away: check the load set in Desk"
            )


# The way to the start pose.


def approach(motion: JointMotion, start: Array) -> Array:
    """All joints (N, joints) [rad] every millisecond, slowly from rest at `start` to the motion's.

    Straight, or else by a raised pose: the shoulder in the middle of its range, other joints as in
    the start pose. InputError if neither keeps the arm's limits, or if arm or held bar would come
    too close to the floor, an obstacle, or each other.
    """
    arm, goal = motion.arm, motion.q[0]
    raised, shoulder = goal.copy(), arm.throwing_joints[0] - 1
    raised[shoulder] = (arm.limits.position_min[shoulder] + arm.limits.position_max[shoulder]) / 2
    straight = _straight(arm, start, goal)
    collision_words = _collision(motion, straight)
    if not collision_words:
        return straight
    way = np.vstack([_straight(arm, start, raised), _straight(arm, raised, goal)[1:]])
    if _collision(motion, way):
        raise InputError(
            f"the way to the start pose is not clear: {collision_words}: guide the arm nearer to it"
        )
    return way


def _straight(arm: Arm, start: Array, goal: Array) -> Array:
    """Joints (N, joints) from rest to rest within all limits; InputError if there are none."""
    import ruckig

    n, limits = arm.joints, joint_limits(arm, range(1, arm.joints + 1))
    order, trajectory = ruckig.InputParameter(n), ruckig.Trajectory(n)
    order.current_position, order.target_position = start.tolist(), goal.tolist()
    # Shares of the limits, halved until those that depend on the position hold.
    for share in 0.5 ** np.arange(6):
        order.max_velocity = (0.2 * share * limits.dq).tolist()
        order.max_acceleration = (0.1 * share * limits.ddq).tolist()
        order.max_jerk = (0.1 * share * limits.jerk).tolist()
        if ruckig.Ruckig(n).calculate(order, trajectory) != ruckig.Result.Working:
            break
        times = np.arange(0.0, trajectory.duration + TICK, TICK)
        states = np.array([trajectory.at_time(min(t, trajectory.duration)) for t in times])
        rows = np.moveaxis(states, 1, 0)
        # Joint by joint: an arm may have more joints than the core takes at once.
        if all(
            within_limits(joint_limits(arm, [j + 1]), Samples(*rows[:, :, j : j + 1]))
            for j in range(n)
        ):
            return states[:, 0]
    raise InputError("the way to the start pose breaks a limit: guide the arm nearer to it")


def _collision(motion: JointMotion, q: Array) -> str:
    """The first collision on a way (N, joints) to the start pose, in words; empty without one."""
    scene, capsules = motion.throw.scene, motion.throw.manipulator.capsules
    if capsules is None:
        return ""
    # The first link turns about its own axis; the flange turns with the hand.
    moved = (min(number, motion.arm.joints) - 1 for number in capsules.number)
    obstacles = dataclasses.replace(
        CollisionScene.of(scene, motion.throw.manipulator, ThrowPlane(0.0, 0.0)),
        arm=dataclasses.replace(capsules, moved_by=tuple(joint or -1 for joint in moved)),
    )
    # The core also measures the motion between these samples.
    places = np.unique(np.append(np.arange(0, len(q), 10), len(q) - 1))
    track = _track(motion, q[places], TICK * places)
    for found in obstacles.clearances(track):
        return collision(found).words
    floor = None if scene.workspace is None else scene.workspace.floor
    if floor is None:
        return ""
    clearance = track.ends[-1, :, 2].min(axis=0) - track.radius[-1] - floor
    # At the start of a throw the capsule around the bar may be below the floor.
    lowest = (clearance - min(clearance[-1], 0.0)).min()
    return "" if lowest >= -1e-6 else Finding(Code.FLOOR, floor + lowest, floor, body=BAR).words


def _track(motion: JointMotion, q: Array, times: Array) -> SweptBodies:
    """Links, hand and held bar in the base frame, with joints q (N, joints) at times (N,) [s]."""
    throw, arm, capsules = motion.throw, motion.arm, motion.throw.manipulator.capsules
    assert capsules is not None
    angles = ca.SX.sym("q", arm.joints)
    frames = arm.frames(angles)
    hand = frames[-1] + 0
    hand[:3, 3] -= arm.tool.tcp * hand[:3, 2]
    links = ca.Function("links", [angles], [ca.vec(f) for f in (*frames[: arm.joints], hand)])
    # (links, N, 4, 4), the base first.
    found = [np.array(v).T.reshape(-1, 4, 4).swapaxes(1, 2) for v in links.map(len(q))(q.T)]
    at = np.array([np.broadcast_to(np.eye(4), (len(q), 4, 4)), *found])
    # The throw's start gives the pose of the bar in the hand.
    place = throw.path.at([0.0]).pose
    pose = throw.manipulator.motion(place, 0 * place, 0 * place)[0]
    ends = bar_ends(throw.scene.object, held_bar(throw.scene, pose))[0, :, :, 0]
    bar = throw.target.plane.points(ends[:, 0], ends[:, 2])
    grasp = np.array(links(motion.q[0])[-1]).reshape(4, 4, order="F")
    local = (bar - grasp[:3, 3]) @ grasp[:3, :3]
    bodies = [(c.link, np.array([c.begin, c.end])) for c in arm.capsules] + [(-1, local)]
    placed = [
        np.einsum("nij,kj->kin", at[link][:, :3, :3], two) + at[link][:, :3, 3].T
        for link, two in bodies
    ]
    width = throw.scene.object.width / np.sqrt(2)
    cover = np.append(np.full(len(arm.capsules), arm.cover), 0.0)
    radius = np.append(capsules.radius, width)
    return SweptBodies((*capsules.names, BAR), np.array(placed), radius, cover, times)
