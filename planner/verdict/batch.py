"""Verdicts on N throws of one motion, by the definitions of the single `verdict`.

All throws share the motion: limits that depend on the motion alone are checked once. A throw is
simulated again, by the exact release of a single throw, if the step size of the batch's release
might decide a limit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...models import Array, Flags, FlightState, Indices, ReadOnly
from ..clearance import BAR
from ..throw import EXACT, BatchFlights, ThrowBatch, torque_limits
from .batch_limits import MotionLimits
from .findings import JOINT_LIMITS, Code, Verdict, excused
from .landing import FALLS, LandingStates, landing_uses
from .single import FLYING, verdict


@dataclass(frozen=True)
class ErrorBound:
    """Bound on the landing error of a batch's release.

    position [m], angle [rad]: its constant part. factor: of the difference between two step sizes,
    which is added. Among 2,400 throws of eight scenes, all parameters uncertain, the largest error
    was half the bound.
    """

    position: float = 2e-4
    angle: float = math.radians(0.15)
    factor: float = 3.0


BOUND = ErrorBound()


@dataclass(frozen=True)
class Verdicts(ReadOnly):
    """Landings of N throws, and verdicts on these.

    pose (N, 3): x [m], theta [rad] and flight time [s] at the target's height, relative to a moving
    target; NaN for a throw that never lands. broken: flags (N,) by code; cup: whether the scene has
    one.
    """

    pose: Array
    broken: dict[Code, Flags]
    cup: bool = False

    def breaks(self, *codes: Code) -> Flags:
        """Flags (N,) of the throws that break any of the codes."""
        flags = [self.broken[code] for code in codes if code in self.broken]
        return np.asarray(np.logical_or.reduce([np.zeros(len(self.pose), bool), *flags]))

    @property
    def ok(self) -> Flags:
        """Flags (N,) of the throws without findings, see `Verdict.ok`."""
        return ~self.breaks(*Code)

    @property
    def succeeds(self) -> Flags:
        """Flags (N,) of the successful throws, see `Verdict.succeeds`."""
        return ~self.breaks(*(set(Code) - excused(self.cup)))

    @property
    def failures(self) -> dict[Code, float]:
        """Shares of the throws that fail by each code; a throw may fail by several."""
        shares = {code: float(self.breaks(code).mean()) for code in Code}
        counted = set(Code) - excused(self.cup)
        return {code: share for code, share in shares.items() if share > 0.0 and code in counted}

    @property
    def in_tolerance(self) -> Flags:
        """Flags (N,) of the throws that land within the tolerance."""
        return ~self.breaks(Code.LANDING, Code.NO_LANDING)

    @property
    def in_cup(self) -> Flags:
        """Flags (N,) of the throws that enter the cup without contact; of all that land without
        one."""
        return ~self.breaks(Code.CUP_MISSED, Code.CUP_WALL, Code.NO_LANDING)

    @property
    def sticks(self) -> Flags:
        """Flags (N,) of the throws that stick in the grip until the opening."""
        return ~self.breaks(Code.SLIP_BEFORE_OPENING)

    @staticmethod
    def joined(parts: Sequence[Verdicts]) -> Verdicts:
        """The verdicts of several batches as one."""
        codes = {code for part in parts for code in part.broken}
        broken = {code: np.concatenate([part.breaks(code) for part in parts]) for code in codes}
        return Verdicts(np.concatenate([part.pose for part in parts]), broken, parts[0].cup)


#: Difference of two success rates, over its standard deviation, up to which they tie.
DEVIATIONS = 2.0


def is_as_successful(own: Flags, other: Flags) -> bool:
    """Whether a success rate is not significantly below another one over the same samples (N,).

    McNemar's test: equally good throws succeed with equal probability in each sample on which they
    differ.
    """
    lost, gained = int((other & ~own).sum()), int((own & ~other).sum())
    return lost - gained <= DEVIATIONS * math.sqrt(lost + gained)


@dataclass(frozen=True)
class Judge:
    """Throws a motion with other values of its parameters, and judges the throws; caches the checks
    of the motion. It can be pickled."""

    batch: ThrowBatch

    @classmethod
    def of_success(cls, batch: ThrowBatch) -> Judge:
        """Judges whether throws succeed.

        Clearances of the scene are reserves of the plan: a thrown object fails only on contact.
        """
        bare = batch.throw.in_scene(batch.throw.scene.without_clearances())
        return cls(replace(batch, throw=bare))

    def verdicts(self, values: Array) -> Verdicts:
        """Verdicts on N throws: values (N, P) of the batch's parameters, SI units."""
        flights, count = self.batch.fly(values), len(values)
        found, unsure = self._judge(flights, self._doubt(flights))
        exact = self.batch.model in EXACT
        which = np.flatnonzero(unsure) if exact else np.zeros(0, int)
        if which.size:
            sure, _ = self._judge(self.batch.exactly(flights, which), np.zeros((2, which.size)))
            for code in found.keys() | sure.keys():
                flags = found.setdefault(code, np.zeros(count, bool))
                flags[which] = sure.get(code, False)
        found[Code.SLIP_BEFORE_OPENING] = self._limits.slips(flights)
        if torque_limits(self.batch.scene) is not None:
            found[Code.TORQUE] = self._limits.strains(flights) & ~found[Code.NO_LANDING]
        found |= {code: np.ones(count, bool) for code in self._motion}
        if exact:
            self._decide(found, np.flatnonzero(self._limits.may_collide(flights)), values)
        return Verdicts(flights.pose, found, self.batch.scene.cup is not None)

    def _judge(self, flights: BatchFlights, doubt: Array) -> tuple[dict[Code, Flags], Flags]:
        """Flags (N,) of the limits that releases and flights break, and of the throws whose error
        bound straddles a limit."""
        down = np.isfinite(flights.landing[:, 2])
        blew = ~np.isfinite(flights.start).all(axis=1)
        found, unsure = {Code.NO_LANDING: ~down, Code.RELEASE: flights.release.lost | blew}, ~down
        for broken, doubtful in (
            self._landings(flights, doubt),
            self._limits.judge_flights(flights, doubt),
        ):
            found |= {code: flags & down for code, flags in broken.items()}
            unsure = unsure | doubtful
        return found, unsure

    def _decide(self, broken: dict[Code, Flags], which: Indices, values: Array) -> None:
        """Replaces the flags of some throws in `broken` by single verdicts."""
        for i in which.tolist():
            judged = self.one(values[i])
            for code in judged.codes | broken.keys():
                flags = broken.setdefault(code, np.zeros(len(values), bool))
                flags[i] = code in judged.codes

    def one(self, values: Array) -> Verdict:
        """The single verdict on one throw, of parameters (P,)."""
        batch, throw = self.batch, self.batch.one(values)
        return verdict(throw.with_model(batch.model) if batch.model in EXACT else throw)

    @cached_property
    def _motion(self) -> frozenset[Code]:
        """Codes that the motion breaks with any object."""
        findings = verdict(self.batch.throw).broken
        always = {*JOINT_LIMITS.values(), Code.KINEMATICS, Code.TOOL_SPEED, Code.TORQUE_RATE}
        arm = {f.code for f in findings if f.body not in (BAR, FLYING)}
        return frozenset(arm & (always | {Code.FLOOR, Code.COLLISION}))

    @cached_property
    def _limits(self) -> MotionLimits:
        return MotionLimits(self.batch)

    # The landing.

    def _doubt(self, flights: BatchFlights) -> Array:
        """Bounds (2, N) [m, rad] on the errors of the batch's landings."""
        doubt = flights.release.doubt
        least = np.array([BOUND.position, BOUND.angle])[:, None]
        if doubt is None:
            return np.broadcast_to(least, (2, len(flights.late)))
        time = np.nan_to_num(flights.landing[:, 2])
        falls = np.maximum(np.abs(self._end(flights)[1]), FALLS)
        # An error of the height delays the landing; the object moves on in the delay.
        late = (doubt[:, 1] + doubt[:, 4] * time) / falls
        x = doubt[:, 0] + doubt[:, 3] * time + np.abs(flights.start[:, 3]) * late
        theta = doubt[:, 2] + doubt[:, 5] * time + np.abs(flights.start[:, 5]) * late
        return np.asarray(least + BOUND.factor * np.array([x, theta]))

    def _end(self, flights: BatchFlights) -> Array:
        """v_x, v_z [m/s], omega [rad/s] (3, N) at the landing."""
        start, time = FlightState(*flights.start.T), flights.landing[:, 2]
        end = self.batch.scene.flight.after(start, time)
        return np.array([end.v_x, end.v_z, end.omega])

    def _landings(self, flights: BatchFlights, doubt: Array) -> tuple[dict[Code, Flags], Flags]:
        """Flags (N,) for tolerance, [landing] and arrival, and of the throws whose error bound
        straddles a limit."""
        scene, target = self.batch.scene, self.batch.throw.target
        x, theta, time = flights.landing.T
        end = (x, np.full(len(x), target.z), theta, *self._end(flights))
        dx, turn = target.miss(x - flights.way, theta)
        start, lands = flights.start.T, flights.freed + time
        at = LandingStates(dx, turn, start, end, lands, (doubt[0], doubt[1]))
        uses = landing_uses(scene, target, at)
        broken, unsure = dict[Code, Flags](), np.zeros(len(x), bool)
        for code in {use.code for use in uses}:
            of_code = [use for use in uses if use.code is code]
            broken[code] = np.logical_or.reduce([use.broken for use in of_code])
            # One limit broken beyond its error bound decides the code.
            sure = [use.sign * (use.value - use.limit) > use.doubt for use in of_code]
            doubtful = [np.abs(use.value - use.limit) <= use.doubt for use in of_code]
            unsure |= np.logical_or.reduce(doubtful) & ~np.logical_or.reduce(sure)
        return broken, unsure
