"""A motion played on a Franka: slowly to the start pose, thrown at 1 kHz, and recorded."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ...models import Array
from ...problems import InputError
from ..check import TICK
from .controllers import OPEN_WIDTH, JointMotion
from .franka import STILL, Franka, GripperLink, GripperState, in_one_line, load_franka
from .learning import corrected
from .recording import Recording
from .way import approach

#: It stands where no joint was faster than `STILL` for so long [s], and it is so near [rad] to
#: where it was sent; it has so long [s] for that.
STILL_FOR, NEAR, SETTLING = 0.1, 0.03, 5.0
#: Speed [m/s] of the gripper, its most; force [N] of a new grasp, its most that lasts.
GRIPPER_SPEED, GRASP_FORCE = 0.2, 70.0
#: Widths [m] of the gripper are alike.
SAME_WIDTH = 2e-3


def throws(
    franka: Franka, plan: JointMotion, sent: JointMotion, ask: Callable[[str], None]
) -> Iterator[Recording]:
    """Throw again and again: first what is given, then what the recording before it taught.

    ask: called with what comes next, before anything moves; an exception of its stops it.
    """
    held: GripperState | None = None
    while True:
        start, gripper = franka.check(plan.arm)
        held, way = held or gripper, approach(sent, start)
        away = np.abs(start - sent.q[0])
        ask(
            f"{plan.arm.name} at {franka.host}: to the start pose (joint {away.argmax() + 1} moves "
            f"{away.max():.2f} rad), then the throw in {sent.times[-1]:.2f} s; the gripper "
            f"{_closes(gripper, held)}"
        )
        if not _alike(gripper, held):
            _close_again(franka.gripper, held)
        recording = play(franka, sent, way)
        yield recording
        sent, _ = corrected(plan, recording)


def play(franka: Franka, motion: JointMotion, way: Array) -> Recording:
    """Go a way (N, joints) [rad] to the motion's start; throw; record.

    InputError for what the controller says, and where the arm does not come to stand.
    """
    binding, gripper = load_franka(), franka.gripper
    there, sent = _commands(binding, way), _commands(binding, motion.q)
    # The order goes out in the cycle that the command falls into, and waits there for the rest.
    command = motion.throw.command_time
    ordered: list[float] = []
    before = gripper.state().width
    widths = [(0.0, before)]

    def cycle(elapsed: float) -> None:
        if not ordered and elapsed + TICK > command:
            wait = max(command - elapsed, 0.0)
            gripper.order("move", OPEN_WIDTH, GRIPPER_SPEED, after=wait)
            ordered.append(elapsed + wait)
        elif len(widths) < 2 and ordered and gripper.answered():
            widths.append((elapsed, gripper.answer().width))

    gc.disable()
    try:
        with in_one_line(franka.host):
            mode = binding.ControllerMode.JointImpedance
            control = franka.robot.start_joint_position_control(mode)
            _stream(control, there, motion.q[0])
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
        ordered[0],
    )


def _closes(now: GripperState, held: GripperState) -> str:
    """What the gripper does before the throw, in words."""
    what = "an object" if held.holds else "nothing"
    if _alike(now, held):
        return f"is {1e3 * now.width:.0f} mm open and holds {what}"
    return f"closes to {1e3 * held.width:.0f} mm again, on {what}"


def _alike(one: GripperState, other: GripperState) -> bool:
    return one.holds == other.holds and abs(one.width - other.width) < SAME_WIDTH


def _close_again(gripper: GripperLink, held: GripperState) -> None:
    """Close the gripper as it was; InputError where it holds nothing now and did then."""
    if held.holds:
        gripper.order("grasp", held.width, GRIPPER_SPEED, GRASP_FORCE)
    else:
        gripper.order("move", held.width, GRIPPER_SPEED)
    if gripper.answer().holds != held.holds:
        raise InputError(
            f"{gripper.host}: its gripper holds nothing: put the object between the pads"
        )


def _commands(binding: Any, q: Array) -> list[Any]:
    """Made before the stream begins."""
    return [binding.JointPositions(row) for row in q.tolist()]


def _stream(
    control: Any, commands: Sequence[Any], goal: Array, cycle: Callable[[float], None] | None = None
) -> list[tuple[float, Any]]:
    """Send a command per millisecond of the robot's clock, the last one until the arm stands.

    goal (joints,) [rad]: of the last. cycle: called in each cycle with the time [s] since the
    first command. Returns that time and the robot's state in each cycle.
    """
    seen: list[tuple[float, Any]] = []
    last, first, still = len(commands) - 1, None, 0
    while True:
        state, _ = control.readOnce()
        now = state.time.to_sec()
        first = now if first is None else first
        elapsed = now - first
        # A cycle that was missed is not made up for: the motion goes on with the clock.
        sample = min(round(elapsed / TICK), last)
        control.writeOnce(commands[sample])
        seen.append((elapsed, state))
        if cycle is not None:
            cycle(elapsed)
        if sample < last:
            continue
        still = still + 1 if max(map(abs, state.dq)) < STILL else 0
        if still >= STILL_FOR / TICK:
            away = np.abs(np.array(state.q) - goal)
            if away.max() < NEAR:
                return seen
        if elapsed > TICK * last + SETTLING:
            joint = int(np.argmax(np.abs(np.array(state.q) - goal)))
            off = abs(state.q[joint] - goal[joint])
            raise InputError(
                f"the arm does not come to stand where it was sent: joint {joint + 1} is "
                f"{off:.3f} rad away: check the load set in Desk"
            )
