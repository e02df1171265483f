"""A motion played on a Franka: slowly to the start pose, thrown at 1 kHz, and recorded."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ...models import Array
from ...problems import InputError
from ..throw import TICK
from .controllers import OPEN_WIDTH, JointMotion
from .franka import STILL, Franka, GripperLink, GripperState, controller_errors, load_franka
from .learning import corrected
from .recording import Recording
from .way import approach

#: The arm stands if no joint is faster than `STILL` for this time [s].
STILL_FOR = 0.1
#: Largest distance [rad] of a standing joint to its goal.
NEAR = 0.03
#: Longest time [s] until the arm stands at its goal.
SETTLING = 5.0
#: Largest speed [m/s] of the gripper.
GRIPPER_SPEED = 0.2
#: Largest continuous force [N] of a grasp.
GRASP_FORCE = 70.0
#: Widths [m] of the gripper that differ by less are equal.
SAME_WIDTH = 2e-3


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
    first, sent = _commands(binding, way), _commands(binding, motion.q)
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
    return one.holds == other.holds and abs(one.width - other.width) < SAME_WIDTH


def _close_again(gripper: GripperLink, grasp: GripperState) -> None:
    """Close the gripper as before the first throw; InputError if it lacks the object."""
    if grasp.holds:
        gripper.order("grasp", grasp.width, GRIPPER_SPEED, GRASP_FORCE)
    else:
        gripper.order("move", grasp.width, GRIPPER_SPEED)
    if gripper.answer().holds != grasp.holds:
        raise InputError(
            f"{gripper.host}: its gripper holds nothing: put the object between the pads"
        )


def _commands(binding: Any, q: Array) -> list[Any]:
    """The commands, made before the stream begins."""
    return [binding.JointPositions(row) for row in q.tolist()]


def _stream(
    control: Any, commands: Sequence[Any], goal: Array, cycle: Callable[[float], None] | None = None
) -> list[tuple[float, Any]]:
    """Send a command per millisecond of the robot's clock, the last one until the arm stands.

    goal (joints,) [rad]: the last command. cycle: called in each cycle with the time [s] since the
    first command. Returns that time and the robot's state in each cycle.
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
