"""Correction until the hand opens: the rest of a swing is moved to hit where the target is.

Along the directions of `directions` the throw that is expected is brought to the target by Newton
steps, and checked as any plan. What is expected follows from what is sent by a lag per joint,
learnt from the joints as they are measured on the way.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ...models import Array, Path, PlanarArm
from ...problems import InputError, Pose, checked
from ..check import (
    TICK,
    Around,
    Samples,
    Throw,
    braked,
    broken_limits,
    held_bar,
    nearnesses,
    track_of,
)
from ..ocp import broken
from ..result import Plan, joint_samples
from ..search import Problems, scaled
from .directions import Direction, RestOfSwing
from .response import Follower, Response

Status = Literal["followed", "kept", "committed", "stopped"]

#: Between instants from which a swing is changed, in samples.
EVERY = 10
#: Exact throws of one correction at most, each nearer by so much than the one before; how near it
#: is to come, as a share of the tolerance; and the shares of a step that are tried in turn.
THROWS, NEARER, ENOUGH, SHARES = 4, 0.7, 0.25, (1.0, 0.4)
#: Shares of the acceleration limits to brake with, in turn, where the torques allow no more.
EASE = (1.0, 0.7)
#: A target's azimuth may be this far [rad] off the throw's plane, as it is measured.
OFF_PLANE = 0.02
#: So far [rad] joints may be from where they are sent, and so fast [rad/s].
ASTRAY, TOO_FAST = 1.0, 20.0
#: A swing is stopped rather than land farther off than this [m, scaled error].
ACCEPT = 0.03


@dataclass(frozen=True, eq=False)
class Update:
    """What is to be sent from now on.

    status: "followed": corrected; "kept": as it was, with the reason in `message`; "committed": too
    late to change; "stopped": brakes to rest, and the gripper stays closed. first: number of the
    first sample that is given, at 1 kHz from the start of the swing; q, dq, ddq (K, joints): of all
    joints [rad], to rest. command_time [s]: when the gripper is to be told to open; None: not at
    all. off: how far from the target (dx [m], dtheta [rad]) the object is expected to land.
    """

    status: Status
    message: str
    first: int
    q: Array
    dq: Array
    ddq: Array
    command_time: float | None
    off: tuple[float, float]


@dataclass(frozen=True, eq=False)
class _Expected:
    """The throw that is expected of what is sent, and of a target that is somewhere `now` [s].

    joints (3, N, n): its joints, rates and accelerations, of which those after the pads' opening
    count for the way to rest only.
    """

    throw: Throw
    joints: Array
    target: Pose
    now: float

    @property
    def goal(self) -> Pose:
        """Where the target is when the object lands."""
        if not self.target.speed or not self.throw.lands:
            return self.target
        return self.target.changed(since=self.now).at(self.throw.landing_time)

    @cached_property
    def off(self) -> tuple[float, float]:
        """How far off it lands: dx [m], dtheta [rad]."""
        return self.throw.miss(self.goal)

    @property
    def missed(self) -> float:
        """The same in the scaled error [m] (39); inf where it does not come down."""
        dx, dtheta = self.off
        missed = abs(dx) + abs(dtheta) * self.throw.scene.object.length / 2
        return missed if math.isfinite(missed) else math.inf

    def moved(self, joints: Array) -> _Expected:
        """Of other joints."""
        throw = dataclasses.replace(self.throw, path=Path.quintics(TICK, *joints))
        return _Expected(throw, joints, self.target, self.now)


class Session:
    """A plan's swing while it is played; `Planner.follow` makes it.

    throw: what is sent, as a throw of its own.
    """

    def __init__(
        self,
        problems: Problems,
        plan: Plan,
        horizon: float,
        sent: Throw | None = None,
        response: Response | None = None,
    ) -> None:
        """horizon [s]: what is sent so long after a measurement is not changed any more.

        sent: what is sent instead of the plan's motion, for joints that lag; response: how.
        """
        if not isinstance(problems.mover.kinematics, PlanarArm):
            raise InputError("follow: only for a scene with [robot]")
        if plan.throw is None or not plan.solved or plan.mover is not problems.mover:
            raise InputError("follow: needs a solved plan of this planner")
        self.throw = plan.throw.final if sent is None else sent
        if not 0.0 < horizon < self.throw.command_time:
            most = f"below {self.throw.command_time:.3f}, when the gripper is told to open"
            raise InputError(f"horizon = {horizon!r}: must be above 0 s and {most}")
        self._target, self._horizon = plan.target, horizon
        self._lands = self.throw.landing_time
        self._over = max(self._lands, TICK * len(self.throw.samples.q))
        self._problems, self._asked = problems, plan.throw.asked
        last = int(plan.throw.final.command_time / TICK)
        found = [self._rest(plan.throw.final, first) for first in range(0, last, EVERY)]
        later = round((self.throw.opening_time - plan.throw.opening_time) / TICK)
        self._directions = [rest.direction(later) for rest in found if rest is not None]
        self._follower = Follower(problems.mover.size, response)
        self._matrix: Array | None = None
        self._time, self._stopped, self._eased, self._solved = -math.inf, False, 0, -1
        # What is built when it is first used is built before the swing.
        self._wrong(self.throw, self._expected(self._target, 0.0))
        for rest in filter(None, found[:1]):
            rest.step(np.zeros(len(self._directions[0].change)))

    def update(self, t: float, q: Array, dq: Array, target: Pose | None = None) -> Update:
        """What to send from `t` + horizon on, by what was measured at time `t` [s] of the swing.

        q, dq (joints,) [rad, rad/s]: of all joints, or of those that throw. target: where it is at
        `t`, in the throw's plane, and how it moves; without one the plan's. A target out of reach
        is no error: the motion is kept, and stopped before the opening where it would miss by more
        than `ACCEPT`. InputError for numbers that are none, a time that does not rise, joints or a
        target that are not there; the motion is then as before.
        """
        q, target = self._checked(t, q, dq, target)
        interval, self._time = min(t - self._time, self._horizon), t
        self._follower.learn(max(t, 0.0), q, self.throw.samples.q)
        first = max(math.ceil((t + self._horizon) / TICK - 1e-6), 0)
        before = self._expected(target, t)
        if self._stopped:
            return self._told("stopped", "it has been stopped", first, before)
        ways = [way for way in self._directions if way.first >= first]
        if not ways:
            words = "the opening command is on its way"
            return self._told("committed", words, first, before)
        sent, after, words = self._moved(ways[0], before)
        # From the next update on nothing can be changed.
        late = t + self._horizon + interval > TICK * ways[-1].first
        if late and not after.missed <= ACCEPT:
            words = self._stop(first) or words
            return self._told("stopped" if self._stopped else "kept", words, first, before)
        self.throw = sent
        return self._told("followed" if after is not before else "kept", words, first, after)

    def _checked(self, t: float, q: Array, dq: Array, target: Pose | None) -> tuple[Array, Pose]:
        """Throwing joints and the target; InputError for what is wrong."""
        t = checked("t", t, float, {"meaning": "s"})
        if t <= self._time:
            raise InputError(f"t = {t:g}: must be above {self._time:g}, the last update's")
        if t > self._over:
            raise InputError(f"t = {t:g}: must be at most {self._over:.3f}, when it is over")
        mover, arm = self.throw.mover, self.throw.scene.arm
        assert arm is not None
        found = []
        for name, values in (("q", q), ("dq", dq)):
            try:
                numbers = np.asarray(values).astype(float, casting="same_kind")
            except (TypeError, ValueError):
                raise InputError(f"{name}: must be numbers") from None
            if numbers.shape == (arm.joints,):
                numbers = numbers[[j - 1 for j in arm.throwing_joints]]
            if numbers.shape != (mover.size,) or not np.isfinite(numbers).all():
                raise InputError(f"{name}: must be {arm.joints} or {mover.size} finite numbers")
            found.append(numbers)
        self._check_near(t, *found)
        if target is None:
            # Its pose is at time zero.
            return found[0], self._target.at(t)
        if (checked("target", target, Pose, {}).theta is None) != (self._target.theta is None):
            raise InputError("target: must fix theta if the plan's target does, else not")
        plane, target = self._target.plane, target.beside(self._target.lateral)
        turned = abs(target.plane.azimuth - plane.azimuth)
        if turned > OFF_PLANE:
            raise InputError(f"target: is {math.degrees(turned):.1f} deg off the throw's plane")
        return found[0], target

    def _check_near(self, t: float, q: Array, dq: Array) -> None:
        """InputError for throwing joints that are not where they may be."""
        samples = self.throw.samples.q
        sent = samples[min(max(round(t / TICK), 0), len(samples) - 1)]
        for name, far, most in (("q", q - sent, ASTRAY), ("dq", dq, TOO_FAST)):
            i = int(np.abs(far).argmax())
            if abs(far[i]) > most:
                words = "off what is sent" if name == "q" else "per s"
                joint, off = self.throw.mover.joints[i], f"{abs(far[i]):.3g} rad {words}"
                raise InputError(
                    f"{name}: {joint} is {off}, must be at most {most:g} (is it in degrees?)"
                )

    def _rest(self, throw: Throw, first: int) -> RestOfSwing | None:
        """The NLP about the rest of a throw."""
        return RestOfSwing.of(self._problems, throw, self._asked, first)

    def _expected(self, target: Pose, now: float) -> _Expected:
        """What is expected of what is sent now."""
        samples = self.throw.samples
        joints = self._follower.expected(np.array([samples.q, samples.dq, samples.ddq]))
        lands = target.changed(since=now).at(self._lands) if target.speed else target
        scene = self.throw.scene.aimed_at(lands)
        throw = dataclasses.replace(self.throw, scene=scene, path=Path.quintics(TICK, *joints))
        found = _Expected(throw, joints, target, now)
        if found.throw.lands:
            self._lands = throw.landing_time
        return found

    @cached_property
    def _end(self) -> int:
        """The number of samples until the pads are open."""
        return math.ceil(self.throw.detach_time / TICK - 1e-9) + 1

    def _moved(self, way: Direction, before: _Expected) -> tuple[Throw, _Expected, str]:
        """What to send, brought to the target as far as limits let it; and why no farther.

        Along the plan's own direction; where that breaks a limit, by a step of the NLP's quadratic
        program about what is sent now, which knows all of them.
        """
        tolerance = before.throw.scene.tolerance
        aim = ENOUGH * tolerance.position, ENOUGH * tolerance.angle
        if scaled(*before.off, aim) <= 1.0:
            return self.throw, before, "on target"
        first = way.first
        begin = np.zeros_like(way.change[0])
        sent, found, words = self._along(way, begin, before, aim, SHARES[:1])
        if found is not before or way.first == self._solved:
            return sent, found, words
        # It takes some milliseconds, so once for each instant.
        self._solved, rest = way.first, self._rest(self.throw, first)
        size = len(way.change)
        step = None if rest is None else rest.step(np.array(before.off[:size]))
        if step is None:
            return self.throw, before, words
        begin, way = step
        return self._along(way, begin, before, aim, SHARES)

    def _along(
        self,
        way: Direction,
        begin: Array,
        before: _Expected,
        aim: tuple[float, float],
        shares: Sequence[float],
    ) -> tuple[Throw, _Expected, str]:
        """The motion changed by `begin` and then along a direction until it is on the target."""
        first = way.first
        room = self._end - first
        change, begin = way.change[:, :, :room], begin[:, :room]
        response = self._follower.response
        follows, words = response.all(change), "no motion nearby lands nearer"
        start = before
        if begin.any():
            start = before.moved(self._changed(before.joints, response.all(begin), first))
        far, found = self._brought(start, follows, first, aim)
        for share in shares:
            moved = share * (begin + np.einsum("l,lokn->okn", far, change))
            if share < 1.0:
                found = before.moved(self._changed(before.joints, response.all(moved), first))
            if not found.missed < before.missed:
                continue
            rows = self._changed(self._rows, moved, first)
            for ease in EASE[self._eased :]:
                sent = self._sent(rows, ease)
                words = self._wrong(sent, found)
                if not words:
                    self._eased = EASE.index(ease)
                    return sent, found, ""
                if not words.startswith("torque"):
                    break
        return self.throw, before, words

    def _brought(
        self, before: _Expected, follows: Array, first: int, aim: tuple[float, float]
    ) -> tuple[Array, _Expected]:
        """How far (L,) to go along each direction, and what is expected then.

        By Newton steps, their matrix learnt from the throws themselves (Broyden).
        """
        size = len(follows)
        matrix = np.eye(size) if self._matrix is None else self._matrix
        moved, off = np.zeros(size), np.array(before.off[:size])
        best, least = moved, before
        for _ in range(THROWS):
            step = -np.linalg.solve(matrix, off)
            change = np.einsum("l,lokn->okn", moved + step, follows)
            found = before.moved(self._changed(before.joints, change, first))
            now = np.array(found.off[:size])
            if not np.isfinite(now).all():
                break
            matrix = matrix + np.outer(now - off - matrix @ step, step) / (step @ step)
            moved, off = moved + step, now
            missed = least.missed
            if found.missed < missed:
                best, least = moved, found
            if scaled(*found.off, aim) <= 1.0 or found.missed > NEARER * missed:
                break
        if np.linalg.cond(matrix) < 1e3:
            self._matrix = matrix
        return best, least

    @property
    def _rows(self) -> Array:
        """What is sent until the pads are open (3, N, n)."""
        samples, end = self.throw.samples, self._end
        return np.array([samples.q[:end], samples.dq[:end], samples.ddq[:end]])

    def _changed(self, rows: Array, change: Array, first: int) -> Array:
        """Rows (3, N, n) changed from sample `first` on until the pads are open."""
        rows = rows.copy()
        rows[:, first : self._end] += change
        return rows

    def _sent(self, rows: Array, ease: float) -> Throw:
        """What is sent of a motion until the pads are open, and its brake."""
        samples = braked(self.throw.mover, Samples(*rows), ease)
        return dataclasses.replace(self.throw, path=samples.path, samples=samples)

    def _wrong(self, sent: Throw, found: _Expected) -> str:
        """Why a motion must not be sent, in words; empty: it may."""
        limits = broken_limits(sent.mover, sent.samples)
        if limits:
            return f"limit of {limits[0]}"
        samples = sent.samples
        joints = self._follower.expected(np.array([samples.q, samples.dq, samples.ddq]))
        path = Path.quintics(TICK, *joints)
        throw = dataclasses.replace(found.throw, path=path, samples=samples)
        # The same until the pads are open.
        vars(throw)["release"] = found.throw.release
        # A law of two numbers says where the joints are, not what turns them.
        vars(throw)["torques"] = sent.torques
        return "; ".join(violation.words for violation in broken(throw)[:1])

    def _stop(self, first: int) -> str:
        """Brakes from sample `first` on; why it must not, in words."""
        throw = self.throw
        old, scene, mover = throw.samples, throw.scene, throw.mover
        upto = slice(0, first + 1)
        samples = braked(mover, Samples(old.q[upto], old.dq[upto], old.ddq[upto]))
        limits = broken_limits(mover, samples)
        if limits:
            return f"it cannot stop within the limit of {limits[0]}"
        q, times = samples.q[first:].T, samples.times[first:]
        held = held_bar(scene, mover.motion(q, 0 * q, 0 * q)[0])
        around = Around.of(scene, mover)
        for near in nearnesses(track_of(scene, around.capsules, times, q, held), around):
            return f"it cannot stop: {near.words}"
        self.throw = dataclasses.replace(throw, path=samples.path, samples=samples)
        self._stopped = True
        return "stopped: the target is out of reach of what is left of the swing"

    def _told(self, status: Status, words: str, first: int, expected: _Expected) -> Update:
        """The update."""
        kinematics, samples = self.throw.mover.kinematics, self.throw.samples
        assert isinstance(kinematics, PlanarArm)
        first = min(first, len(samples.q) - 1)
        rest = Samples(*(values[first:] for values in (samples.q, samples.dq, samples.ddq)))
        joints = joint_samples(kinematics, self.throw.target.plane.azimuth, rest)
        command = None if self._stopped else self.throw.command_time
        return Update(status, words, first, *joints, command, expected.off)
