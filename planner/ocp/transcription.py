"""Direct multiple shooting: from the problem's declarations to stages with states and constraints.

`Ocp` has structure, parameters, models and stages. A `Node` is a stage at its place k; an
`Interval` leads to the next stage. The coordinates inside an interval are polynomials in closed
form.

The state of the object in the pads takes Gauss collocation or Runge-Kutta steps. Two-point
collocation (order 4, A-stable) has the accelerations at its points as unknowns: an interval needs
two evaluations of the friction law, each a constraint of its own, and the next state is linear in
the unknowns. Classical Runge-Kutta needs eight nested evaluations for equal accuracy, and its
stability limits step / epsilon.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from ...models import Array, Body, Contact, FlightLaw, HandMotion
from ...models.release import SlidingPivot, Widths, rk4_step
from ...problems import Mesh
from ..throw import Manipulator
from .stages import Constraints, Parameters, Stage
from .variables import (
    ACC,
    ACCELERATION,
    DDQ,
    DQ,
    JERK,
    JERK_UNIT,
    REL,
    Block,
    Q,
    Structure,
    T,
)

#: Points of the two-point Gauss method, as shares of the interval.
NODES = (0.5 - math.sqrt(3) / 6, 0.5 + math.sqrt(3) / 6)
#: Coefficients of accelerations in the rates at the points.
_RATE = ((0.25, 0.25 - math.sqrt(3) / 6), (0.25 + math.sqrt(3) / 6, 0.25))
#: Coefficients of accelerations in the positions at the points: _RATE squared.
_PLACE = tuple(
    tuple(sum(_RATE[i][k] * _RATE[k][j] for k in range(2)) for j in range(2)) for i in range(2)
)
#: Coefficients of accelerations in the position at the end.
_END = tuple(sum(0.5 * _RATE[k][j] for k in range(2)) for j in range(2))
#: Units of the unknown accelerations: two of slip [m/s^2], one of rotation [rad/s^2].
UNITS = (10.0, 10.0, 100.0)


#: Pose (x, z, theta) and twist of the hand, and its motion for the release model.
Hand = tuple[list[ca.SX], list[ca.SX], HandMotion]
Rates = Callable[[list[ca.SX], HandMotion, ca.SX], list[ca.SX]]
#: Second derivative of the relative state: (node, state, hand, grip force) -> accelerations.
RelativeDynamics = Callable[["Node", list[ca.SX], HandMotion, ca.SX], list[ca.SX]]


class Ocp:
    """An optimal control problem during its declaration."""

    def __init__(self, structure: Structure, manipulator: Manipulator) -> None:
        self.structure = structure
        self.n, self.names = manipulator.size, manipulator.joints
        self.kinematics, self.capsules = manipulator.kinematics, manipulator.capsules
        p = self.parameters = Parameters()
        self.body = Body(p("mass"), p("inertia"), p("com_offset"))
        self.contact = Contact(p("friction"), p("patch_radius"), p("torsion"), p("faces"))
        self.gravity = p("gravity")
        self.flight = FlightLaw(self.gravity)
        self.grasp_angle = p("grasp_angle")
        self.releases = {0: self._release(self.body, self.contact)}
        self.initial: dict[Block, ca.SX] = {}
        self.control = JERK if structure.jerk_control else ACCELERATION
        self.rel_size = 6 if structure.pivot else 4
        self.stages: list[Stage] = []

    def _release(self, body: Body, contact: Contact) -> SlidingPivot:
        widths = Widths.relative(self.parameters("epsilon"), body, contact, self.gravity)
        return SlidingPivot(body, contact, self.gravity, widths=widths)

    def release(self, opening: int = 0) -> SlidingPivot:
        """The release model of a throw; opening: 0 is the planned one."""
        if opening not in self.releases:
            names = ("mass", "inertia", "com_offset", "friction", "patch_radius")
            values = [self.parameters(f"{name} {opening}") for name in names]
            contact = dataclasses.replace(self.contact, friction=values[3], patch_radius=values[4])
            self.releases[opening] = self._release(Body(*values[:3]), contact)
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
                yield Interval(self, k, stage, self.stages[k + 1])

    @property
    def at_detach(self) -> Node:
        """The node at which the grip force is zero."""
        return Node(self, self.structure.detach, self.stages[self.structure.detach])

    @property
    def at_end(self) -> Node:
        """The last node: at detach, or at the end of a robust window."""
        return Node(self, self.structure.last, self.stages[-1])

    def each(self, name: str) -> ca.SX:
        """The parameter `name` with one value per coordinate."""
        return self.parameters(name, self.n)

    def hand(self, constraints: Constraints, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> Hand:
        """Pose, twist and motion of the hand; lifted."""
        n, kinematics = self.n, self.kinematics
        links = constraints.lift(
            *(v for values in (q, dq, ddq) for v in kinematics.link_angles(values))
        )
        pose, twist, acceleration = kinematics.motion_of(
            links[:n], links[n : 2 * n], links[2 * n :]
        )
        x, z, *motion = constraints.lift(*pose, twist[2], *acceleration)
        return [x, z, motion[0]], [*twist[:2], motion[1]], HandMotion(*motion)

    def limit(self, constraints: Constraints, kind: str, share: ca.SX) -> None:
        """-1 <= share <= 1 per coordinate, under the coordinate's name."""
        for i, name in enumerate(self.names):
            constraints.subject_to(f"{name} {kind}", share[i], -1.0, 1.0)

    def full_relative_state(self, state: list[ca.SX]) -> list[ca.SX]:
        """All six states of the object in the pads; without the pivot it keeps its grasp angle."""
        if self.structure.pivot:
            return state
        return [state[0], state[1], self.grasp_angle, state[2], state[3], ca.SX(0)]

    def along_bar(self) -> Sequence[ca.SX]:
        """Points of the bar's axis [m] from the CoM: its ends, and between them."""
        ahead, behind = self.parameters("ahead"), self.parameters("behind")
        return [ahead, ahead / 2, ca.SX(0), -behind / 2, -behind]


@dataclass(frozen=True, eq=False)
class Node:
    """Node k with its stage."""

    ocp: Ocp
    k: int
    stage: Stage

    @property
    def p(self) -> Parameters:
        """The parameters."""
        return self.ocp.parameters

    def subject_to(
        self, name: str, value: ca.SX, low: float = -np.inf, high: float = np.inf
    ) -> None:
        """Add the constraint low <= value <= high, for each component."""
        self.stage.subject_to(name, value, low, high)

    def add_objective(self, cost: ca.SX) -> None:
        """Add to the cost."""
        self.stage.cost += cost

    @property
    def coordinates(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """q, dq and (jerk control) ddq: states, or known initial values."""
        values = self.ocp.initial | self.stage.states
        return values[Q], values[DQ], values[DDQ]

    @property
    def hand(self) -> Hand:
        """The hand at the node."""
        return self.ocp.hand(self.stage, *self.coordinates)

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

    def limit(self, kind: str, share: ca.SX) -> None:
        """-1 <= share <= 1 per coordinate."""
        self.ocp.limit(self.stage, kind, share)

    def limit_position(self, kind: str, q: ca.SX) -> None:
        """q within the position limits."""
        self.limit(kind, (q - self.ocp.each("q_mid")) / self.ocp.each("q_half"))

    def stage_parameter(self, name: str, size: int, first: int, count: int) -> ca.SX:
        """A parameter (size, 1) with its own values at each of `count` stages from `first` on."""
        self.p(name, size * count)
        if name not in self.stage.data:
            self.stage.data[name] = (ca.SX.sym(name, size), first)
        return self.stage.data[name][0]


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
        c = self.stage.controls[self.ocp.control]
        if self.ocp.structure.jerk_control:
            jerk = JERK_UNIT * c
            return (
                q + t * (dq + t * (ddq / 2 + t * jerk / 6)),
                dq + t * (ddq + t * jerk / 2),
                ddq + t * jerk,
            )
        return q + t * (dq + t * c / 2), dq + t * c, c

    def set_next(self, block: Block, value: ca.SX) -> None:
        """Sets the next node's `block` to `value`, if it is a state there."""
        if block in self.following.states:
            self.stage.following[block] = value
            # FATROP's gaps have the order of the next stage's states.
            order = [b for b in self.following.states if b in self.stage.following]
            self.stage.following = {b: self.stage.following[b] for b in order}

    def set_second_derivative(
        self, block: Block, dynamics: RelativeDynamics, *, window: bool = False
    ) -> None:
        """The state `block` of the object in the pads follows `dynamics`, in the opening; with
        `window` in the whole window of a robust plan."""
        s, dt, opening = self.ocp.structure, self.dt, block.index
        first, end = (s.carry, s.last) if window else (s.opens, s.detach)
        points = 2 if s.integrator == "gauss" or window else 2 * s.substeps + 1
        forces = self.stage_parameter(grip_force(opening), points, first, end - first)
        grips, state = ca.vertsplit(forces), self.relative_state(opening)

        def hand(share: float) -> HandMotion:
            return self.ocp.hand(self.stage, *self.at(share * dt))[2]

        if points == 2:
            unknown = self.stage.control(ACC.number(opening), self.ocp.rel_size)

            def accelerations(k: int, share: float, values: list[ca.SX]) -> list[ca.SX]:
                return dynamics(self, values, hand(share), grips[k])

            end_state = gauss_step(self.stage, state, unknown, dt, accelerations)
        else:
            hands = [hand(i / (points - 1)) for i in range(points)]

            def rates(values: list[ca.SX], at: HandMotion, grip: ca.SX) -> list[ca.SX]:
                moving = values[len(values) // 2 :]
                return [*moving, *self.stage.lift(*dynamics(self, values, at, grip))]

            end_state = runge_kutta_steps(rates, state, hands, grips, dt)
        self.set_next(block, ca.vertcat(*end_state))


def sliding_pivot(
    node: Node, state: list[ca.SX], hand: HandMotion, grip: ca.SX, opening: int = 0
) -> list[ca.SX]:
    """Accelerations of slip [m/s^2] and angle [rad/s^2] (no angle without the pivot) by the
    smoothed law of an opening (0: planned). It takes seven numbers: slip, the object's angle and
    angular velocity, the hand's acceleration."""
    x, z, turn, _, _, spin = node.ocp.full_relative_state(state)
    x, z, theta, omega, *acceleration = node.stage.lift(
        x, z, hand.theta + turn, hand.omega + spin, hand.a_x, hand.a_z, hand.alpha
    )
    zero, motion = ca.SX(0), HandMotion(theta, omega, *acceleration)
    rates = node.ocp.release(opening).rates([x, z, zero, zero, zero, zero], motion, grip)
    return rates[3:] if node.ocp.structure.pivot else rates[3:5]


def grip_force(opening: int) -> str:
    """Name of the parameter with the grip force of an opening."""
    return f"grip_force {opening}"


def gauss_step(
    stage: Stage,
    state: list[ca.SX],
    unknown: ca.SX,
    dt: ca.SX,
    accelerations: Callable[[int, float, list[ca.SX]], list[ca.SX]],
) -> list[ca.SX]:
    """The state at the interval's end; adds the collocation constraints.

    unknown: the accelerations at both points, in UNITS. accelerations: the law, as a function of
    the point's number, its share of the interval, and the state there.
    """
    half = len(state) // 2
    place, rate, units = state[:half], state[half:], UNITS[:half]
    points = [unknown[:half], unknown[half:]]
    acceleration = [[u * a for u, a in zip(units, ca.vertsplit(p), strict=True)] for p in points]

    def displacement(i: int, share: float, row: tuple[float, ...]) -> ca.SX:
        return share * dt * rate[i] + dt**2 * sum(
            weight * a[i] for weight, a in zip(row, acceleration, strict=True)
        )

    def gain(i: int, row: tuple[float, ...]) -> ca.SX:
        return dt * sum(weight * a[i] for weight, a in zip(row, acceleration, strict=True))

    for k, node in enumerate(NODES):
        at = [p + displacement(i, node, _PLACE[k]) for i, p in enumerate(place)]
        speed = [r + gain(i, _RATE[k]) for i, r in enumerate(rate)]
        law = accelerations(k, node, [*at, *speed])
        for unit, variable, value in zip(units, ca.vertsplit(points[k]), law, strict=True):
            stage.subject_to("sliding pivot", variable - value / unit, 0.0, 0.0)
    end = [p + displacement(i, 1.0, _END) for i, p in enumerate(place)]
    return [*end, *[r + gain(i, (0.5, 0.5)) for i, r in enumerate(rate)]]


def runge_kutta_steps(
    rates: Rates,
    state: list[ca.SX],
    hands: Sequence[HandMotion],
    grips: Sequence[ca.SX],
    dt: ca.SX,
) -> list[ca.SX]:
    """The state at the interval's end; hands, grips: at the ends and the middle of each step."""
    steps = len(hands) // 2
    for i in range(0, 2 * steps, 2):
        state = rk4_step(rates, state, hands[i : i + 3], grips[i : i + 3], dt / steps)
    return state


def grip_instants(mesh: Mesh, nodes: Array) -> Array:
    """Times (intervals, k) [s] at which the integrator evaluates the grip force."""
    shares = np.array(NODES)
    if mesh.integrator == "rk4":
        shares = np.linspace(0.0, 1.0, 2 * mesh.substeps + 1)
    return np.asarray(nodes[:-1, None] + np.diff(nodes)[:, None] * shares)
