"""Direct multiple shooting: from the problem's declarations to stages with states and constraints.

`Ocp` has structure, parameters, models and stages. A `Node` is a stage at its place k; an
`Interval` leads to the next stage. The coordinates inside an interval are polynomials in closed
form.

The state of the object in the pads takes two-point Gauss collocation (order 4, A-stable), with the
accelerations at its points as unknowns: an interval needs two evaluations of the friction law, each
a constraint of its own, and the next state is linear in the unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import Array, Body, FlightLaw, HandMotion, PinchContact
from ...models.release import SlidingPivot, Widths
from ..throw import Manipulator
from .stages import (
    ACC,
    DDQ,
    DQ,
    JERK,
    JERK_UNIT,
    REL,
    Block,
    Constraints,
    NlpStructure,
    Parameters,
    Q,
    Row,
    Stage,
    T,
)

#: Points of the two-point Gauss method, as shares of the interval.
NODES = (0.5 - math.sqrt(3) / 6, 0.5 + math.sqrt(3) / 6)
#: Coefficients of both accelerations in the rates at the points.
_RATE = np.array([[0.25, 0.25 - math.sqrt(3) / 6], [0.25 + math.sqrt(3) / 6, 0.25]])
#: Units of the unknown accelerations: two of slip [m/s^2], one of rotation [rad/s^2].
UNITS = (10.0, 10.0, 100.0)

#: Pose (x, z, theta) and twist of the hand, and its motion for the release model.
Hand = tuple[list[ca.SX], list[ca.SX], HandMotion]


class Ocp:
    """An optimal control problem during its declaration."""

    def __init__(
        self,
        structure: NlpStructure,
        manipulator: Manipulator,
        law: type[SlidingPivot] = SlidingPivot,
    ) -> None:
        self.structure, self.law = structure, law
        self.n, self.names = manipulator.size, manipulator.joints
        self.kinematics, self.capsules = manipulator.kinematics, manipulator.capsules
        p = self.parameters = Parameters()
        self.releases: dict[int, SlidingPivot] = {}
        release = self.release()
        self.body, self.contact, self.gravity = release.body, release.contact, p("gravity")
        bias = (p("bias_x"), p("bias_theta")) if structure.calibrated else None
        self.flight = FlightLaw(self.gravity, bias)
        self.grasp_angle = p("grasp_angle")
        self.initial: dict[Block, ca.SX] = {}
        self.rel_size = 6 if structure.pivot else 4
        self.stages: list[Stage] = []

    def release(self, opening: int = 0) -> SlidingPivot:
        """The release model of a throw; opening: 0 is the planned one."""
        if opening not in self.releases:
            p, own = self.parameters, f" {opening}" if opening else ""
            body = Body(p(f"mass{own}"), p(f"inertia{own}"), p(f"com_offset{own}"))
            friction, radius = p(f"friction{own}"), p(f"patch_radius{own}")
            contact = PinchContact(friction, radius, p("torsion"), p("faces"))
            widths = Widths.relative(p("epsilon"), body, contact, p("gravity"))
            self.releases[opening] = self.law(body, contact, p("gravity"), widths=widths)
        return self.releases[opening]

    def discretise(self, variables: Callable[[int], Stage], initial: dict[Block, ca.SX]) -> None:
        """Makes the stages; nodes that differ in numbers only share one.

        variables: the stage of node k, with its states and controls. initial: known values at k=0.
        """
        self.initial = initial
        s, kinds = self.structure, dict[tuple[bool, ...], Stage]()
        for k in range(s.last + 1):
            marks = (0, s.carry - 1, s.carry, s.opens, s.detach, s.last)
            kind = tuple(k < mark for mark in marks) + tuple(k == mark for mark in marks)
            if kind not in kinds:
                kinds[kind] = variables(k)
            self.stages.append(kinds[kind])

    def intervals(self) -> Iterator[Interval]:
        """The first interval of each stage; it stands for those that differ in numbers only."""
        seen: set[int] = set()
        for k, stage in enumerate(self.stages[:-1]):
            if id(stage) not in seen:
                seen.add(id(stage))
                yield Interval(self, stage, k, self.stages[k + 1])

    def node(self, k: int) -> Node:
        """Node k."""
        return Node(self, self.stages[k], k)

    @cached_property
    def hand_of_links(self) -> ca.Function:
        """Pose, twist and acceleration (9,) of the hand, of the links' angles, rates and turns
        (3 n,).

        A function, since CasADi copies its expressions faster than Python writes them again.
        """
        n, links = self.n, ca.SX.sym("links", 3 * self.n)
        given = ca.vertsplit(links)
        hand = self.kinematics.motion_of(given[:n], given[n : 2 * n], given[2 * n :])
        return ca.Function("hand", [links], [ca.vertcat(*(v for values in hand for v in values))])

    def each(self, name: str) -> ca.SX:
        """The parameter `name` with one value per coordinate."""
        return self.parameters(name, self.n)

    def full_relative_state(self, state: list[ca.SX]) -> list[ca.SX]:
        """All six states of the object in the pads; without the pivot it keeps its grasp angle."""
        if self.structure.pivot:
            return state
        return [state[0], state[1], self.grasp_angle, state[2], state[3], ca.SX(0)]

    def along_bar(self) -> list[OutlinePoint]:
        """Points of a bar's axis: its ends, and between them. Of an outline: `outline_points`."""
        if self.structure.parts:
            return self.outline_points(3)
        ahead, behind = self.parameters("ahead"), self.parameters("behind")
        return [OutlinePoint(at) for at in (ahead, ahead / 2, ca.SX(0), -behind / 2, -behind)]

    def outline_points(self, count: int) -> list[OutlinePoint]:
        """`count` even points on the axis of each capsule of the object's outline."""
        rows = self.parameters("outline", 5 * self.structure.parts)
        points = list[OutlinePoint]()
        for part in ca.vertsplit(rows, 5):
            for share in np.linspace(0.0, 1.0, count).tolist():
                at = (1 - share) * part[:2] + share * part[2:4]
                points.append(OutlinePoint(at[0], at[1], part[4]))
        return points


@dataclass(frozen=True)
class OutlinePoint:
    """A point of the object [m] along and across its axis, from the CoM, and the radius [m] of the
    outline around it; 0 for a bar, whose edges depend on its angle."""

    along: ca.SX
    across: Any = 0.0
    radius: Any = 0.0

    def placed(self, x: Any, z: Any, cos: Any, sin: Any) -> tuple[Any, Any]:
        """Its x, z [m] for a CoM at x, z and the axis' angle."""
        return (x + self.along * cos - self.across * sin, z + self.along * sin + self.across * cos)


@dataclass(frozen=True, eq=False)
class Scope:
    """Where constraints are declared: a stage, or a group of instants in it."""

    ocp: Ocp
    stage: Constraints

    @property
    def p(self) -> Parameters:
        """The parameters."""
        return self.ocp.parameters

    def subject_to(
        self, name: str, value: ca.SX, low: float = -np.inf, high: float = np.inf
    ) -> None:
        """Add the constraint low <= value <= high, for each component."""
        self.stage.rows.append(Row(name, value, low, high))

    def limit(self, kind: str, share: ca.SX) -> None:
        """-1 <= share <= 1 per coordinate, under the coordinate's name."""
        for i, name in enumerate(self.ocp.names):
            self.subject_to(f"{name} {kind}", share[i], -1.0, 1.0)

    def limit_position(self, kind: str, q: ca.SX) -> None:
        """q within the position limits."""
        self.limit(kind, (q - self.ocp.each("q_mid")) / self.ocp.each("q_half"))

    def hand_of(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> Hand:
        """Pose, twist and motion of the hand at coordinates; lifted."""
        stage, angles = self.stage, self.ocp.kinematics.link_angles
        links = stage.lift(*(value for values in (q, dq, ddq) for value in angles(values)))
        x, z, theta, v_x, v_z, *rest = ca.vertsplit(self.ocp.hand_of_links(ca.vertcat(*links)))
        x, z, *motion = stage.lift(x, z, theta, *rest)
        return [x, z, motion[0]], [v_x, v_z, motion[1]], HandMotion(*motion)


@dataclass(frozen=True, eq=False)
class Node(Scope):
    """Node k with its stage."""

    stage: Stage
    k: int

    def add_objective(self, cost: ca.SX) -> None:
        """Add to the cost."""
        self.stage.cost += cost

    @property
    def coordinates(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, dq, ddq: states, or known initial values."""
        values = self.ocp.initial | self.stage.states
        return values[Q], values[DQ], values[DDQ]

    @property
    def hand(self) -> Hand:
        """The hand at the node."""
        return self.hand_of(*self.coordinates)

    def relative_state(self, opening: int = 0) -> list[ca.SX]:
        """State of the object in the pads; zero at the start of the opening. opening: 0 is the
        planned one."""
        block = REL.number(opening)
        if block in self.stage.states:
            return list(ca.vertsplit(self.stage.states[block]))
        grasp = self.p(f"grasp_angle {opening}") if opening else self.ocp.grasp_angle
        angle = [grasp] if self.ocp.structure.pivot else []
        zero = [ca.SX(0)] * (self.ocp.rel_size // 2)
        return [*zero[:2], *angle, *zero]

    def stage_parameter(self, name: str, size: int, first: int, count: int) -> ca.SX:
        """A parameter (size, 1) with its own values at each of `count` stages from `first` on."""
        self.p(name, size * count)
        if name not in self.stage.data:
            self.stage.data[name] = (ca.SX.sym(name, size), first)
        return self.stage.data[name][0]

    def at_instants(self, *data: npt.ArrayLike) -> tuple[Scope, list[ca.SX]]:
        """A group of N instants, and symbols for the `data` (N,) of each."""
        group, symbols = self.stage.at_instants(*data)
        return Scope(self.ocp, group), symbols


@dataclass(frozen=True, eq=False)
class Interval(Node):
    """The interval from node k to the next; the control is constant in it."""

    following: Stage

    @property
    def phase(self) -> Literal["carry", "early", "opening", "late"]:
        """The phase, see `problem`."""
        s = self.ocp.structure
        if self.k < s.opens:
            return "carry" if self.k < s.carry else "early"
        return "opening" if self.k < s.detach else "late"

    @property
    def dt(self) -> ca.SX:
        """Length [s]."""
        s, phase = self.ocp.structure, self.phase
        if phase == "carry":
            return self.stage.states[T] / s.carry
        if phase == "opening":
            return self.stage_parameter("interval", 1, s.opens, s.opening)
        return self.p("window_step")

    def at(self, t: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, dq, ddq at time t [s] after the node."""
        q, dq, ddq = self.coordinates
        jerk = JERK_UNIT * self.stage.controls[JERK]
        return (
            q + t * (dq + t * (ddq / 2 + t * jerk / 6)),
            dq + t * (ddq + t * jerk / 2),
            ddq + t * jerk,
        )

    def hand_at(self, share: float) -> Hand:
        """The hand at a share of the interval."""
        return self.hand_of(*self.at(share * self.dt))

    def set_next(self, block: Block, value: ca.SX) -> None:
        """Sets the next node's `block` to `value`, if it is a state there."""
        if block in self.following.states:
            self.stage.following[block] = value
            # FATROP's gaps have the order of the next stage's states.
            order = [b for b in self.following.states if b in self.stage.following]
            self.stage.following = {b: self.stage.following[b] for b in order}

    def set_sliding_pivot(self, opening: int = 0) -> None:
        """The object in the pads follows the sliding pivot of an opening: of the planned one (0) in
        the opening, of others in the whole window of a robust plan."""
        s, dt = self.ocp.structure, self.dt
        first, end = (s.carry, s.last) if opening else (s.opens, s.detach)
        forces = self.stage_parameter(f"grip_force {opening}", 2, first, end - first)
        state = self._gauss_step(self.relative_state(opening), dt, ca.vertsplit(forces), opening)
        self.set_next(REL.number(opening), state)

    def _gauss_step(self, state: list[ca.SX], dt: ca.SX, grips: list[ca.SX], opening: int) -> ca.SX:
        """The state at the interval's end; adds the collocation constraints.

        Its unknowns are the accelerations at both points, in UNITS.
        """
        half = len(state) // 2
        place, rate = ca.vertcat(*state[:half]), ca.vertcat(*state[half:])
        units = ca.DM(UNITS[:half])
        unknown = ca.reshape(self.stage.control(ACC.number(opening), 2 * half), half, 2)
        acceleration = ca.diag(units) @ unknown
        for k, share in enumerate(NODES):
            at = place + share * dt * rate + dt**2 * (acceleration @ (_RATE @ _RATE)[k])
            speed = rate + dt * (acceleration @ _RATE[k])
            values = [*ca.vertsplit(at), *ca.vertsplit(speed)]
            law = self._accelerations(values, self.hand_at(share)[2], grips[k], opening)
            self.subject_to("sliding pivot", unknown[:, k] - ca.vertcat(*law) / units, 0.0, 0.0)
        end = place + dt * rate + dt**2 * (acceleration @ _RATE.sum(axis=0) / 2)
        return ca.vertcat(end, rate + dt * ca.sum2(acceleration) / 2)

    def _accelerations(
        self, state: list[ca.SX], hand: HandMotion, grip: ca.SX, opening: int
    ) -> list[ca.SX]:
        """Accelerations of slip [m/s^2] and angle [rad/s^2] (no angle without the pivot) by the
        smoothed law of an opening. It takes seven numbers: slip, the object's angle and angular
        velocity, the hand's acceleration."""
        x, z, turn, _, _, spin = self.ocp.full_relative_state(state)
        x, z, theta, omega, *acceleration = self.stage.lift(
            x, z, hand.theta + turn, hand.omega + spin, hand.a_x, hand.a_z, hand.alpha
        )
        zero, motion = ca.SX(0), HandMotion(theta, omega, *acceleration)
        rates = self.ocp.release(opening).rates([x, z, zero, zero, zero, zero], motion, grip)
        return list(rates[3:] if self.ocp.structure.pivot else rates[3:5])


def grip_instants(nodes: Array) -> Array:
    """Times (intervals, 2) [s] at which the collocation evaluates the grip force."""
    return np.asarray(nodes[:-1, None] + np.diff(nodes)[:, None] * NODES)
