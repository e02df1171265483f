"""The request that an NLP answers: target, refinement, nodes, and the window of a robust plan.

Constraints that are seldom active are left out at first. Where the verdict on a throw finds one
broken, the refinement of the next NLP has it, or a larger margin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...models import Array
from ...problems import Distribution, Nlp, Pose, Scene
from ..throw import Manipulator, Throw, friction_use
from ..verdict import FLYING, Code, Finding, Verdict

#: Kinds of robust NLPs: a price of the load on the pads in the whole window; constant joint rates
#: there; several throws under one motion.
LEAST_LOAD, CONSTANT_RATES, SCENARIOS = "least load", "constant rates", "scenarios"
#: A constraint that an NLP has only after a verdict found it broken: "carry" (grip, floor,
#: column at more instants, floor of the arm), "flight" and "return" (hand's body, more depths of a
#: cup), "passing" (column in flight) or "torque".
LazyConstraint = str
#: Times after detach [s] at which "flight" constrains bar and hand's body.
PALM_TIMES = (0.01, 0.02, 0.03, 0.045, 0.06, 0.075, 0.09, 0.11, 0.13, 0.15, 0.18, 0.21, 0.25)


@dataclass(frozen=True)
class Margin:
    """An addition to the usual margin of a constraint: a distance [m], velocity [rad/s] or share
    of a limit.

    Each verdict adds its violation (`largest` at most) plus `extra`, up to `maximum` in total.
    """

    name: str
    extra: float
    maximum: float
    largest: float = math.inf


HELD = Margin("held", extra=0.002, maximum=0.05)
PASSING = Margin("passing", extra=0.002, maximum=0.03)
PALM = Margin("palm", extra=0.002, maximum=0.05, largest=0.01)
CUP = Margin("cup", extra=2e-4, maximum=0.005)
CLEAR = Margin("clear", extra=0.003, maximum=0.05, largest=0.005)
GRIP = Margin("grip", extra=0.003, maximum=0.3)
TORQUE = Margin("torque", extra=0.04, maximum=0.3)
TORQUE_RATE = Margin("torque rate", extra=0.02, maximum=0.5)
SLOWING = Margin("slowing", extra=0.005, maximum=0.3)
TOOL_SPEED = Margin("tool speed", extra=0.001, maximum=0.2)


@dataclass(frozen=True)
class Remedy:
    """The change of an NLP that removes a finding: the next of its lazy constraints, or a body that
    keeps clear of obstacles; where the NLP has these, or needs none, a larger margin."""

    lazy: tuple[LazyConstraint, ...] = ()
    body: str = ""
    margin: Margin | None = None


def _remedy_for(finding: Finding, throw: Throw) -> Remedy | None:
    """The remedy for a finding of a throw; None if an NLP has none."""
    match finding.code:
        case Code.SLIP_BEFORE_OPENING:
            return Remedy(() if finding.reserve else ("carry",), margin=GRIP)
        case Code.JOINT_VELOCITY if throw.manipulator.planning.slowing is not None:
            return Remedy(margin=SLOWING)
        case Code.TOOL_SPEED:
            return Remedy(margin=TOOL_SPEED)
        case Code.TORQUE:
            # With a section [torque] every NLP has the constraint.
            return Remedy(("torque",) if throw.scene.torque is None else (), margin=TORQUE)
        case Code.TORQUE_RATE:
            # Of the jerks, which are its largest part.
            return Remedy(margin=TORQUE_RATE)
        case Code.COLUMN if finding.body == FLYING:
            return Remedy(("passing",), margin=PASSING)
        case Code.FLOOR | Code.COLUMN:
            return Remedy(("carry",), margin=HELD)
        case Code.PALM:
            assert finding.time is not None
            early = finding.time - throw.detach_time <= PALM_TIMES[-1]
            return Remedy(("flight", "return") if early else ("return",), margin=PALM)
        case Code.CUP_WALL | Code.BIN_WALL:
            return Remedy(("flight",), margin=CUP)
        case Code.COLLISION:
            return Remedy(body=finding.body, margin=CLEAR)
    return None


def _violation(finding: Finding, margin: Margin) -> float:
    """The amount by which a finding breaks its limit, in the unit of the margin."""
    match finding.code:
        case Code.TOOL_SPEED | Code.TORQUE_RATE:
            return finding.value / finding.limit - 1.0
        case Code.TORQUE | Code.JOINT_VELOCITY | Code.SLIP_BEFORE_OPENING:
            return finding.value - finding.limit
    return min(finding.limit - finding.value, margin.largest)


@dataclass(frozen=True, init=False)
class Margins:
    """Margins beyond the usual ones, by their names: `Margins(held=0.002)`; others are 0."""

    values: tuple[tuple[str, float], ...]

    def __init__(self, /, **values: float) -> None:
        given = tuple(sorted((name, value) for name, value in values.items() if value != 0.0))
        object.__setattr__(self, "values", given)

    def __getitem__(self, name: str) -> float:
        return dict(self.values).get(name, 0.0)

    def replace(self, /, **values: float) -> Margins:
        """These margins with some values replaced."""
        return Margins(**dict(self.values) | values)


@dataclass(frozen=True)
class Refinement:
    """Lazy constraints and margins of an NLP.

    bodies: links, "bar" and "flying bar" that keep clear of obstacles and of the arm's links.
    soft: price of the landing's speed, for a scene with [rest]. quiet: price of the load on the
    pads while they open; 0: the NLP has no such term, and ends at detach.
    """

    lazy: frozenset[LazyConstraint] = frozenset()
    margins: Margins = field(default_factory=Margins)
    bodies: frozenset[str] = frozenset()
    soft: float = 0.0
    quiet: float = 0.0

    def refined(self, verdict: Verdict, throw: Throw) -> Refinement:
        """This with the remedies for a throw's findings; equal to this without a remedy.

        Each broken limit gets its constraint; if that is in, its margin grows by the violation.
        """
        lazy, bodies, larger = set(self.lazy), set(self.bodies), dict[str, float]()
        for finding in verdict.broken:
            cure = _remedy_for(finding, throw)
            if cure is None:
                continue
            if further := [name for name in cure.lazy if name not in self.lazy]:
                lazy.add(further[0])
            elif cure.body and cure.body not in self.bodies:
                bodies.add(cure.body)
            elif (margin := cure.margin) is not None:
                wider = self.margins[margin.name] + _violation(finding, margin) + margin.extra
                wider = min(wider, margin.maximum)
                larger[margin.name] = max(larger.get(margin.name, 0.0), wider)
        margins = self.margins.replace(**larger)
        return replace(self, lazy=frozenset(lazy), margins=margins, bodies=frozenset(bodies))


#: No lazy constraint, usual margins.
BASE = Refinement()


class Weights(NamedTuple):
    """Prices of the squared relative acceleration and jerk, and of the carry's time [1/s]."""

    acceleration: Any
    jerk: Any
    carry_time: Any

    @classmethod
    def of(cls, scene: Scene) -> Weights:
        """Those of the scene's [cost]."""
        cost = scene.weights
        return cls(cost.acceleration, cost.jerk, cost.time)


@dataclass(frozen=True)
class WindowSettings:
    """Settings of a robust plan's window and its intervals.

    step [s]: longest interval before the opening and after detach. deviations: of a normal
    distribution, inside the window. slow_opening: share of the opening by which a slow one may
    outlast it; the brake waits that long. samples: instants at which the load is measured. delays:
    of the scenarios, as shares of the window before the opening and after detach. quiet [s]:
    longest interval after detach of a quiet plan; shortest [s]: its shortest window on either side.
    """

    step: float = 0.005
    quiet: float = 0.01
    shortest: float = 0.002
    deviations: float = 2.0
    slow_opening: float = 0.2
    samples: int = 561
    delays: tuple[float, ...] = (-1.0, -0.5, 0.5, 1.0)


WINDOW = WindowSettings()


@dataclass(frozen=True)
class Window:
    """The window in which the pads may open, around the planned opening.

    early, late: intervals of `step` [s] before the opening's start and after detach. held: whether
    the object counts as between the pads in the late ones, with grip 0, and flies from their end.
    lead [s]: from the earliest opening to the planned one. delays (scenarios,) [s]: of the openings
    other than the planned one.
    """

    early: int
    late: int
    held: bool
    step: float
    lead: float
    delays: Array = field(default_factory=lambda: np.zeros(0))


def window_of(scene: Scene) -> Window:
    """The window of a robust request."""
    before, after, delayed = _uncertain_span(scene)
    early, late = (math.ceil(span / WINDOW.step - 1e-9) for span in (before, after))
    steps = [length / count for length, count in ((before, early), (after, late)) if count]
    step = max(steps, default=WINDOW.step)
    ends = step * early, min(step * late, delayed)
    delays = [ends[share > 0] * share for share in WINDOW.delays]
    others = np.array([delay for delay in delays if delay != 0.0])
    return Window(early, late, False, step, early * step, others)


def quiet_window_of(scene: Scene) -> Window:
    """The window of a quiet request: as long after detach as the pads may open late. Before the
    opening's start, under full grip, load costs nothing."""
    delay = scene.uncertain.delay
    assert delay is not None
    before, after = (max(side, WINDOW.shortest) for side in _sides(delay.about(0.0)))
    late = math.ceil(after / WINDOW.quiet - 1e-9)
    return Window(0, late, True, after / late, before)


def _uncertain_span(scene: Scene) -> tuple[float, float, float]:
    """Times [s] from the earliest start of the opening to its mean, and from the mean detach to the
    latest; and to the latest of an opening that is hardly slower than planned."""
    nominal = scene.gripper.profile().opening
    delay, opening = scene.uncertain.delay, scene.uncertain.opening
    assert delay is not None
    before, after = _sides(delay.about(0.0))
    slow = (opening or Distribution(uniform=0.0)).about(nominal)
    hardly = WINDOW.slow_opening * nominal
    longest = max(slow.expected - nominal + _sides(slow)[1], hardly)
    return before, after + longest, after + hardly


def _sides(spread: Distribution) -> tuple[float, float]:
    """How far below and above its mean a distribution in absolute numbers counts."""
    width = WINDOW.deviations * spread.deviation if spread.normal is not None else 0.0
    low, high = spread.reach
    return max(spread.expected - low, width), max(high - spread.expected, width)


def opening_nodes(nlp: Nlp, opening: float) -> Array:
    """Times (opening + 1,) [s] of the shooting nodes, from the start of the force's fall."""
    shares = np.linspace(0.0, 1.0, nlp.opening + 1)
    return np.asarray(opening * (1.0 - (1.0 - shares) ** nlp.grading))


def load_curve(throw: Throw) -> tuple[Array, Array]:
    """Times (K,) [s] while the pads may open, and the load there (K,).

    The load is the wrench that keeps the object in the moving hand, as a share of the friction
    limit of the full grip: at 1 the object slips, at 0 it flies freely.
    """
    scene, window = throw.scene, quiet_window_of(throw.scene)
    end = throw.detach_time + window.late * window.step
    times = np.linspace(max(throw.opening_time - window.lead, 0.0), end, WINDOW.samples)
    return times, friction_use(scene, throw.hand(times))


def peak_load(throw: Throw) -> float:
    """The largest load while the pads may open, after the earliest opening has reached a quarter of
    the full grip: with more grip the pads hold a quiet load."""
    times, load = load_curve(throw)
    profile, lead = throw.scene.gripper.profile(), quiet_window_of(throw.scene).lead
    grip = profile.force(times - throw.opening_time + lead)
    return float(load[grip <= profile.full / 4].max())


@dataclass(frozen=True)
class Request:
    """A throw of a scene to a target, for an NLP (target None: for its window and nodes alone).

    robust: the kind of a robust NLP, empty for none. elastic: price [1/m] of the pose error with
    which the landing may miss the target; 0: it may not. start_angle [rad]: of the landing at the
    start of an elastic solve, which tells the end of the bar that enters a cup. reference: the
    throw at the start of a solve; obstacles are linearised about it.
    """

    scene: Scene
    manipulator: Manipulator
    target: Pose | None = None
    refinement: Refinement = BASE
    robust: str = ""
    elastic: float = 0.0
    start_angle: float | None = None
    reference: Throw | None = None

    @property
    def angle(self) -> bool:
        """Whether the target fixes theta."""
        return self.target is not None and self.target.theta is not None

    @property
    def ranges(self) -> tuple[bool, bool]:
        """Whether the target is a range of x, of theta."""
        x, theta = (0.0, 0.0) if self.target is None else self.target.half_widths
        return x > 0.0, theta > 0.0

    @cached_property
    def window(self) -> Window | None:
        """The window of a robust or quiet request."""
        if self.robust:
            return window_of(self.scene)
        return quiet_window_of(self.scene) if self.refinement.quiet else None

    @cached_property
    def nodes(self) -> Array:
        """Times [s] of the stages from the end of the carry on; 0 is the opening's start."""
        nodes = opening_nodes(self.scene.nlp, self.scene.gripper.profile().opening)
        if self.window is None:
            return nodes
        before = self.window.step * np.arange(-self.window.early, 0)
        after = nodes[-1] + self.window.step * np.arange(1, self.window.late + 1)
        return np.concatenate([before, nodes, after])

    @property
    def opening_nodes(self) -> Array:
        """Times [s] of the stages from the opening's start to the flight's."""
        window = self.window
        if window is None:
            return self.nodes
        return self.nodes[window.early : len(self.nodes) - (0 if window.held else window.late)]

    def times(self, opening_time: float) -> Array:
        """Times (last + 1,) [s] of the stages on the motion's clock."""
        after = opening_time + self.nodes
        carry = np.linspace(0.0, after[0], self.scene.nlp.carry + 1)
        return np.concatenate([carry[:-1], after])
