"""The optimal control problem of a throw, as on paper; `transcription` makes it an NLP.

Phases      carry        full grip, the object sticks      T, free, in equal intervals
            opening      grip force falls, object slides   fixed length, graded intervals
            flight       from detach to the landing        t_f, free, in closed form
            early, late  window around the opening         fixed length, robust plans only
States      q, dq, ddq; T; rel: slip, angle in the pads, their rates
Controls    c: jerk, constant in an interval; t_f at detach
Minimise    w_T T + integral of w_a sum (ddq / ddq_max)^2 + w_j sum (jerk / jerk_max)^2 dt to the
            last node, with weights of [cost], and limits less margins; price of an elastic
            landing's miss; costs of a robust method
Subject to  bounds of states and controls                          variable_bounds
            start at rest, or in a given motion; q free or given   initial_state
            dynamics of q; rel' = sliding pivot(rel, hand, grip)   dynamics
            limits of the coordinates between the nodes            coordinate_limits
            full grip holds the object; constraints of the scene   grip_constraints, `terms`
            landing on the target, or at a place in it, after t_f  landing, land
            rest inside the limits after the last node             brake
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca

from ...models import Trajectory
from ...models.robot import PlanarHand
from .request import Request, Weights
from .scene_constraint import Brake, Flight, Instant, SceneConstraint, gripped_instants
from .stages import DDQ, DQ, JERK, JERK_UNIT, PLACE, REL, SLACKS, T_F, TURN, Block, Q, Stage, T
from .transcription import Hand, Interval, Node, Ocp

#: Shortest carry and longest flight [s] of a plan.
CARRY_MIN, FLIGHT_MAX = 0.02, 3.0


def variable_bounds(request: Request) -> dict[str, tuple[Any, Any]]:
    """(low, high) of states and controls by their names, in their units; all others are free."""
    limits, scene = request.manipulator.planning, request.scene
    # The opening command follows the start, and precedes the opening by dwell and mean delay.
    command = scene.gripper.profile().dwell + scene.mean_delay + request.nodes[0]
    control = limits.jerk / JERK_UNIT * (1.0 - request.refinement.margins["torque rate"])
    return {
        "q": (limits.q_min, limits.q_max),
        "dq": (-limits.dq, limits.dq),
        "ddq": (-limits.ddq, limits.ddq),
        "c": (-control, control),
        "T": (max(command, CARRY_MIN), scene.nlp.carry_max),
        "t_f": (0.0, FLIGHT_MAX),
        PLACE.name: (-1.0, 1.0),
        TURN.name: (0.0, math.pi / 2),
        **{slack.name: (0.0, ca.inf) for slack in SLACKS},
    }


@dataclass(frozen=True)
class ThrowProblem:
    """The problem, declared on `ocp`, which has structure, parameters and models."""

    ocp: Ocp
    constraints: list[SceneConstraint]

    def declare(self) -> ca.SX:
        """Declares everything; returns the landing (x, z, theta) in the states at detach."""
        self.ocp.discretise(self.variables, self.initial_state())
        for interval in self.ocp.intervals():
            if interval.phase == "opening":
                self.scene_constraints(Instant.of(interval, ca.SX(0), "opening"))
            self.dynamics(interval)
            self.objective(interval)
            self.coordinate_limits(interval)
            for instant in gripped_instants(interval):
                self.grip_constraints(instant)
            if interval.phase == "late":
                self.scene_constraints(Instant.of(interval, ca.SX(0), "none"))
            for constraint in self.constraints:
                constraint.in_interval(interval)
        landing = self.landing(self.ocp.node(self.ocp.structure.detach))
        self.brake(self.ocp.node(self.ocp.structure.last))
        return landing

    def variables(self, k: int) -> Stage:
        """States and controls at node k; `land` adds the flight time at detach."""
        s, n, stage, known = self.ocp.structure, self.ocp.n, Stage(), self.initial_state()
        for block in (Q, DQ, DDQ):
            if k > 0 or block not in known:
                stage.state(block, n)
        if k < s.carry:
            stage.state(T)
        if s.opens < k <= s.detach:
            stage.state(REL, self.ocp.rel_size)
        for constraint in self.constraints:
            constraint.add_states(self.ocp, k, stage)
        if k < s.last:
            stage.control(JERK, n)
        return stage

    def initial_state(self) -> dict[Block, ca.SX]:
        """Known values at k = 0 (no variables): rest or a given motion; the pose if given."""
        ocp, rest = self.ocp, ca.SX.zeros(self.ocp.n)
        pose = {} if ocp.structure.free_start else {Q: ocp.each("start")}
        if not ocp.structure.initial_motion:
            return pose | {DQ: rest, DDQ: rest}
        return pose | {DQ: ocp.each("start_rate"), DDQ: ocp.each("start_acceleration")}

    def dynamics(self, interval: Interval) -> None:
        """d3q/dt3 = c; dT/dt = 0; rel follows the sliding pivot."""
        if interval.phase == "opening":
            interval.set_sliding_pivot()
        for block, end in zip((Q, DQ, DDQ), interval.at(interval.dt), strict=True):
            interval.set_next(block, end)
        if T in interval.stage.states:
            interval.set_next(T, interval.stage.states[T])

    def objective(self, interval: Interval) -> None:
        """The effort of the interval, and in the first one the price of the carry's time."""
        ocp, weights = self.ocp, Weights(*ca.vertsplit(interval.p("weights", len(Weights._fields))))
        first, last = (interval.at(t)[2] / ocp.each("ddq_max") for t in (ca.SX(0), interval.dt))
        jerk = JERK_UNIT * interval.stage.controls[JERK] / ocp.each("jerk_max")
        interval.add_objective(interval.dt * ca.sum1(mean_effort(first, last, jerk, weights)))
        if interval.k == 0:
            interval.add_objective(weights.carry_time * interval.stage.states[T])

    def coordinate_limits(self, interval: Interval) -> None:
        """Positions and velocities inside their limits between the nodes, by inner Bezier control
        points; an arm's opening intervals, some ms long, rely on the position margin, which a free
        hand does not have."""
        ocp, dt, (q, dq, ddq) = self.ocp, interval.dt, interval.coordinates
        if DQ in interval.stage.states:
            for constraint in self.constraints:
                constraint.at_rate(interval, q, dq)
        interval.limit("velocity", (dq + ddq * dt / 2) / ocp.each("dq_max"))
        if interval.phase != "opening" or isinstance(ocp.kinematics, PlanarHand):
            interval.limit_position("position", q + dq * dt / 3)
            end, rate, _ = interval.at(dt)
            interval.limit_position("position", end - rate * dt / 3)

    def grip_constraints(self, at: Instant) -> None:
        """The full grip holds the object: use <= 1 - sticking margin. With the scene's."""
        use = self.ocp.contact.utilisation_squared(*at.load, at.p("full_grip"))
        at.subject_to("grip while carrying", use / at.p("sticking_limit") ** 2, high=1.0)
        self.scene_constraints(at)

    def scene_constraints(self, at: Instant) -> None:
        """The constraints of the scene at an instant."""
        for constraint in self.constraints:
            constraint.at_instant(at)

    def landing(self, detach: Node) -> ca.SX:
        """x = x*, and theta = theta* if the target fixes it; an elastic problem pays for a miss.

        Of a region x* is between its bounds, and theta* too.
        """
        flight = land(detach, detach.hand)
        for i, name in enumerate(("x", "theta") if self.ocp.structure.angle else ("x",)):
            miss = getattr(flight.end, name) - detach.p(f"target_{name}")
            if self.ocp.structure.ranges[i]:
                miss = miss - detach.p(f"half_width_{name}") * detach.stage.control(PLACE.number(i))
            if self.ocp.structure.elastic:
                under, over = (detach.stage.control(b.number(i)) for b in SLACKS)
                detach.add_objective(detach.p(f"price_{name}") * (under + over))
                miss = miss + under - over
            detach.subject_to(f"landing {name}", miss, low=0.0, high=0.0)
        for constraint in self.constraints:
            constraint.in_flight(flight)
        return ca.SX(ca.vertcat(flight.end.x, flight.end.z, flight.end.theta))

    def brake(self, last: Node) -> None:
        """From the last node each coordinate comes to rest inside its limits."""
        brake = Brake.of(last)
        last.limit_position("room to brake", brake.stop)
        last.limit("velocity", brake.peak / self.ocp.each("dq_max"))
        for constraint in self.constraints:
            constraint.at_rate(last, brake.place, brake.peak)
            constraint.at_last(brake)


def land(node: Node, hand: Hand, opening: int = 0) -> Flight:
    """The free flight of t_f from a node: ends at the target's height, falling."""
    flight = Flight.of(node, hand, node.stage.control(T_F.number(opening)), opening)
    flight.subject_to("landing z", flight.end.z - node.p("target_z"), low=0.0, high=0.0)
    flight.subject_to("coming down", flight.end.v_z, high=0.0)
    return flight


def effort_of(request: Request, motion: Trajectory) -> float:
    """The cost of a motion by [cost], without the load on the pads."""
    limits, breaks, weights = request.manipulator.planning, motion.breaks, Weights.of(request.scene)
    ddq, jerk, lengths = motion.starts(2), motion.starts(3), breaks[1:] - breaks[:-1]
    first, last = ddq / limits.ddq, (ddq + lengths[:, None] * jerk) / limits.ddq
    cost = (lengths @ mean_effort(first, last, jerk / limits.jerk, weights)).sum()
    return float(cost + weights.carry_time * breaks[request.scene.nlp.carry])


def mean_effort(first: Any, last: Any, jerk: Any, weights: Weights) -> Any:
    """Mean effort over an interval: relative acceleration from first to last, constant jerk."""
    squared = (first**2 + first * last + last**2) / 3
    return weights.acceleration * squared + weights.jerk * jerk**2
