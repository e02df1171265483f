"""Correction until the hand opens: the rest of a swing is moved to hit where the target is.

Newton steps along the directions of `swing_changes` bring the expected throw to the target; it is
checked as any plan. What is expected follows from what is sent by a lag per joint, learnt from the
joints as they are measured on the way.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any, Literal

import numpy as np

from ...models import Array, ReadOnly, Trajectory
from ...planner import (
    TICK,
    Code,
    Finding,
    NlpCache,
    Plan,
    PlanarArm,
    Planner,
    Samples,
    Throw,
    braked,
    error_over,
    held_verdict,
    joint_samples,
    verdict_on,
)
from ...problems import InputError, Pose, checked
from .expected_throw import ExpectedThrow
from .joint_lag import Follower, Response
from .swing_changes import Direction, RestOfSwing

Status = Literal["followed", "kept", "committed", "stopped"]


@dataclass(frozen=True)
class SessionSettings:
    """How a swing is corrected.

    spacing [samples]: between the instants from which a swing may be changed. max_throws: exact
    throws of one correction; min_progress: it ends when a throw misses by more than this share of
    the miss before it, or by less than `accuracy`, a share of the tolerance. step_shares: of the
    quadratic program's step, tried in turn. brake_shares: of the acceleration limits to brake with,
    tried in turn where torques break their limits. max_off_plane [rad]: largest measured angle of a
    target off the throw's plane. max_deviation [rad], max_rate [rad/s]: of measured joints from
    those that are sent. max_miss [m]: a throw with a larger pose error is stopped.
    """

    spacing: int = 10
    max_throws: int = 4
    min_progress: float = 0.7
    accuracy: float = 0.25
    step_shares: tuple[float, ...] = (1.0, 0.4)
    brake_shares: tuple[float, ...] = (1.0, 0.7)
    max_off_plane: float = 0.02
    max_deviation: float = 1.0
    max_rate: float = 20.0
    max_miss: float = 0.03


SETTINGS = SessionSettings()


@dataclass(frozen=True, eq=False)
class Update(ReadOnly):
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


class Session:
    """A plan's swing while it is played; `follow` makes it.

    throw: what is sent, as a throw of its own.
    """

    def __init__(
        self,
        problems: NlpCache,
        plan: Plan,
        horizon: float,
        sent: Throw | None = None,
        response: Response | None = None,
    ) -> None:
        """horizon [s]: delay from a measurement until a new command takes effect.

        sent: what is sent instead of the plan's motion, for joints that lag; response: how.
        """
        if not isinstance(problems.manipulator.kinematics, PlanarArm):
            raise InputError("follow: only for a scene with [robot]")
        if plan.throw is None or not plan.solved:
            raise InputError("follow: needs a solved plan")
        size = problems.manipulator.size
        if sent is not None and (sent.manipulator.size, sent.scene.arm) != (size, plan.scene.arm):
            raise InputError("sent: must be a motion of the plan's arm")
        if response is not None and len(response.rate) != size:
            raise InputError(f"response: is of {len(response.rate)} joints, must be of {size}")
        self.throw = plan.throw.deciding if sent is None else sent
        if not 0.0 < horizon < self.throw.command_time:
            most = f"below {self.throw.command_time:.3f}, when the gripper is told to open"
            raise InputError(f"horizon = {horizon!r}: must be above 0 s and {most}")
        self._target, self._horizon = plan.target, horizon
        self._landing_time = self.throw.landing_time
        self._end_time = max(self._landing_time, TICK * len(self.throw.samples.q))
        self._problems, self._refinement = problems, plan.throw.refinement
        last = int(plan.throw.deciding.command_time / TICK)
        found = [
            self._rest_of_swing(plan.throw.deciding, first)
            for first in range(0, last, SETTINGS.spacing)
        ]
        later = round((self.throw.opening_time - plan.throw.opening_time) / TICK)
        self._directions = [rest.direction(later) for rest in found if rest is not None]
        self._follower = Follower(problems.manipulator.size, response)
        self._matrix: Array | None = None
        self._time, self._is_stopped, self._brake, self._stepped_from = -math.inf, False, 0, -1
        self._lock = Lock()
        self._build()

    def _build(self) -> None:
        """Builds before the swing what is built when it is first used."""
        self._violation(self.throw, self._expectation(self._target, 0.0))
        rest = self._rest_of_swing(self.throw, 0)
        if rest is not None and self._directions:
            rest.step(np.zeros(len(self._directions[0].change)))

    def __copy__(self) -> Session:
        """A deep copy: a session learns."""
        return copy.deepcopy(self)

    def __getstate__(self) -> dict[str, Any]:
        """The state of a copy, which has a lock of its own."""
        with self._lock:
            return {name: value for name, value in vars(self).items() if name != "_lock"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A copy builds its NLP anew."""
        vars(self).update(state, _lock=Lock())
        self._build()

    def update(self, t: float, q: Array, dq: Array, target: Pose | None = None) -> Update:
        """What to send from `t` + horizon on, by what was measured at time `t` [s] of the swing.

        q, dq (joints,) [rad, rad/s]: of all joints, or of those that throw. target: where it is at
        `t`, in the throw's plane, and how it moves; without one the plan's. A target too far
        is no error: the motion is kept, and stopped before the opening where it would miss by more
        than 0.03 m (pose error). InputError for numbers that are none, a time that does not rise,
        joints or a target that are not there; the motion is then as before. Safe to call from any
        thread: calls wait for each other, not for the planner.
        """
        with self._lock:
            return self._update(t, q, dq, target)

    def _update(self, t: float, q: Array, dq: Array, target: Pose | None) -> Update:
        q, target = self._checked(t, q, dq, target)
        interval, self._time = min(t - self._time, self._horizon), t
        self._follower.learn(max(t, 0.0), q, self.throw.samples.q)
        first = max(math.ceil((t + self._horizon) / TICK - 1e-6), 0)
        before = self._expectation(target, t)
        if self._is_stopped:
            return self._update_of("stopped", "it has been stopped", first, before)
        ways = [way for way in self._directions if way.first >= first]
        if not ways:
            words = "the opening command is on its way"
            return self._update_of("committed", words, first, before)
        sent, after, words = self._corrected(ways[0], before)
        # From the next update on nothing can be changed.
        late = t + self._horizon + interval > TICK * ways[-1].first
        if late and not after.pose_error <= SETTINGS.max_miss:
            words = self._brake_to_rest(first) or words
            return self._update_of("stopped" if self._is_stopped else "kept", words, first, before)
        self.throw = sent
        return self._update_of("followed" if after is not before else "kept", words, first, after)

    def _checked(self, t: float, q: Array, dq: Array, target: Pose | None) -> tuple[Array, Pose]:
        """Throwing joints and the target; InputError for what is wrong."""
        checked("t", t, float, {"meaning": "s"})
        if t <= self._time:
            raise InputError(f"t = {t:g}: must be above {self._time:g}, the last update's")
        if t > self._end_time:
            raise InputError(f"t = {t:g}: must be at most {self._end_time:.3f}, when it is over")
        manipulator, arm = self.throw.manipulator, self.throw.scene.arm
        assert arm is not None
        found = []
        for name, values in (("q", q), ("dq", dq)):
            numbers = np.asarray(values)
            if numbers.shape == (arm.joints,):
                numbers = numbers[[j - 1 for j in arm.throwing_joints]]
            if numbers.shape != (manipulator.size,) or not np.isfinite(numbers).all():
                raise InputError(
                    f"{name}: must be {arm.joints} or {manipulator.size} finite numbers"
                )
            found.append(numbers)
        self._check_near(t, *found)
        target = checked("target", target, Pose | None, {})
        if target is None:
            # Its pose is at time zero.
            return found[0], self._target.at(t)
        if (target.theta is None) != (self._target.theta is None):
            raise InputError("target: must fix theta if the plan's target does, else not")
        plane, target = self._target.plane, target.with_lateral(self._target.lateral)
        turned = abs(target.plane.azimuth - plane.azimuth)
        if turned > SETTINGS.max_off_plane:
            raise InputError(f"target: is {math.degrees(turned):.1f} deg off the throw's plane")
        return found[0], target

    def _check_near(self, t: float, q: Array, dq: Array) -> None:
        """InputError for throwing joints that are not where they may be."""
        samples = self.throw.samples.q
        sent = samples[min(max(round(t / TICK), 0), len(samples) - 1)]
        for name, far, most in (
            ("q", q - sent, SETTINGS.max_deviation),
            ("dq", dq, SETTINGS.max_rate),
        ):
            i = int(np.abs(far).argmax())
            if abs(far[i]) > most:
                words = "off what is sent" if name == "q" else "per s"
                joint, off = self.throw.manipulator.joints[i], f"{abs(far[i]):.3g} rad {words}"
                raise InputError(
                    f"{name}: {joint} is {off}, must be at most {most:g} (is it in degrees?)"
                )

    def _rest_of_swing(self, throw: Throw, first: int) -> RestOfSwing | None:
        """The NLP about the rest of a throw."""
        return RestOfSwing.of(self._problems, throw, self._refinement, first)

    def _expectation(self, target: Pose, now: float) -> ExpectedThrow:
        """What is expected of what is sent now."""
        joints = self._follower.expected(self.throw.samples.rows)
        lands = target.changed(since=now).at(self._landing_time) if target.speed else target
        scene = self.throw.scene.aimed_at(lands)
        throw = dataclasses.replace(
            self.throw, scene=scene, path=Trajectory.quintics(TICK, *joints)
        )
        found = ExpectedThrow(throw, joints, target, now)
        if found.throw.lands:
            self._landing_time = throw.landing_time
        return found

    @cached_property
    def _end(self) -> int:
        """The number of samples until the pads are open."""
        return math.ceil(self.throw.detach_time / TICK - 1e-9) + 1

    def _corrected(self, way: Direction, before: ExpectedThrow) -> tuple[Throw, ExpectedThrow, str]:
        """What to send, moved towards the target until a limit ends the way, and which limit.

        Along the cheapest direction; where that breaks a limit, by a step of the NLP's quadratic
        program about what is sent now, which knows all of them.
        """
        tolerance = before.throw.scene.tolerance
        aim = SETTINGS.accuracy * tolerance.position, SETTINGS.accuracy * tolerance.angle
        if error_over(*before.off, aim) <= 1.0:
            return self.throw, before, "on target"
        first = way.first
        begin = np.zeros_like(way.change[0])
        sent, found, words = self._along(way, begin, before, aim, SETTINGS.step_shares[:1])
        if found is not before or way.first == self._stepped_from:
            return sent, found, words
        # It takes some milliseconds, so once for each instant.
        self._stepped_from, rest = way.first, self._rest_of_swing(self.throw, first)
        size = len(way.change)
        step = None if rest is None else rest.step(np.array(before.off[:size]))
        if step is None:
            return self.throw, before, words
        begin, way = step
        return self._along(way, begin, before, aim, SETTINGS.step_shares)

    def _along(
        self,
        way: Direction,
        begin: Array,
        before: ExpectedThrow,
        aim: tuple[float, float],
        shares: Sequence[float],
    ) -> tuple[Throw, ExpectedThrow, str]:
        """The motion changed by `begin` and then along a direction until it is on the target."""
        first = way.first
        room = self._end - first
        change, begin = way.change[:, :, :room], begin[:, :room]
        response = self._follower.response
        follows, words = response.all(change), "no motion nearby lands nearer"
        start = before
        if begin.any():
            start = before.moved(self._with_change(before.joints, response.all(begin), first))
        far, found = self._aimed(start, follows, first, aim)
        for share in shares:
            moved = share * (begin + np.einsum("l,lokn->okn", far, change))
            if share < 1.0:
                found = before.moved(self._with_change(before.joints, response.all(moved), first))
            if not found.pose_error < before.pose_error:
                continue
            rows = self._with_change(self.throw.samples[: self._end].rows, moved, first)
            for ease in SETTINGS.brake_shares[self._brake :]:
                sent = self._sent(rows, ease)
                wrong = self._violation(sent, found)
                if wrong is None:
                    self._brake = SETTINGS.brake_shares.index(ease)
                    return sent, found, ""
                words = wrong.words
                if wrong.code is not Code.TORQUE:
                    break
        return self.throw, before, words

    def _aimed(
        self, before: ExpectedThrow, follows: Array, first: int, aim: tuple[float, float]
    ) -> tuple[Array, ExpectedThrow]:
        """How far (L,) to go along each direction, and what is expected then.

        By Newton steps, their matrix learnt from the throws themselves (Broyden).
        """
        size = len(follows)
        matrix = np.eye(size) if self._matrix is None else self._matrix
        moved, off = np.zeros(size), np.array(before.off[:size])
        best, least = moved, before
        for _ in range(SETTINGS.max_throws):
            step = -np.linalg.solve(matrix, off)
            change = np.einsum("l,lokn->okn", moved + step, follows)
            found = before.moved(self._with_change(before.joints, change, first))
            now = np.array(found.off[:size])
            if not np.isfinite(now).all():
                break
            matrix = matrix + np.outer(now - off - matrix @ step, step) / (step @ step)
            moved, off = moved + step, now
            pose_error = least.pose_error
            if found.pose_error < pose_error:
                best, least = moved, found
            if (
                error_over(*found.off, aim) <= 1.0
                or found.pose_error > SETTINGS.min_progress * pose_error
            ):
                break
        if np.linalg.cond(matrix) < 1e3:
            self._matrix = matrix
        return best, least

    def _with_change(self, rows: Array, change: Array, first: int) -> Array:
        """Rows (3, N, n) changed from sample `first` on until the pads are open."""
        rows = rows.copy()
        rows[:, first : self._end] += change
        return rows

    def _sent(self, rows: Array, ease: float) -> Throw:
        """What is sent of a motion until the pads are open, and its brake."""
        samples = braked(self.throw.manipulator.hard, Samples(*rows), ease)
        return dataclasses.replace(self.throw, path=samples.path, samples=samples)

    def _violation(self, sent: Throw, found: ExpectedThrow) -> Finding | None:
        """Why a motion must not be sent; None: it may."""
        samples = sent.samples
        path = Trajectory.quintics(TICK, *self._follower.expected(samples.rows))
        # The grip's margin is a reserve for what the arm does beside the plan.
        scene, release = found.throw.scene, found.throw.release
        scene = scene.changed(gripper=scene.gripper.changed(sticking_margin=0.0))
        # Until the pads are open the motion is that of `found`.
        throw = dataclasses.replace(
            found.throw, scene=scene, path=path, samples=samples, known_release=release
        )
        # A law of two numbers says where the joints are, not what turns them. It may land off the
        # target, or its time, as long as it lands nearer than before.
        judged = verdict_on(throw, found.goal, sent=sent, driven=sent)
        judged = judged.without(Code.LANDING, Code.ARRIVAL)
        return judged.broken[0] if judged.broken else None

    def _brake_to_rest(self, first: int) -> str:
        """Brakes from sample `first` on; why it must not, in words."""
        throw = self.throw
        samples = braked(throw.manipulator.hard, throw.samples[: first + 1])
        judged = held_verdict(throw.scene, throw.manipulator, samples, first)
        if not judged.ok:
            return f"it cannot stop: {judged.broken[0].words}"
        self.throw = dataclasses.replace(throw, path=samples.path, samples=samples)
        self._is_stopped = True
        return "stopped: the target is too far for what is left of the swing"

    def _update_of(self, status: Status, words: str, first: int, expected: ExpectedThrow) -> Update:
        """The update."""
        kinematics, samples = self.throw.manipulator.kinematics, self.throw.samples
        assert isinstance(kinematics, PlanarArm)
        first = min(first, len(samples.q) - 1)
        joints = joint_samples(kinematics, self.throw.target.plane.azimuth, samples[first:])
        command = None if self._is_stopped else self.throw.command_time
        return Update(status, words, first, *joints, command, expected.off)


def follow(
    planner: Planner,
    plan: Plan,
    horizon: float = 0.02,
    *,
    sent: Throw | None = None,
    response: Response | None = None,
) -> Session:
    """A session that corrects the swing of a solved plan of a planner until the hand opens.

    Takes some tenths of a second, before the swing. horizon [s]: delay from a measurement until a
    new command takes effect. sent: the motion sent to joints that lag, instead of the plan's;
    response: their response, if known. InputError for a plan of another scene.
    """
    lag = checked("horizon", horizon, float, {"above": 0})
    return planner.lend(plan, lambda problems: Session(problems, plan, lag, sent, response))
