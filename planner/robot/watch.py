"""The gripper while the arm moves: its commands in time, and what goes wrong: an empty grasp, an
object that is lost, a gripper that does not open."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from ...models import Array
from ...problems import InputError
from ..throw import TICK, braked, joint_limits
from ..verdict import motion_verdict
from .gripper import MOVED, SPEED, GripperLink, GripperState
from .motions import Carry, JointMotion

#: Time [s] after a motion in which the gripper must have begun to open.
UNOPENED = 3.0
#: Distance [samples] of the instants at which the arm may stop on the way, and shortest notice.
STOPS, NOTICE = 10, 2
#: Time [samples] before the arm leaves a pick at which the grasp is checked: it can still stop.
GRASP_CHECK = STOPS + NOTICE


@dataclass(frozen=True)
class Stop:
    """The brake after `sample`, as fast as the limits allow: joints q (N, joints) [rad] every
    millisecond, from the next sample on."""

    sample: int
    q: Array


class Watch:
    """The gripper during a motion: its commands in time, its width, and what goes wrong.

    before: its state before the motion, which it keeps without one; motion: with commands; stops:
    of the motion, from `find_stops`.
    """

    def __init__(
        self,
        gripper: GripperLink,
        before: GripperState,
        motion: JointMotion | None = None,
        stops: Sequence[Stop] = (),
    ) -> None:
        self.gripper = gripper
        #: What went wrong, in words; empty while nothing has.
        self.trouble = ""
        # When opening commands went out; when the last one did, or NaN if that is among them.
        self._command_times, self._commanded = list[float](), math.nan
        self.widths = [(0.0, before.width)]
        self._stops = stops
        # The object in the hand, empty without one; the state that must last, if one must.
        self._object = "" if motion is None or motion.picks else motion.carries[0].name
        self._kept: GripperState | None = before
        # What is due when [s]; each is called with the time since the first sample.
        self._schedule = [] if motion is None else list(self._actions(motion))

    def _actions(self, motion: JointMotion) -> Iterator[tuple[float, Callable[[float], None]]]:
        """Commands and checks in turn, each with its time [s]."""
        for carry in motion.carries:
            if carry.pick:
                yield carry.close.time, partial(self._close, carry)
                yield TICK * (carry.held - GRASP_CHECK), partial(self._check_grasp, carry)
            yield carry.open.time, partial(self._open, carry)
            if carry.due is not None:
                yield TICK * carry.due, partial(self._check_opening, carry)

    def approach(self, elapsed: float) -> None:
        """Called in each cycle of the way to the start pose: look at the width."""
        if self._has_report():
            self._look("on the way to the start pose", "nothing was thrown")

    def cycle(self, elapsed: float) -> Stop | None:
        """Called in each cycle: give the commands that are due in it, and look at the width.

        Returns where to stop if something went wrong, once.
        """
        while self._schedule and elapsed + TICK > self._schedule[0][0] and not self.trouble:
            self._schedule.pop(0)[1](elapsed)
        if self._has_report():
            self.widths.append((elapsed, self.gripper.states[-1].width))
            self._look(f"{elapsed:.2f} s after the start", "the arm braked without an opening")
        if not self.trouble:
            return None
        sample = round(elapsed / TICK) + NOTICE
        stop = next((stop for stop in self._stops if stop.sample >= sample), None)
        self._stops = () if stop is not None else self._stops
        return stop

    def _has_report(self) -> bool:
        """Whether a width has arrived."""
        with self._failures():
            return self.gripper.update()
        return False

    @contextlib.contextmanager
    def _failures(self) -> Iterator[None]:
        """Keeps a failure of the gripper's connection in words: the arm must come to rest."""
        try:
            yield
        except InputError as error:
            self.trouble = self.trouble or str(error)

    def _close(self, carry: Carry, elapsed: float) -> None:
        """Command the grasp of an object."""
        command = carry.close
        values = command.width, command.tolerance, command.tolerance, SPEED, command.force
        # The gripper's process waits for the rest of the cycle.
        wait = max(command.time - elapsed, 0.0)
        self._kept = None
        self._command_times, self._commanded = [*self.command_times], math.nan
        with self._failures():
            self.gripper.order("grasp", *values, after=wait)

    def _check_grasp(self, carry: Carry, elapsed: float) -> None:
        """Keep in words that the hand does not hold the object, if it does not."""
        self._object, command, now = carry.name, carry.close, self.gripper.states[-1]
        if now.holds and abs(now.width - command.width) < command.tolerance:
            self._kept = now
            return
        low, high = command.width - command.tolerance, command.width + command.tolerance
        self.trouble = (
            f"{carry.name} was not grasped: {elapsed - command.time:.2f} s after its command the "
            f"gripper is {1e3 * now.width:.0f} mm wide and holds "
            f"{'something' if now.holds else 'nothing'}, must hold {1e3 * low:.0f} to "
            f"{1e3 * high:.0f} mm; the arm stopped at the pick: put the object there, or plan with "
            "a longer grasp_time"
        )

    def _open(self, carry: Carry, elapsed: float) -> None:
        """Command the opening for a throw."""
        wait = max(carry.open.time - elapsed, 0.0)
        with self._failures():
            self.gripper.order("move", carry.open.width, SPEED, after=wait)
            self._commanded = elapsed + wait
        self._kept = None

    @property
    def command_times(self) -> tuple[float, ...]:
        """When opening commands went out, by the robot's clock [s], 0 at the first sample."""
        last = () if math.isnan(self._commanded) else (self._commanded + self.gripper.late,)
        return (*self._command_times, *last)

    def _check_opening(self, carry: Carry, elapsed: float) -> None:
        """Keep in words that the gripper has not opened before the next pick, if it has not."""
        if not self._is_open:
            late = elapsed - carry.open.time
            words = self._unopened_words(f"{late:.2f} s after its command", "braked")
            self.trouble = f"{carry.pick} was not thrown: {words}"

    def _look(self, when: str, then: str) -> None:
        """Keep in words that the gripper has lost the object, if it has."""
        now, kept = self.gripper.states[-1], self._kept
        if kept is None or self.trouble:
            return
        if abs(now.width - kept.width) < MOVED and now.holds >= kept.holds:
            return
        what = f"went from {1e3 * kept.width:.0f} to {1e3 * now.width:.0f} mm"
        words = f"the gripper {what}; {then}: grasp it better"
        self.trouble = f"{self._object} was lost {when}: {words}"
        if not self._object:
            self.trouble = f"the gripper moved by itself: it {what}: see Desk for its state"

    @property
    def _is_open(self) -> bool:
        """Whether the gripper has begun to open since its last command."""
        # The first state is the last one before the command.
        states = self.gripper.states
        return max(state.width for state in states) >= states[0].width + MOVED

    def unopened(self) -> str:
        """What is wrong with a gripper that has not opened after its last command, in words."""
        with self._failures():
            end = self.gripper.states[-1].time + UNOPENED
            while not self._is_open:
                # Without a report nobody knows whether it has opened.
                if self.gripper.states[-1].time > end or not self.gripper.update(UNOPENED):
                    after = f"{UNOPENED:g} s after the throw"
                    return self._unopened_words(after, "stopped by its planned brake")
        return self.trouble

    def _unopened_words(self, after: str, then: str) -> str:
        width = 1e3 * self.gripper.states[-1].width
        return (
            f"the gripper did not open: {width:.0f} mm wide {after}; the arm {then}: see Desk for "
            "the gripper's state"
        )


def find_stops(motion: JointMotion) -> list[Stop]:
    """Ways to stop, from samples `STOPS` apart, as long as the gripper is watched.

    Only those that meet nothing with the object in the hand, other objects at their picks included.
    """
    limits, found = joint_limits(motion.arm, range(1, motion.arm.joints + 1)), list[Stop]()
    last = motion.carries[-1]
    end = STOPS + (last.open.cycle if last.due is None else last.due + NOTICE)
    for carry, part in motion.parts():
        for sample in range(-(-part.start // STOPS) * STOPS, min(part.stop, end), STOPS):
            brake = braked(limits, motion.samples[sample : sample + 1])
            if motion_verdict(carry.space, brake, held=True, loads=False).ok:
                found.append(Stop(sample, brake.q[1:]))
    return found
