"""Verdicts on throws of one motion: which limits each of them breaks.

One throw and many are judged by the same measures and the same rule.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...models import Array, Flags, FlightState, ReadOnly
from ...problems import InputError, Pose, Tolerance
from ..throw import BatchFlights, Throw, ThrowBatch, column_of, flight_of, torque_limits
from .clearance import BAR
from .findings import INTO, Code, Finding, Verdict, excused
from .landing import LandingStates, LimitUse, landing_uses, least_cup_clearance, tolerance_uses
from .measures import Measures, measures_of
from .motion import FLYING, NEAR, collision, joint_findings

#: Share of the grip's friction limit by which a throw may miss its margin: an NLP keeps it at its
#: instants, and between these the use is that much higher.
BETWEEN = 0.002


def verdict_on(
    throw: Throw,
    target: Pose | None = None,
    *,
    sent: Throw | None = None,
    driven: Throw | None = None,
) -> Verdict:
    """All limits that a throw breaks, by its release model.

    For a throw that never lands: joint limits, release and grip only. target: None for
    the throw's own. sent: the commanded motion, if `throw` is the expected motion of joints that
    lag: joint limits are judged on `sent`, the tool's speed on both. driven: whose torques are
    judged, if not those of `throw`.
    """
    flight = flight_of(throw)
    measures = measures_of(throw, flight)
    judged = Judged(throw, flight, measures, target or throw.target, driven or throw)
    commanded = throw if sent is None else sent
    findings = [*joint_findings(throw.manipulator, commanded.samples), *judged.findings(0)]
    if sent is not None and throw.lands:
        uses = _tool_speed(sent, measures_of(sent))
        findings += [found for use in uses for found in _finding(use, 0)]
    findings += own_findings(commanded)
    return Verdict(tuple(findings), cup=throw.scene.opening is not None)


def own_findings(throw: Throw) -> Iterator[Finding]:
    """What a throw breaks of the planner's own constraints, by their checks."""
    for one in throw.scene.constraints:
        if one.check is None or not throw.lands:
            continue
        given = one.check(throw)
        try:
            values = np.asarray(given, float).ravel()
        except (TypeError, ValueError):
            values = np.empty(0)
        if given is None or not values.size:
            words = f"must be a number or an array of them, not {str(given)[:60]!r}"
            raise InputError(f"constraint {one.name}: its check {words}")
        beyond = np.maximum(one.low - values, values - one.high)
        worst = int(np.nan_to_num(beyond, nan=np.inf).argmax())
        value, limit = values[worst], one.low if values[worst] < one.low else one.high
        if not beyond[worst] <= 0.0:
            words = f"{one.name} is {value:.4g}, must be {one.low:g} to {one.high:g}"
            yield Finding(Code.OWN, float(value), limit, body=one.name, note=words)


def outside_tolerance(tolerance: Tolerance, dx: float, dtheta: float) -> list[Finding]:
    """Findings on a landing dx [m] and dtheta [rad] (0 where theta is open) off the target."""
    uses = tolerance_uses(tolerance, dx, dtheta)
    return [found for use in uses for found in _finding(use, 0)]


def _finding(use: LimitUse, throw: int) -> Iterator[Finding]:
    """The finding of one of N throws, if it breaks the limit."""
    value, time, broken = (
        None if part is None else np.atleast_1d(part)[throw]
        for part in (use.value, use.time, use.broken)
    )
    if broken:
        when = None if time is None else float(time)
        yield Finding(use.code, float(value), use.limit, when, use.body)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class Judged:
    """N throws of one motion and what each of them breaks.

    throw: the motion, with the planned object; flights and measures: of the N throws; target: that
    they are judged for; driven: the motion that the joints' drives follow.
    """

    throw: Throw
    flights: BatchFlights
    measures: Measures
    target: Pose
    driven: Throw

    @cached_property
    def lands(self) -> Flags:
        """Which throws (N,) fall to the target's height."""
        return np.isfinite(self.flights.landing[:, 2])

    @cached_property
    def always(self) -> list[LimitUse]:
        """Limits on all throws."""
        gripper, m = self.throw.scene.gripper, self.measures
        margin = 0.0 if self.throw.scene.motion else gripper.sticking_margin
        use = LimitUse(Code.SLIP_BEFORE_OPENING, m.value("grip"), 1.0 - margin, time=m.time("grip"))
        return [use._replace(slack=min(margin, BETWEEN))]

    @cached_property
    def landed(self) -> list[LimitUse]:
        """Limits on throws that land."""
        return [
            *self._landing(),
            *_tool_speed(self.throw, self.measures),
            *self._torque(),
            *self._outlines(),
        ]

    def findings(self, throw: int) -> Iterator[Finding]:
        """What one of the throws breaks; of their motion, only what depends on the object too."""
        trouble, lands = self.flights.release.trouble[throw], self.lands[throw]
        if trouble:
            yield Finding(Code.RELEASE, 0.0, 0.0, note=trouble)
        for use in self.always:
            yield from _finding(use, throw)
        if not lands:
            yield Finding(Code.NO_LANDING, math.nan, self.target.z)
            return
        for use in self.landed:
            yield from _finding(use, throw)
        yield from map(collision, self.measures.clearances(throw))

    def flags(self) -> dict[Code, Flags]:
        """Flags (N,) of the throws that break each code."""
        count, release = len(self.lands), self.flights.release
        blew = ~np.isfinite(release.detach).all(axis=1)
        found = {Code.NO_LANDING: ~self.lands, Code.RELEASE: release.lost | blew}
        found[Code.COLLISION] = self.lands & (self.measures.nears > 0)
        for uses, where in ((self.always, np.ones(count, bool)), (self.landed, self.lands)):
            for use in uses:
                before = found.get(use.code, np.zeros(count, bool))
                found[use.code] = before | (where & use.broken)
        return found | {
            finding.code: np.ones(count, bool)
            for finding in joint_findings(self.throw.manipulator, self.throw.samples)
        }

    def _landing(self) -> list[LimitUse]:
        """Tolerance, [landing] and arrival."""
        scene, flights = self.throw.scene, self.flights
        x, theta, time = flights.landing.T
        at_end = scene.flight.after(FlightState(*flights.start.T), time)
        end = x, np.full(len(x), self.target.z), theta, at_end.v_x, at_end.v_z, at_end.omega
        lands = flights.freed + time
        miss = self.target.miss(x - flights.way, theta)
        at = LandingStates(*miss, flights.start.T, end, lands)
        return [use._replace(time=lands) for use in landing_uses(scene, self.target, at)]

    def _torque(self) -> Iterator[LimitUse]:
        """Torques of the joints, and how fast the motion's commands change them."""
        driven, m = self.driven, self.measures
        scene = driven.scene
        if torque_limits(scene) is None:
            return
        if driven is not self.throw:
            m = measures_of(driven)
        if scene.torque_rate is not None:
            yield LimitUse(Code.TORQUE_RATE, m.value("rate"), scene.torque_rate)
        most = 1.0 - scene.torque_margin
        for name, share, time in zip(
            driven.manipulator.joints, *(r.T for r in m.torque), strict=False
        ):
            yield LimitUse(Code.TORQUE, share, most, body=name, time=time)

    def _outlines(self) -> Iterator[LimitUse]:
        """Distances from floor, cup or bin, palm and base column."""
        scene, m = self.throw.scene, self.measures
        floor, cup, room = scene.bounds.floor, scene.cup, scene.palm_clearance

        def distance(code: Code, name: str, least: float, body: str) -> LimitUse:
            return LimitUse(code, m.value(name), least, -1.0, body, m.time(name), NEAR)

        if floor is not None:
            yield distance(Code.FLOOR, "arm", floor, "hand" if scene.arm is None else "arm")
            yield distance(Code.FLOOR, "held", floor, BAR)
        if cup is not None:
            clearance, enough = m.value("cup"), least_cup_clearance(cup)
            missed = clearance == -math.inf
            yield LimitUse(
                Code.CUP_MISSED, np.where(missed, 0.0, cup.insertion), cup.insertion, -1.0
            )
            beyond = np.where(missed | (clearance > enough), math.inf, clearance)
            # A rim inside the object is at 0.
            yield LimitUse(Code.CUP_WALL, beyond, cup.clearance, -1.0, slack=-NEAR)
        if scene.bin is not None:
            gap = scene.bin.distance(scene.object, m.value("cup"))
            missed = gap == -math.inf
            yield LimitUse(Code.BIN_MISSED, np.where(missed, 1.0, 0.0), 0.0)
            wrong = ~missed & ~(gap > least_cup_clearance(scene.bin))
            yield LimitUse(
                Code.BIN_WALL,
                np.where(wrong, gap, math.inf),
                scene.bin.clearance,
                -1.0,
                slack=-NEAR,
            )
        if room is not None:
            first = self.flights.freed + m.value("palm_time")
            yield distance(Code.PALM, "palm", room, FLYING)._replace(time=first)
        if column_of(scene) is not None:
            yield distance(Code.COLUMN, "column_held", 0.0, BAR)
            yield distance(Code.COLUMN, "column_flown", 0.0, FLYING)


def _tool_speed(throw: Throw, measures: Measures) -> Iterator[LimitUse]:
    limit = throw.scene.tool_speed
    if limit is not None:
        speed, time = measures.value("speed"), measures.time("speed")
        yield LimitUse(Code.TOOL_SPEED, speed, limit, time=time)


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
        """Flags (N,) of the throws that enter cup or bin without contact; of all that land without
        one."""
        return ~self.breaks(*INTO, Code.NO_LANDING)

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
    """Throws a motion with other values of its parameters, and judges the throws. It can be
    pickled."""

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
        throw, flights = self.batch.throw, self.batch.fly(values)
        judged = Judged(throw, flights, measures_of(throw, flights), throw.target, throw)
        return Verdicts(flights.pose, judged.flags(), throw.scene.opening is not None)
