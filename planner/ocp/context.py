"""What all parts of the throw's NLP share: structure, terms, parameters, models, coordinates.

The NLP has a core that every throw needs (`phases`), and a `Term` for each optional part of the
scene (`terms`): what a scene does not have adds no variable, constraint or parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, Self

import casadi as ca

from ...models import (
    Body,
    Contact,
    FlightState,
    HandMotion,
    PlanarArm,
    SlidingPivot,
    pivot_wrench,
    relative_widths,
)
from ..check import Mover, Throw, Violation
from .asked import Request
from .layout import ACCELERATION, DDQ, DQ, JERK, JERK_UNIT, REL, Block, Q, T
from .stages import Parameters, Rows, Stage

#: Share of the acceleration limit counted on for braking.
BRAKE_SHARE = 0.95
#: What holds the object: the full grip, pads that open (all of it or nothing), nothing.
Grip = Literal["full", "opening", "none"]
Load = tuple[ca.SX, ca.SX, ca.SX]
#: Pose (x, z, theta) and twist of the hand, and its motion as the release model needs it.
Hand = tuple[list[ca.SX], list[ca.SX], HandMotion]


@dataclass(frozen=True)
class Structure:
    """What an NLP consists of; two tasks with the same one share a build.

    carry, opening: numbers of intervals; early, late: of those of fixed length before and after
    the opening. instants: parts of a carry interval at whose ends grip and held bar are
    constrained. pivot: whether the object's rotation against the hand matters (it does not for
    a CoM grasp with the landing angle open).
    """

    carry: int
    opening: int
    early: int
    late: int
    integrator: str
    substeps: int
    instants: int
    jerk_control: bool
    free_start: bool
    under_way: bool
    angle: bool
    pivot: bool
    elastic: bool
    robust: str
    terms: tuple[Term, ...]

    @property
    def opens(self) -> int:
        """Number of the stage at which the grip force starts to fall."""
        return self.carry + self.early

    @property
    def detach(self) -> int:
        """Number of the stage at which it is zero."""
        return self.opens + self.opening

    @property
    def local(self) -> bool:
        """Whether numbers of it depend on the throw that a solve starts from."""
        return any(term.local for term in self.terms)

    @property
    def last(self) -> int:
        """Number of the last stage: at detach, or at the end of the window."""
        return self.detach + self.late


class Term:
    """One optional part of a scene, whole.

    A subclass is a frozen dataclass whose fields say which of the part's rows the NLP has. It
    overrides `of` and those of the other methods where it has something to add or to say.
    """

    #: Whether the object's rotation matters with it even where the landing angle is open.
    turns: ClassVar[bool] = False

    @property
    def local(self) -> bool:
        """Whether its numbers depend on the throw that a solve starts from."""
        return False

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """The term of a request, None where its scene has none."""
        raise NotImplementedError

    def numbers(self, request: Request) -> dict[str, Any]:
        """Values of the parameters that its rows ask for."""
        return {}

    def states(self, context: Context, k: int) -> dict[Block, int]:
        """Blocks that stage k has as states because of it, and their sizes."""
        return {}

    def at_instant(self, at: Instant) -> None:
        """Adds rows for an instant of the carry, a node of the opening or of the brake after it."""

    def in_interval(self, context: Context, k: int, stage: Stage, dt: ca.SX) -> None:
        """Adds rows for the interval after stage k, of length dt."""

    def at_rate(self, context: Context, stage: Stage, q: ca.SX, dq: ca.SX) -> None:
        """Adds rows for rates dq at coordinates q."""

    def in_window(self, context: Context, k: int, stage: Stage, following: Stage) -> None:
        """Adds to the interval after stage k of a robust request's window."""

    def in_flight(
        self, context: Context, stage: Stage, flight: FlightState, end: FlightState, time: ca.SX
    ) -> None:
        """Adds rows for the flight from detach to its end, the landing, after `time`."""

    def at_last(self, context: Context, stage: Stage, place: ca.SX, rate: ca.SX) -> None:
        """Adds rows for the last stage, from where the coordinates brake to rest.

        place, rate (n,): where the jerk limit has turned the acceleration into full braking.
        """

    def broken(self, throw: Throw) -> list[Violation]:
        """How a thrown motion breaks it: all of the motion by exact models, not the NLP's nodes."""
        return []


class Context:
    """Structure, parameters, models and coordinates of the NLP that is being built."""

    def __init__(self, structure: Structure, mover: Mover) -> None:
        self.structure = structure
        self.n = mover.size
        self.names = mover.joints
        self.kinematics, self.capsules = mover.kinematics, mover.capsules
        p = self.parameters = Parameters()
        self.body = Body(p("mass"), p("inertia"), p("com_offset"))
        self.contact = Contact(p("friction"), p("patch_radius"), p("torsion"), p("faces"))
        self.gravity = p("gravity")
        self.grasp_angle = p("grasp_angle")
        widths = relative_widths(p("epsilon"), self.body, self.contact, self.gravity)
        self.release = SlidingPivot(self.body, self.contact, self.gravity, widths=widths)
        self.control = JERK if structure.jerk_control else ACCELERATION

    def each(self, name: str) -> ca.SX:
        """The parameter `name` with one value per coordinate."""
        return self.parameters(name, self.n)

    @property
    def rel_size(self) -> int:
        """Number of relative states of the sliding pivot."""
        return 6 if self.structure.pivot else 4

    def stage(self, k: int) -> Stage:
        """Symbols of stage k, as the table of `layout` says."""
        n, s = self.n, self.structure
        sizes: dict[Block, int] = {}
        if k > 0 or s.free_start:
            sizes[Q] = n
        if k > 0:
            sizes[DQ] = n
            if s.jerk_control:
                sizes[DDQ] = n
        if k < s.carry:
            sizes[T] = 1
        if s.opens < k <= s.detach:
            sizes[REL] = self.rel_size
        for term in s.terms:
            sizes |= term.states(self, k)
        stage = Stage({block: ca.SX.sym(block.name, size) for block, size in sizes.items()}, {})
        if k < s.last:
            stage.control(self.control, n)
        return stage

    def datum(self, stage: Stage, name: str, size: int = 1, *, window: bool = False) -> ca.SX:
        """A symbol (size, 1) with other numbers in each interval of opening or window."""
        s = self.structure
        first, end = (s.carry, s.last) if window else (s.opens, s.detach)
        self.parameters(name, size * (end - first))
        if name not in stage.data:
            stage.data[name] = (ca.SX.sym(name, size), first)
        return stage.data[name][0]

    def length(self, k: int, stage: Stage) -> ca.SX:
        """Length [s] of the interval after stage k, in opening or window."""
        s = self.structure
        if s.opens <= k < s.detach:
            return self.datum(stage, "interval")
        return self.parameters("window_step")

    def node(self, stage: Stage) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, dq and (jerk control) ddq at the stage's node, rest included."""
        q = stage.states[Q] if Q in stage.states else self.each("start")
        rate, acceleration = (
            self.each(name) if self.structure.under_way else ca.SX.zeros(self.n)
            for name in ("start_rate", "start_acceleration")
        )
        return q, stage.states.get(DQ, rate), stage.states.get(DDQ, acceleration)

    def inside(self, stage: Stage, t: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, dq, ddq at time t into the stage's interval: closed forms."""
        q, dq, ddq = self.node(stage)
        c = stage.controls[self.control]
        if self.structure.jerk_control:
            jerk = JERK_UNIT * c
            return (
                q + t * (dq + t * (ddq / 2 + t * jerk / 6)),
                dq + t * (ddq + t * jerk / 2),
                ddq + t * jerk,
            )
        return q + t * (dq + t * c / 2), dq + t * c, c

    def hand(self, stage: Rows, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> Hand:
        """Hand pose, twist, and what the release model needs of its motion; lifted."""
        n, kinematics = self.n, self.kinematics
        links = stage.lift(*(v for values in (q, dq, ddq) for v in kinematics.turned(values)))
        pose, twist, acceleration = kinematics.motion_of(
            links[:n], links[n : 2 * n], links[2 * n :]
        )
        x, z, *motion = stage.lift(*pose, twist[2], *acceleration)
        return [x, z, motion[0]], [*twist[:2], motion[1]], HandMotion(*motion)

    def instant(self, stage: Stage, t: ca.SX, grip: Grip, *, given: bool = False) -> Instant:
        """The hand at time t into the stage's interval."""
        return Instant(self, stage, *self.inside(stage, t), grip, given)

    def close(self, stage: Stage, following: Stage, dt: ca.SX, more: dict[Block, Any]) -> None:
        """The next stage's states: coordinates by their closed form, others by `more`."""
        ends = stage.following | more
        if not stage.following:
            ends |= dict(zip((Q, DQ, DDQ), self.inside(stage, dt), strict=True))
        # In the order of the next stage's states, as FATROP's gaps want it.
        stage.following = {block: ends[block] for block in following.states if block in ends}

    def limit(self, stage: Rows, kind: str, share: ca.SX) -> None:
        """-1 <= share <= 1 per coordinate, under the coordinate's name."""
        for i, name in enumerate(self.names):
            stage.row(f"{name} {kind}", share[i], -1.0, 1.0)

    def inside_positions(self, stage: Stage, kind: str, q: ca.SX) -> None:
        """q within the position limits."""
        self.limit(stage, kind, (q - self.each("q_mid")) / self.each("q_half"))

    def heights(self, q: ca.SX) -> list[ca.SX]:
        """Heights [m] of the arm's joint frames; none of a hand that moves by itself."""
        if isinstance(self.kinematics, PlanarArm):
            return self.kinematics.heights(self.kinematics.turned(q))
        return []

    def along_bar(self) -> Sequence[ca.SX]:
        """Points of the bar's axis [m] from the CoM: its ends, and between them."""
        ahead, behind = self.parameters("ahead"), self.parameters("behind")
        return [ahead, ahead / 2, ca.SX(0), -behind / 2, -behind]


@dataclass(frozen=True, eq=False)
class Instant:
    """The hand at one instant of a stage's interval, as terms constrain it.

    q, dq, ddq (n,): the coordinates. given: whether the scene prescribes the pose, so that no
    more than the usual margin can be asked there.
    """

    context: Context
    stage: Rows
    q: ca.SX
    dq: ca.SX
    ddq: ca.SX
    grip: Grip
    given: bool

    @cached_property
    def hand(self) -> Hand:
        """The hand's pose (x, z, theta), twist and motion."""
        return self.context.hand(self.stage, self.q, self.dq, self.ddq)

    @cached_property
    def load(self) -> Load:
        """Force and torque at the pads that keep the object in the hand."""
        pose, _, motion = self.hand
        theta, h = pose[2] + self.context.grasp_angle, self.context.body.com_offset
        x, z = h * ca.cos(theta), h * ca.sin(theta)
        body, gravity = self.context.body, self.context.gravity
        return pivot_wrench(body, gravity, motion, motion.omega, x, z)

    @cached_property
    def bar_end(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """x, z [m] of the middle of the held bar's far end; cos and sin of the bar's angle."""
        context, (pose, *_) = self.context, self.hand
        theta = pose[2] + context.grasp_angle
        reach = context.body.com_offset + context.parameters("ahead")
        cos, sin = ca.cos(theta), ca.sin(theta)
        return pose[0] + reach * cos, pose[1] + reach * sin, cos, sin

    @property
    def held_margin(self) -> ca.SX:
        """Margin [m] between obstacles and what is carried, beyond the usual one."""
        return ca.SX(0) if self.given else self.context.parameters("held_margin")
