"""The gripper while the arm moves: its commands in time, and what goes wrong: an empty grasp, an
object that is lost, a gripper that does not open."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from ...models import Array
from ...planner import TICK, Carry, SentMotion, braked, joint_limits, motion_verdict
from ...problems import InputError
from ..gripper import MOVED, SPEED, GripperLink, GripperReply, GripperState
from ..motions import arm_of, commands_of, grasp_of, opening_due, opening_of, parts_of

#: Time [s] after a motion in which the gripper must have opened.
UNOPENED = 3.0
#: Time before a command, in longest reads until then, in which the width is not read: a read lasts
#: until the next report, on a Franka Hand 0.1 s, and the command would wait for it.
UNREAD = 2.0
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
    of the motion, from `find_stops`. trouble: what went wrong, in words; empty while nothing has.
    widths: times [s] and widths [m] read; command_times [s]: when opening commands went out, by the
    robot's clock, 0 at the first sample.
    """

    def __init__(
        self,
        gripper: GripperLink,
        before: GripperState,
        motion: SentMotion | None = None,
        stops: Sequence[Stop] = (),
    ) -> None:
        self.gripper, self.trouble = gripper, ""
        self.widths, self.command_times = [(-math.inf, before.width)], list[float]()
        self._stops = stops
        # When [s] the last read began; the longest one [s].
        self._read, self._longest = 0.0, 0.0
        # The object in the hand, empty without one; the state that must last: None before it is
        # read; whether one must.
        self._object = "" if motion is None or motion.picks else motion.carries[0].name
        self._kept: GripperState | None = before
        self._keeps = True
        # Whether the last command has succeeded; None until it ends.
        self._done: bool | None = None if motion is not None else True
        # What is due when [s]; each is called with the time since the first sample.
        self._schedule = [] if motion is None else list(self._actions(motion))
        self._commands = [] if motion is None else [command.time for command in commands_of(motion)]

    def _actions(self, motion: SentMotion) -> Iterator[tuple[float, Callable[[float], None]]]:
        """Commands and checks in turn, each with its time [s]."""
        for number, carry in enumerate(motion.carries):
            if carry.pick:
                yield grasp_of(carry).time, partial(self._close, carry)
                yield TICK * (carry.held - GRASP_CHECK), partial(self._check_grasp, carry)
            yield opening_of(carry).time, partial(self._open, carry)
            due = opening_due(motion, number)
            if due is not None:
                yield TICK * due, partial(self._check_opening, carry)

    def cycle(self, elapsed: float) -> Stop | None:
        """Called in each cycle: give the commands that are due in it, and look at the width.

        elapsed [s]: since the first sample, on the way to the start pose below 0. Returns where to
        stop if something went wrong, once.
        """
        while self._schedule and elapsed + TICK > self._schedule[0][0] and not self.trouble:
            self._schedule.pop(0)[1](elapsed)
        with self._failures():
            reply = self.gripper.reply()
            if reply is not None:
                self._take(reply, elapsed)
            ahead = self._commands[0] - elapsed if self._commands else math.inf
            if not self.gripper.pending and ahead > UNREAD * self._longest + TICK:
                self._read = elapsed
                self.gripper.call("read_once")
        if not self.trouble or elapsed < 0.0:
            return None
        sample = round(elapsed / TICK) + NOTICE
        stop = next((stop for stop in self._stops if stop.sample >= sample), None)
        self._stops = () if stop is not None else self._stops
        return stop

    @contextlib.contextmanager
    def _failures(self) -> Iterator[None]:
        """Keeps a failure of the gripper's connection in words: the arm must come to rest."""
        try:
            yield
        except InputError as error:
            self.trouble = self.trouble or str(error)

    def _take(self, reply: GripperReply, elapsed: float) -> None:
        """Take the result of a command, or look at the width."""
        if isinstance(reply.value, GripperState):
            self._longest = max(self._longest, elapsed - self._read)
            self.widths.append((elapsed, reply.value.width))
            self._look(reply.value, elapsed)
            return
        self._done = reply.value
        if reply.name == "move":
            self.command_times[-1] += reply.late

    def _command(self, after: float, name: str, *values: float) -> None:
        """Command the gripper in `after` [s]; its process waits for the rest of the cycle."""
        self._keeps, self._done = False, None
        self._commands.pop(0)
        self.gripper.call(name, *values, after=max(after, 0.0))

    def _close(self, carry: Carry, elapsed: float) -> None:
        """Command the grasp of an object."""
        one = grasp_of(carry)
        values = one.width, SPEED, one.force, one.tolerance, one.tolerance
        with self._failures():
            self._command(one.time - elapsed, "grasp", *values)

    def _check_grasp(self, carry: Carry, elapsed: float) -> None:
        """Keep in words that the hand does not hold the object, if it does not."""
        if self._done:
            self._object, self._kept, self._keeps = carry.name, None, True
            return
        one = grasp_of(carry)
        low, high = 1e3 * (one.width - one.tolerance), 1e3 * (one.width + one.tolerance)
        self.trouble = (
            f"{carry.name} was not grasped: {elapsed - one.time:.2f} s after its command the "
            f"gripper {'closes still' if self._done is None else 'holds nothing'} between "
            f"{low:.0f} and {high:.0f} mm; the arm stopped at the pick: put the object there, or "
            "plan with a longer grasp_time"
        )

    def _open(self, carry: Carry, elapsed: float) -> None:
        """Command the opening for a throw."""
        with self._failures():
            self._command(opening_of(carry).time - elapsed, "move", opening_of(carry).width, SPEED)
            self.command_times.append(max(opening_of(carry).time, elapsed))

    def _check_opening(self, carry: Carry, elapsed: float) -> None:
        """Keep in words that the gripper has not opened before the next pick, if it has not."""
        if not self._done:
            after = f"{elapsed - opening_of(carry).time:.2f} s after its command; the arm braked"
            self.trouble = f"{carry.pick} was not thrown: {self._unopened_words(after)}"

    def _look(self, now: GripperState, elapsed: float) -> None:
        """Keep in words that the gripper has lost the object, if it has."""
        if not self._keeps or self.trouble:
            return
        kept, self._kept = self._kept, self._kept or now
        if now.holds if kept is None else equal(now, kept):
            return
        change = f"is {1e3 * now.width:.0f} mm wide and holds {'some' if now.holds else 'no'}thing"
        if kept is not None:
            change = f"went from {1e3 * kept.width:.0f} to {1e3 * now.width:.0f} mm"
        when, then = f"{elapsed:.2f} s after the start", "the arm braked without an opening"
        if elapsed < 0.0:
            when, then = "on the way to the start pose", "nothing was thrown"
        self.trouble = f"{self._object} was lost {when}: the gripper {change}; {then}"
        if not self._object:
            self.trouble = f"the gripper moved by itself: it {change}: see Desk for its state"

    def finish(self, elapsed: float) -> None:
        """After the motion: wait until the last opening has ended, and read the width; keep in
        words that the gripper has not opened."""
        if self.trouble:
            return
        with self._failures():
            while self._done is None and (reply := self.gripper.reply(UNOPENED)) is not None:
                self._take(reply, elapsed)
            if not self._done:
                after = f"{UNOPENED:g} s after the throw; the arm stopped by its planned brake"
                self.trouble = self._unopened_words(after)
            else:
                self.widths.append((elapsed, self.gripper.state().width))

    def _unopened_words(self, after: str) -> str:
        what = "is on its way" if self._done is None else "has failed"
        return f"the gripper did not open, its command {what} {after}: see Desk for its state"


def equal(one: GripperState, other: GripperState) -> bool:
    """Whether two states hold as much and differ in the width by noise only."""
    return one.holds == other.holds and abs(one.width - other.width) < MOVED


def find_stops(motion: SentMotion) -> list[Stop]:
    """Ways to stop, from samples `STOPS` apart, as long as the gripper is watched.

    Only those that meet nothing with the object in the hand, other objects at their picks included.
    """
    arm, found = arm_of(motion), list[Stop]()
    limits, due = joint_limits(arm, range(1, arm.joints + 1)), opening_due(motion, -1)
    end = STOPS + (opening_of(motion.carries[-1]).cycle if due is None else due + NOTICE)
    for number, part in parts_of(motion):
        for sample in range(-(-part.start // STOPS) * STOPS, min(part.stop, end), STOPS):
            brake = braked(limits, motion.samples[sample : sample + 1])
            if motion_verdict(motion.spaces[number], brake, held=True, loads=False).ok:
                found.append(Stop(sample, brake.q[1:]))
    return found
