"""A motion played on a Franka: slowly to the start pose, thrown at 1 kHz, and recorded."""

from __future__ import annotations

import contextlib
import gc
import itertools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...cycles import joined, lifted_pose, raised_pose, standstill
from ...models import Array, Trajectory
from ...planner import (
    TICK,
    Code,
    Samples,
    SentMotion,
    SpatialScene,
    State,
    arm_excesses,
    joint_limits,
    motion_verdict,
    transfer,
)
from ...problems import Arm, InputError
from ..expectations import Expectations, swept_bodies
from ..gripper import GRASP_TOLERANCE, MOVED, OPEN_WIDTH, SPEED, GripperLink, GripperState
from ..learning import corrected
from ..motions import arm_of, grasp_of
from ..recording import Recording
from .connection import STILL, Franka, binding_errors
from .watch import Stop, Watch, equal, find_stops

#: Speed [m/s] of the fastest end of the capsules of arm, hand and held bar in a rehearsal: reduced
#: speed, ISO 10218-1.
REHEARSAL_SPEED = 0.25
#: Height [m] above the start pose from which the arm may come to it.
ABOVE = 0.3


def throws(
    franka: Franka, plan: SentMotion, sent: SentMotion, ask: Callable[[str], None]
) -> Iterator[Recording]:
    """Throw repeatedly: first `sent`, then each time the motion corrected by the last recording,
    of a cycle the same motion.

    ask: called with what comes next before anything moves; its exceptions stop the throws. They end
    after a throw with trouble.
    """
    ready: GripperState | None = None
    while True:
        start, gripper = franka.check(arm_of(plan))
        if ready is None or sent.picks:
            ready = _ready_state(franka, sent, gripper)
        way, stops = approach(sent, start), find_stops(sent)
        what = f"{len(sent.carries)} picks and throws" if sent.picks else "the throw"
        ask(
            f"{_start_words(franka, sent, start)}, then {what} in {sent.times[-1]:.2f} s; the "
            f"gripper is {1e3 * gripper.width:.0f} mm open, and must be {1e3 * ready.width:.0f} mm "
            f"with {'an object' if ready.holds else 'nothing'}\n{Expectations(sent, way).words}\n"
            "  Python sends it, and misses cycles on a busy machine: for throws in earnest take "
            "the C++ program of export --franka"
        )
        _restore(franka.gripper, ready, grasp_of(plan.carries[0]).force)
        watch = Watch(franka.gripper, franka.gripper.state(), sent, stops)
        recording = _play(franka, way, sent.q, watch)
        yield recording
        if recording.trouble:
            return
        if not sent.picks:
            sent, _ = corrected(plan, recording)


def rehearse(
    franka: Franka, plan: SentMotion, sent: SentMotion, ask: Callable[[str], None]
) -> Recording:
    """Send the motion slowly, with an empty hand that does not move.

    On the way to the start pose, too, arm and hand keep `REHEARSAL_SPEED`. InputError for a gripper
    that holds something, or moves, besides those of `throws`.
    """
    start, gripper = franka.check(arm_of(plan))
    if gripper.holds:
        raise InputError(f"{franka.host}: --rehearse: the gripper holds an object: take it out")
    if sent.throw.manipulator.capsules is None:
        raise InputError("--rehearse: the arm file has no capsules, so its speed is not known")
    way = approach(sent, start)
    slow_way, slow = _slowed(sent, way), _slowed(sent, sent.q)
    ask(
        f"{_start_words(franka, sent, start)} in {TICK * (len(slow_way) - 1):.1f} s, then the "
        f"motion {(len(slow) - 1) / (len(sent.q) - 1):.1f} times as slow, in "
        f"{TICK * (len(slow) - 1):.1f} s; the gripper stays {1e3 * gripper.width:.0f} mm open\n"
        f"{Expectations(sent, way).swept_words}"
    )
    recording = _play(franka, slow_way, slow, Watch(franka.gripper, gripper))
    if recording.trouble:
        raise InputError(f"{franka.host}: {recording.trouble}")
    return recording


def _start_words(franka: Franka, motion: SentMotion, start: Array) -> str:
    """The way to the start pose, in words."""
    away = np.abs(start - motion.q[0])
    most = f"joint {away.argmax() + 1} moves {away.max():.2f} rad"
    return f"{arm_of(motion).name} at {franka.host}: to the start pose ({most})"


def _ready_state(franka: Franka, motion: SentMotion, now: GripperState) -> GripperState:
    """The gripper before a motion: around the object, or open for the first pick; InputError if it
    is not, or holds something else."""
    if motion.picks:
        if now.holds:
            raise InputError(f"{franka.host}: the gripper holds an object: take it out")
        return GripperState(min(OPEN_WIDTH, now.max_width), now.max_width, holds=False)
    if now.width > now.max_width - MOVED:
        raise InputError(f"{franka.host}: its gripper is open: let it grasp the object")
    return now


def _restore(gripper: GripperLink, ready: GripperState, force: float) -> None:
    """Move the gripper as before the first motion, with the scene's force [N] around an object, if
    it has moved; InputError if it lacks the object."""
    if equal(gripper.state(), ready):
        return
    if ready.holds:
        gripper.result("grasp", ready.width, SPEED, force, GRASP_TOLERANCE, GRASP_TOLERANCE)
    else:
        gripper.result("move", ready.width, SPEED)
    now = gripper.state()
    if equal(now, ready):
        return
    if ready.width > now.width + MOVED and not ready.holds:
        raise InputError(f"{gripper.host}: its gripper does not open: see Desk for its state")
    raise InputError(f"{gripper.host}: its gripper holds nothing: put the object between the pads")


def _slowed(motion: SentMotion, q: Array) -> Array:
    """Joints q (N, joints) [rad] every millisecond, with times stretched to `REHEARSAL_SPEED`."""
    times = np.arange(len(q)) * np.float64(TICK)
    ends = swept_bodies(motion.carries[0].space, q, times).ends
    fastest = np.linalg.norm(np.diff(ends, axis=3), axis=2).max(initial=0.0) / TICK
    stretch = max(float(fastest) / REHEARSAL_SPEED, 1.0)
    slow = np.arange(0.0, times[-1] + TICK / stretch, TICK / stretch)
    return Trajectory.through(times, q).at(np.minimum(slow, times[-1])).pose.T


def _play(franka: Franka, way: Array, q: Array, watch: Watch) -> Recording:
    """Move along `way` to the start, then send q, both (N, joints) [rad] every millisecond.

    If an object is not grasped or lost, or the gripper's connection fails, before the last opening
    command, the arm brakes at once, and the gripper gets no further command. A gripper that does
    not open at the end needs no other motion: after the opening it is the brake. All are the
    recording's `trouble`. InputError for errors of the controller, for trouble on the way to the
    start, and if the arm does not come to rest at the goal.
    """
    command = franka.binding.JointPositions
    gc.disable()
    try:
        with binding_errors(franka.host, franka.binding):
            mode = franka.binding.ControllerMode.JointImpedance
            # The commands are made before the stream begins.
            first, then = ([command(row) for row in rows.tolist()] for rows in (way, q))
            control, before = franka.robot.start_joint_position_control(mode), TICK * len(way)

            def on_way(elapsed: float) -> Stop | None:
                return watch.cycle(min(elapsed - before, -2 * TICK))

            seen, sent = _stream(control, command, first, way, on_way)
            if not watch.trouble:
                seen, sent = _stream(control, command, then, q, watch.cycle)
            last = command(sent[-1].tolist())
            last.motion_finished = True
            control.readOnce()
            control.writeOnce(last)
    finally:
        gc.enable()
    if sent is way:
        raise InputError(f"{franka.host}: {watch.trouble}")
    times = np.array([elapsed for elapsed, _ in seen])
    watch.finish(float(times[-1]))
    rows = np.minimum(np.rint(times / TICK).astype(int), len(sent) - 1)
    read, widths = np.array(watch.widths).T
    return Recording(
        times,
        np.array([state.q for _, state in seen]),
        sent[rows],
        tuple(watch.command_times),
        widths[np.searchsorted(read, times, "right") - 1],
        watch.trouble,
    )


def _stream(
    control: Any,
    command: Callable[[list[float]], Any],
    commands: list[Any],
    q: Array,
    cycle: Callable[[float], Stop | None],
) -> tuple[list[tuple[float, Any]], Array]:
    """Send q (N, joints) [rad], a command per millisecond, the last one until the arm stands.

    It stands once it has been at rest for 0.1 s, within 0.03 rad of the last row; InputError if it
    does not within 5 s. command: the binding's for joints; cycle: called in each cycle with the
    time [s] since the first row; may return where to stop. Returns that time and the robot's state
    in each cycle, and what was sent.
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
        stop = cycle(elapsed)
        if stop is not None:
            q = np.vstack([q[: stop.sample + 1], stop.q])
            commands = commands[: stop.sample + 1] + [command(row) for row in stop.q.tolist()]
        elif sample == last:
            still = still + 1 if max(map(abs, state.dq)) < STILL else 0
            away = np.abs(np.array(state.q) - q[-1])
            if still >= 0.1 / TICK and away.max() < 0.03:
                return seen, q
            if elapsed > TICK * last + 5.0:
                raise InputError(
                    f"the arm does not come to stand where it was sent: joint {away.argmax() + 1} "
                    f"is {away.max():.3f} rad away: check the load set in Desk"
                )


# The way to the start pose.


def approach(motion: SentMotion, start: Array) -> Array:
    """All joints (N, joints) [rad] every millisecond, slowly from rest at `start` to the motion's.

    Straight, or else by a raised pose: the shoulder in the middle of its range, other joints as in
    the start pose; or from straight above the start pose, or from above where the hand is, over
    what stands around it. InputError if on all of them the arm breaks a limit, or arm or held bar
    would come too close to the floor, an obstacle, or each other.
    """
    arm, space = arm_of(motion), motion.spaces[0]
    now, goal = standstill(start), standstill(motion.q[0])
    straight = _straight(arm, now, goal)
    broken = _broken_words(space, motion, straight)
    if not broken:
        return straight.q
    above, over = (lifted_pose(space, state.q, ABOVE) for state in (now, goal))
    apart = _without_near(motion, start)
    ways = (space, raised_pose(space, goal.q)), (space, over), (apart, above, over)
    for rising, *way in ways:
        # A way may break the arm's limits: then another is tried.
        with contextlib.suppress(InputError):
            first, *rest = (_straight(arm, *ends) for ends in itertools.pairwise((now, *way, goal)))
            later = joined(rest)
            if not (_broken_words(rising, motion, first) or _broken_words(space, motion, later)):
                return joined([first, later]).q
    raise InputError(
        f"the way to the start pose is not clear: {broken}: guide the arm nearer to it"
    )


def _straight(arm: Arm, start: State, goal: State) -> Samples:
    """All joints from rest to rest within all limits; InputError if there are none."""
    limits = joint_limits(arm, range(1, arm.joints + 1))
    # Shares of the limits, halved until those that depend on the position hold.
    for share in 0.5 ** np.arange(6):
        found = transfer(limits, start, goal, 0.2 * share, 0.1 * share)
        if found is not None and not arm_excesses(arm, found.samples):
            return found.samples
    raise InputError("the way to the start pose breaks a limit: guide the arm nearer to it")


def _without_near(motion: SentMotion, start: Array) -> SpatialScene:
    """The scene of the first carry without the waiting objects that the hand already stands too
    near to: it leaves them straight upwards."""
    space = motion.spaces[0]
    if space.manipulator.capsules is None:
        return space
    track = swept_bodies(space, np.array([start, start]), np.array([0.0, TICK]), held=False)
    near = {found.thing.name for found in space.around.clearances(track) if found.thing}
    left = (o for o in motion.waiting(1) if o.name not in near)
    return motion.carries[0].space.among(tuple(left))


def _broken_words(space: SpatialScene, motion: SentMotion, way: Samples) -> str:
    """A limit that a way to the start pose breaks, in words, a collision if there is one; empty if
    it breaks none. The base column is for throws: here the arm's own links are kept clear."""
    broken = motion_verdict(space, way, held=not motion.picks, loads=False).broken
    counted = [found for found in broken if found.code is not Code.COLUMN]
    counted.sort(key=lambda found: found.code is not Code.COLLISION)
    return counted[0].words if counted else ""
