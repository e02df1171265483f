"""The gripper watched while the arm moves: an object that is lost, a gripper that does not open."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from ...models import Array
from ...problems import InputError
from ..throw import TICK, Samples, braked
from ..verdict import held_verdict
from .controller_files import JointMotion
from .gripper import MOVED, OPEN_WIDTH, SPEED, GripperLink, GripperState

#: Time [s] after the throw in which the gripper must have begun to open.
UNOPENED = 3.0
#: Distance [samples] of the instants at which the arm may stop on the way, and shortest notice.
STOPS, NOTICE = 10, 2


@dataclass(frozen=True)
class Stop:
    """A motion up to `sample`, then the brake as fast as the limits allow: joints q (N, joints)
    [rad] every millisecond."""

    sample: int
    q: Array


class Watch:
    """The gripper during a motion: its opening in time, its width, and what goes wrong.

    before: its state before the motion; motion: with an opening, None without one.
    """

    def __init__(
        self, gripper: GripperLink, before: GripperState, motion: JointMotion | None = None
    ) -> None:
        self.gripper, self.before = gripper, before
        #: What went wrong, in words; empty while nothing has.
        self.trouble = ""
        #: Of the robot's clock [s], 0 at the first sample; NaN while no command is given.
        self.command_time = math.nan
        self.widths = [(0.0, before.width)]
        self._due = math.inf if motion is None else motion.throw.command_time
        self._stops = [] if motion is None else stops(motion)

    def approach(self, elapsed: float) -> None:
        """Called in each cycle of the way to the start pose: look at the width."""
        if self._has_report() and not self.trouble:
            self._look("on the way to the start pose", "nothing was thrown")

    def cycle(self, elapsed: float) -> Stop | None:
        """Called in each cycle: order the opening in that of its command, and look at the width.

        Returns where to stop if the object is lost, or the gripper fails.
        """
        if self._is_waiting and elapsed + TICK > self._due:
            # The gripper's process waits for the rest of the cycle.
            wait = max(self._due - elapsed, 0.0)
            with self._failures():
                self.gripper.order("move", OPEN_WIDTH, SPEED, after=wait)
                self.command_time = elapsed + wait
        was_waiting = self._is_waiting
        if self._has_report():
            self.widths.append((elapsed, self.gripper.states[-1].width))
        elif not self.trouble:
            return None
        if not was_waiting:
            return None
        sample = round(elapsed / TICK) + NOTICE
        ahead = next((stop for stop in self._stops if stop.sample >= sample), None)
        if ahead is not None and not self.trouble:
            self._look(f"{elapsed:.2f} s after the start", "the arm braked without an opening")
        return ahead if self.trouble else None

    @property
    def _is_waiting(self) -> bool:
        """Whether the opening command is still to come."""
        return math.isnan(self.command_time) and not self.trouble

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

    def _look(self, when: str, then: str) -> None:
        """Keep in words that the gripper has lost the object, if it has."""
        now, before = self.gripper.states[-1], self.before
        if abs(now.width - before.width) < MOVED and now.holds >= before.holds:
            return
        what = f"went from {1e3 * before.width:.0f} to {1e3 * now.width:.0f} mm"
        self.trouble = f"the object was lost {when}: the gripper {what}; {then}: grasp it better"
        if math.isinf(self._due):
            self.trouble = f"the gripper moved by itself: it {what}: see Desk for its state"

    def unopened(self) -> str:
        """What is wrong with a gripper that has not opened after its command, in words."""
        with self._failures():
            return self._unopened()
        return self.trouble

    def _unopened(self) -> str:
        states = self.gripper.states
        end = states[-1].time + UNOPENED
        while max(state.width for state in states) < self.before.width + MOVED:
            # Without a report nobody knows whether it has opened.
            if states[-1].time > end or not self.gripper.update(UNOPENED):
                width = 1e3 * states[-1].width
                return (
                    f"the gripper did not open: {width:.0f} mm wide {UNOPENED:g} s after "
                    "the throw; the arm stopped by its planned brake: see Desk for the "
                    "gripper's state"
                )
        return ""


def stops(motion: JointMotion) -> list[Stop]:
    """Ways to stop before the opening command, from samples `STOPS` apart.

    Only those that meet nothing with the object in the hand.
    """
    throw, found = motion.throw, []
    scene, manipulator, sent = throw.scene, throw.manipulator, throw.samples
    for sample in range(STOPS, motion.cycle + STOPS, STOPS):
        upto = slice(0, sample + 1)
        samples = braked(manipulator, Samples(sent.q[upto], sent.dq[upto], sent.ddq[upto]))
        if held_verdict(scene, manipulator, samples, sample).ok:
            q = JointMotion.of(replace(throw, samples=samples)).q
            found.append(Stop(sample, q))
    return found
