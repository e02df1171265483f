"""Direct multiple shooting: from the problem's declarations to stages with states and constraints.

`Ocp` has what all declarations share: structure, parameters, models and stages. A `Node` is a stage
with its states, an `Interval` also what follows it; coordinates inside it are closed forms.

The relative states take Gauss collocation or Runge-Kutta steps. Two-point collocation (order 4,
A-stable) has the accelerations at its points as unknowns: two evaluations of the friction law an
interval, each a constraint of its own, and a next state that is linear in the unknowns. Classical
Runge-Kutta needs eight for the same accuracy, nested in one another, and has a stability limit in
step / epsilon.
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

#: Nodes of the two-point Gauss method, as shares of the interval.
NODES = (0.5 - math.sqrt(3) / 6, 0.5 + math.sqrt(3) / 6)
#: Its coefficients: accelerations to rates at the nodes.
_RATE = ((0.25, 0.25 - math.sqrt(3) / 6), (0.25 + math.sqrt(3) / 6, 0.25))
#: Applied twice: accelerations to positions at the nodes, and at the end.
_PLACE = tuple(
    tuple(sum(_RATE[i][k] * _RATE[k][j] for k in range(2)) for j in range(2)) for i in range(2)
)
_END = tuple(sum(0.5 * _RATE[k][j] for k in range(2)) for j in range(2))
#: Units of the unknown accelerations: slip [m/s^2], slip [m/s^2], rotation [rad/s^2].
UNITS = (10.0, 10.0, 100.0)


#: Pose (x, z, theta) and twist of the hand, and its motion as the release model needs it.
Hand = tuple[list[ca.SX], list[ca.SX], HandMotion]
Rates = Callable[[list[ca.SX], HandMotion, ca.SX], list[ca.SX]]
#: Second derivative of the relative state: (node, state, hand, grip force) -> accelerations.
RelativeDynamics = Callable[["Node", list[ca.SX], HandMotion, ca.SX], list[ca.SX]]


class Ocp:
    """An optimal control problem that is being declared."""

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

    def discretise(self, variables: Callable[[int], Stage]) -> None:
        """The nodes' stages: nodes with the same states and constraints share one."""
        s, made = self.structure, dict[tuple[bool, ...], Stage]()
        for k in range(s.last + 1):
            marks = (0, s.carry - 1, s.carry, s.opens, s.detach, s.last)
            kind = tuple(k < mark for mark in marks) + tuple(k == mark for mark in marks)
            if kind not in made:
                made[kind] = variables(k)
            self.stages.append(made[kind])

    def intervals(self) -> Iterator[Interval]:
        """The first interval of each stage."""
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
        """Hand pose, twist, and what the release model needs of its motion; lifted."""
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
        """All six relative states: without the pivot the object keeps its grasp angle."""
        if self.structure.pivot:
            return state
        return [state[0], state[1], self.grasp_angle, state[2], state[3], ca.SX(0)]

    def along_bar(self) -> Sequence[ca.SX]:
        """Points of the bar's axis [m] from the CoM: its ends, and between them."""
        ahead, behind = self.parameters("ahead"), self.parameters("behind")
        return [ahead, ahead / 2, ca.SX(0), -behind / 2, -behind]


@dataclass(frozen=True, eq=False)
class Node:
    """Node k and its stage."""

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
        """q, dq and (jerk control) ddq; at the start they may be given, or zero at rest."""
        ocp, states = self.ocp, self.stage.states
        q = states[Q] if Q in states else ocp.each("start")
        rate, acceleration = (
            ocp.each(name) if ocp.structure.under_way else ca.SX.zeros(ocp.n)
            for name in ("start_rate", "start_acceleration")
        )
        return q, states.get(DQ, rate), states.get(DDQ, acceleration)

    @property
    def hand(self) -> Hand:
        """The hand at the node."""
        return self.ocp.hand(self.stage, *self.coordinates)

    def relative_state(self, opening: int = 0) -> list[ca.SX]:
        """The relative states; sticking at the opening's start. opening: 0 is the planned one."""
        block = REL.number(opening)
        if block in self.stage.states:
            return list(ca.vertsplit(self.stage.states[block]))
        held = self.p(f"grasp_angle {opening}") if opening else self.ocp.grasp_angle
        angle = [held] if self.ocp.structure.pivot else []
        zero = [ca.SX(0)] * (self.ocp.rel_size // 2)
        return [*zero[:2], *angle, *zero]

    def limit(self, kind: str, share: ca.SX) -> None:
        """-1 <= share <= 1 per coordinate."""
        self.ocp.limit(self.stage, kind, share)

    def limit_position(self, kind: str, q: ca.SX) -> None:
        """q within the position limits."""
        self.limit(kind, (q - self.ocp.each("q_mid")) / self.ocp.each("q_half"))

    def stage_parameter(self, name: str, size: int, first: int, count: int) -> ca.SX:
        """A symbol (size, 1) with other values at each of `count` stages from `first` on."""
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
        """q, dq, ddq at time t into the interval: closed forms."""
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
        """The next node's `block` equals `value`; nothing where that is no state."""
        if block in self.following.states:
            self.stage.following[block] = value
            # In the order of the next stage's states, as FATROP's gaps want it.
            order = [b for b in self.following.states if b in self.stage.following]
            self.stage.following = {b: self.stage.following[b] for b in order}

    def set_second_derivative(
        self, block: Block, dynamics: RelativeDynamics, *, window: bool = False
    ) -> None:
        """The relative states `block` follow `dynamics`; window: not in the opening only."""
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

    unknown: the accelerations at both nodes, in UNITS. accelerations: (number of the node, its
    share of the interval, state there) -> what they must be.
    """
    half = len(state) // 2
    place, rate, units = state[:half], state[half:], UNITS[:half]
    points = [unknown[:half], unknown[half:]]
    found = [[u * a for u, a in zip(units, ca.vertsplit(p), strict=True)] for p in points]

    def moved(i: int, share: float, row: tuple[float, ...]) -> ca.SX:
        return share * dt * rate[i] + dt**2 * sum(
            weight * a[i] for weight, a in zip(row, found, strict=True)
        )

    def gained(i: int, row: tuple[float, ...]) -> ca.SX:
        return dt * sum(weight * a[i] for weight, a in zip(row, found, strict=True))

    for k, node in enumerate(NODES):
        at = [p + moved(i, node, _PLACE[k]) for i, p in enumerate(place)]
        speed = [r + gained(i, _RATE[k]) for i, r in enumerate(rate)]
        law = accelerations(k, node, [*at, *speed])
        for unit, variable, value in zip(units, ca.vertsplit(points[k]), law, strict=True):
            stage.subject_to("sliding pivot", variable - value / unit, 0.0, 0.0)
    end = [p + moved(i, 1.0, _END) for i, p in enumerate(place)]
    return [*end, *[r + gained(i, (0.5, 0.5)) for i, r in enumerate(rate)]]


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
    """Times (intervals, k) at which the integrator needs the grip force."""
    shares = np.array(NODES)
    if mesh.integrator == "rk4":
        shares = np.linspace(0.0, 1.0, 2 * mesh.substeps + 1)
    return np.asarray(nodes[:-1, None] + np.diff(nodes)[:, None] * shares)
