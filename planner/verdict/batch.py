"""Verdicts on N throws of one motion, by the definitions of the single `verdict`.

All throws share the motion: limits that depend on the motion alone are checked once.
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
from .landing import LandingStates, landing_uses
from .single import FLYING, verdict


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

        Clearances and the torque margin are reserves of the plan: a thrown object fails only on
        contact, an arm at its limits. The torque rate limits what the motion commands.
        """
        bare = batch.throw.in_scene(batch.throw.scene.without_reserves())
        return cls(replace(batch, throw=bare))

    def verdicts(self, values: Array) -> Verdicts:
        """Verdicts on N throws: values (N, P) of the batch's parameters, SI units."""
        flights, count = self.batch.fly(values), len(values)
        down = np.isfinite(flights.landing[:, 2])
        blew = ~np.isfinite(flights.start).all(axis=1)
        found = {Code.NO_LANDING: ~down, Code.RELEASE: flights.release.lost | blew}
        judged = self._landings(flights) | self._limits.judge_flights(flights)
        found |= {code: flags & down for code, flags in judged.items()}
        found[Code.SLIP_BEFORE_OPENING] = self._limits.slips(flights)
        if torque_limits(self.batch.scene) is not None:
            found[Code.TORQUE] = self._limits.strains(flights) & down
        found |= {code: np.ones(count, bool) for code in self._motion}
        if self.batch.model in EXACT:
            self._decide(found, np.flatnonzero(self._limits.may_collide(flights)), values)
        return Verdicts(flights.pose, found, self.batch.scene.cup is not None)

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
        always = {*JOINT_LIMITS.values(), Code.KINEMATICS, Code.TOOL_SPEED}
        arm = {f.code for f in findings if f.body not in (BAR, FLYING)}
        return frozenset(arm & (always | {Code.FLOOR, Code.COLLISION}))

    @cached_property
    def _limits(self) -> MotionLimits:
        return MotionLimits(self.batch)

    # The landing.

    def _landings(self, flights: BatchFlights) -> dict[Code, Flags]:
        """Flags (N,) for tolerance, [landing] and arrival."""
        scene, target = self.batch.scene, self.batch.throw.target
        x, theta, time = flights.landing.T
        at_end = scene.flight.after(FlightState(*flights.start.T), time)
        end = x, np.full(len(x), target.z), theta, at_end.v_x, at_end.v_z, at_end.omega
        miss = target.miss(x - flights.way, theta)
        at = LandingStates(*miss, flights.start.T, end, flights.freed + time)
        broken: dict[Code, Flags] = {}
        for use in landing_uses(scene, target, at):
            broken[use.code] = np.asarray(use.broken | broken.get(use.code, False))
        return broken
