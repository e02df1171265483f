"""A motion played on a Franka: slowly to the start pose, thrown at 1 kHz, and recorded."""

from __future__ import annotations

import dataclasses
import gc
import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...models import Array
from ...models.robot import Arm
from ...problems import InputError, ThrowPlane
from ..clearance import BAR, CollisionScene
from ..throw import TICK, Samples, braked, joint_limits, within_limits
from ..verdict import Code, Finding, collision, held_verdict
from .controller_files import JointMotion
from .expectations import Expectations, swept_bodies
from .franka import STILL, Franka, controller_errors, load_franka
from .gripper import MOVED, OPEN_WIDTH, SPEED, GripperLink, GripperState
from .learning import corrected
from .recording import Recording

#: Time [s] after the opening command in which the gripper must have begun to open.
UNOPENED = 3.0
#: Time [s] in which the gripper ends a motion.
GRIPPER_ENDS = 10.0
#: Grip force [N] with which it closes: the Franka Hand's largest continuous one, by its data sheet.
GRIP_FORCE = 70.0
#: Allowed difference [m] of the grasped width from the first one, smaller and larger.
GRASP_TOLERANCE = 0.005
#: Distance [samples] of the instants at which the arm may stop on the way, and shortest notice.
STOPS, NOTICE = 10, 2
#: Speed [m/s] of the fastest point of arm and hand in a rehearsal: reduced speed, ISO 10218-1.
REHEARSAL_SPEED = 0.25

#: From a sample on, other joint positions to send, and where they end.
Detour = tuple[int, list[Any], Array]


def throws(
    franka: Franka, plan: JointMotion, sent: JointMotion, ask: Callable[[str], None]
) -> Iterator[Recording]:
    """Throw repeatedly: first `sent`, then each time the motion corrected by the last recording.

    ask: called with what comes next before anything moves; its exceptions stop the throws. They
    end after a throw with trouble.
    """
    grasp: GripperState | None = None
    while True:
        start, gripper = franka.check(plan.arm)
        grasp, way = grasp or gripper, approach(sent, start)
        ask(
            f"{_approach_words(franka, sent, start)}, then the throw in {sent.times[-1]:.2f} s; "
            f"the gripper {_closes(gripper, grasp)}\n{Expectations(sent, way).words}"
        )
        if not _equal(gripper, grasp):
            _close_again(franka.gripper, grasp)
        recording = play(franka, sent, way)
        yield recording
        if recording.trouble:
            return
        sent, _ = corrected(plan, recording)


def rehearse(
    franka: Franka, plan: JointMotion, sent: JointMotion, ask: Callable[[str], None]
) -> Recording:
    """Send the motion slowly, with an empty hand that stays closed.

    Its time is stretched until no point of arm and hand is faster than `REHEARSAL_SPEED`.
    InputError for a gripper that holds something, besides those of `throws`.
    """
    start, gripper = franka.check(plan.arm)
    if gripper.holds:
        raise InputError(f"{franka.host}: --rehearse: the gripper holds an object: take it out")
    slow, way = slowed(sent), approach(sent, start)
    ask(
        f"{_approach_words(franka, sent, start)}, then the motion {_stretch(sent):.1f} times as "
        f"slow, in {TICK * (len(slow) - 1):.1f} s; the gripper stays {1e3 * gripper.width:.0f} mm "
        f"open\n{Expectations(sent, way).words}"
    )
    return _send(franka, way, slow, _Watch(franka.gripper, gripper))


def slowed(motion: JointMotion) -> Array:
    """The path of a motion at `REHEARSAL_SPEED`: joints (N, joints) [rad] every millisecond."""
    stretch, throw = _stretch(motion), motion.throw
    path = throw.samples.path
    _, q, dq, ddq = path.at(np.arange(0.0, path.end + TICK / stretch, TICK / stretch))
    samples = Samples(q.T, dq.T / stretch, ddq.T / stretch**2)
    return JointMotion.of(dataclasses.replace(throw, samples=samples)).q


def _stretch(motion: JointMotion) -> float:
    """How many times as slow a rehearsal is."""
    return max(float(motion.throw.measured.speed.value) / REHEARSAL_SPEED, 1.0)


def play(franka: Franka, motion: JointMotion, way: Array) -> Recording:
    """Move along `way` (N, joints) [rad] to the motion's start; throw; record.

    If the object is lost before the opening command, the arm brakes at once, and the gripper gets
    no command. A gripper that does not open needs no other motion: after the opening it is the
    brake. Both are the recording's `trouble`. InputError for errors of the controller, and if the
    arm does not come to rest at the goal.
    """
    watch = _Watch(franka.gripper, franka.gripper.state(), motion)
    recording = _send(franka, way, motion.q, watch)
    return dataclasses.replace(recording, trouble=watch.lost or watch.unopened())


class _Watch:
    """The gripper during a motion: its opening in time, its width, and what goes wrong.

    before: its state before the motion; motion: with an opening, None without one.
    """

    def __init__(
        self, gripper: GripperLink, before: GripperState, motion: JointMotion | None = None
    ) -> None:
        self.gripper, self.before, self.lost = gripper, before, ""
        #: Of the robot's clock [s], 0 at the first sample; NaN while no command is given.
        self.command_time = math.nan
        self.widths = [(0.0, before.width)]
        self._due = math.inf if motion is None else motion.throw.command_time
        self._stops = [] if motion is None else stops(motion)

    def drain(self, elapsed: float) -> None:
        """Called in each cycle before the motion: no report waits for its first cycle."""
        self.gripper.update()

    def cycle(self, elapsed: float) -> Detour | None:
        """Called in each cycle: order the opening in that of its command, and look at the width."""
        if self.lost:
            return None
        if math.isnan(self.command_time) and elapsed + TICK > self._due:
            # The gripper's process waits for the rest of the cycle.
            wait = max(self._due - elapsed, 0.0)
            self.gripper.order("move", OPEN_WIDTH, SPEED, after=wait)
            self.command_time = elapsed + wait
        if not self.gripper.update():
            return None
        now = self.gripper.states[-1]
        self.widths.append((elapsed, now.width))
        if not math.isnan(self.command_time) or math.isinf(self._due):
            return None
        if abs(now.width - self.before.width) < MOVED and now.holds == self.before.holds:
            return None
        ahead = [stop for stop in self._stops if stop[0] >= elapsed / TICK + NOTICE]
        if not ahead:
            return None
        self.lost = (
            f"the object was lost {elapsed:.2f} s after the start: the gripper went from "
            f"{1e3 * self.before.width:.0f} to {1e3 * now.width:.0f} mm; the arm braked, the "
            "gripper got no command: grasp it better, or throw more slowly"
        )
        return ahead[0]

    def unopened(self) -> str:
        """What is wrong with a gripper that has not opened after its command, in words."""
        end = (self.gripper.ordered or time.monotonic()) + UNOPENED
        while True:
            widest = max(state.width for state in self.gripper.states)
            if widest > self.before.width + MOVED:
                return ""
            if time.monotonic() > end:
                return (
                    f"the gripper did not open: {1e3 * widest:.0f} mm wide {UNOPENED:g} s after "
                    "its command; the arm stopped by its planned brake: see Desk for the gripper's "
                    "state"
                )
            self.gripper.update(0.1)


def stops(motion: JointMotion) -> list[Detour]:
    """Ways to stop on the way to the opening command, from samples `STOPS` apart.

    Each is the motion up to its sample, then the brake as fast as the limits allow; only those that
    meet nothing with the object in the hand.
    """
    throw, found = motion.throw, []
    scene, manipulator, sent = throw.scene, throw.manipulator, throw.samples
    for sample in range(STOPS, motion.cycle + STOPS, STOPS):
        upto = slice(0, sample + 1)
        samples = braked(manipulator, Samples(sent.q[upto], sent.dq[upto], sent.ddq[upto]))
        if held_verdict(scene, manipulator, samples, sample).ok:
            q = JointMotion.of(dataclasses.replace(throw, samples=samples)).q
            found.append((sample, _positions(q), q))
    return found


def _positions(q: Array) -> list[Any]:
    """The binding's commands for joints (N, joints) [rad]."""
    binding = load_franka()
    return [binding.JointPositions(row) for row in q.tolist()]


def _send(franka: Franka, way: Array, q: Array, watch: _Watch) -> Recording:
    """Move along `way` to the start, then send q, both (N, joints) [rad] every millisecond."""
    # The commands are made before the stream begins.
    first, sent = _positions(way), _positions(q)
    gc.disable()
    try:
        with controller_errors(franka.host):
            mode = load_franka().ControllerMode.JointImpedance
            control = franka.robot.start_joint_position_control(mode)
            _stream(control, first, way, watch.drain)
            seen, sent, q = _stream(control, sent, q, watch.cycle)
            sent[-1].motion_finished = True
            control.readOnce()
            control.writeOnce(sent[-1])
    finally:
        gc.enable()
    times = np.array([elapsed for elapsed, _ in seen])
    rows = np.minimum(np.rint(times / TICK).astype(int), len(q) - 1)
    known = np.searchsorted([time for time, _ in watch.widths], times, "right") - 1
    return Recording(
        times,
        np.array([state.q for _, state in seen]),
        np.array([state.dq for _, state in seen]),
        q[rows],
        np.array([width for _, width in watch.widths])[known],
        watch.command_time,
    )


def _approach_words(franka: Franka, motion: JointMotion, start: Array) -> str:
    """The way to the start pose, in words."""
    away = np.abs(start - motion.q[0])
    return (
        f"{motion.arm.name} at {franka.host}: to the start pose (joint {away.argmax() + 1} moves "
        f"{away.max():.2f} rad)"
    )


def _closes(now: GripperState, grasp: GripperState) -> str:
    """The gripper's action before the throw, in words."""
    what = "an object" if grasp.holds else "nothing"
    if _equal(now, grasp):
        return f"is {1e3 * now.width:.0f} mm open and holds {what}"
    return f"closes to {1e3 * grasp.width:.0f} mm again, on {what}"


def _equal(one: GripperState, other: GripperState) -> bool:
    return one.holds == other.holds and abs(one.width - other.width) < MOVED


def _close_again(gripper: GripperLink, grasp: GripperState) -> None:
    """Close the gripper as before the first throw; InputError if it lacks the object."""
    if grasp.holds:
        tolerances = GRASP_TOLERANCE, GRASP_TOLERANCE
        gripper.order("grasp", grasp.width, *tolerances, SPEED, GRIP_FORCE)
    else:
        gripper.order("move", grasp.width, SPEED)
    result = gripper.result(GRIPPER_ENDS) or "does not end"
    if not _equal(gripper.state(), grasp):
        what = "its gripper holds nothing" if grasp.holds else f"closing it {result}"
        raise InputError(f"{gripper.host}: {what}: put the object between the pads")


def _stream(
    control: Any,
    commands: list[Any],
    q: Array,
    cycle: Callable[[float], Detour | None] = lambda elapsed: None,
) -> tuple[list[tuple[float, Any]], list[Any], Array]:
    """Send a command per millisecond of the robot's clock, the last one until the arm stands.

    commands: the binding's for joints q (N, joints) [rad]. It stands once it has been at rest for
    0.1 s, within 0.03 rad of the last; InputError if it does not within 5 s. cycle: called in each
    cycle with the time [s] since the first command; may change the commands that are to come.
    Returns that time and the robot's state in each cycle, and the commands and joints sent.
    """
    seen: list[tuple[float, Any]] = []
    first, still = None, 0
    while True:
        state, _ = control.readOnce()
        now = state.time.to_sec()
        first = now if first is None else first
        elapsed, last = now - first, len(commands) - 1
        # The motion follows the clock: missed cycles are skipped.
        sample = min(round(elapsed / TICK), last)
        control.writeOnce(commands[sample])
        seen.append((elapsed, state))
        if (detour := cycle(elapsed)) is not None:
            _, commands, q = detour
            continue
        if sample < last:
            continue
        still = still + 1 if max(map(abs, state.dq)) < STILL else 0
        away = np.abs(np.array(state.q) - q[-1])
        if still >= 0.1 / TICK and away.max() < 0.03:
            return seen, commands, q
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
    track = swept_bodies(motion, q[places], TICK * places)
    for found in obstacles.clearances(track):
        return collision(found).words
    floor = None if scene.workspace is None else scene.workspace.floor
    if floor is None:
        return ""
    clearance = track.ends[-1, :, 2].min(axis=0) - track.radius[-1] - floor
    # At the start of a throw the capsule around the bar may be below the floor.
    lowest = (clearance - min(clearance[-1], 0.0)).min()
    return "" if lowest >= -1e-6 else Finding(Code.FLOOR, floor + lowest, floor, body=BAR).words
