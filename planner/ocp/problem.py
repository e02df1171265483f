"""The optimal control problem of a throw, as on paper; `transcription` makes it an NLP.

    phase     until                     grip force  object                 intervals
    carry     T                         full        sticks to the pads     equal, T is free
    early     the force starts to fall  full        sticks                 a robust window's
    opening   detach: the force is 0    falls       smoothed sliding pivot shorter towards detach
    late      the window's end          none        flies                  a robust window's

Minimise    integral of 10 sum (ddq / ddq_max)^2 + sum (jerk / jerk_max)^2 dt  +  2 T
over        states q, dq, ddq, T, rel; controls c (jerk, or a hand's acceleration); t_f
subject to  dynamics, limits of the coordinates, sticking under full grip,
            start at rest (or in the given state of motion), landing on the target,
            room to brake after the last node, and the constraints of the scene (`terms`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from ...models import HandMotion
from .scene_constraint import Brake, Flight, Instant, SceneConstraint, gripped_instants
from .stages import Stage
from .transcription import Hand, Interval, Node, Ocp
from .variables import DDQ, DQ, FAR, JERK_UNIT, REL, SHORT, Q, T


class Weights(NamedTuple):
    """Prices of the squared relative acceleration and jerk, and of the carry's time [1/s]."""

    acceleration: Any = 10.0
    jerk: Any = 1.0
    carry_time: Any = 2.0


@dataclass(frozen=True)
class ThrowProblem:
    """The problem, declared on `ocp`, which has structure, parameters and models."""

    ocp: Ocp
    constraints: Sequence[SceneConstraint]

    def declare(self) -> ca.SX:
        """Declares everything; returns the landing (x, z, theta) in the states at detach."""
        self.ocp.discretise(self.variables)
        # Intervals that differ in numbers only are one here.
        for interval in self.ocp.intervals():
            if interval.phase == "opening":
                self.opening_constraints(interval)
            self.dynamics(interval)
            self.objective(interval)
            self.coordinate_limits(interval)
            if interval.phase in ("carry", "early"):
                self.sticking(interval)
            elif interval.phase == "late":
                self.scene_constraints(Instant.of(interval, ca.SX(0), "none"))
            for constraint in self.constraints:
                constraint.in_interval(interval)
                if interval.phase != "carry":
                    constraint.in_window(interval)
        landing = self.landing(self.ocp.at_detach)
        self.brake(self.ocp.at_end)
        return landing

    def variables(self, k: int) -> Stage:
        """States and controls at node k; known values (rest, a given start) are no states."""
        s, n, stage = self.ocp.structure, self.ocp.n, Stage()
        if k > 0 or s.free_start:
            stage.state(Q, n)
        if k > 0:
            stage.state(DQ, n)
            if s.jerk_control:
                stage.state(DDQ, n)
        if k < s.carry:
            stage.state(T)
        if s.opens < k <= s.detach:
            stage.state(REL, self.ocp.rel_size)
        for constraint in self.constraints:
            constraint.add_states(self.ocp, k, stage)
        if k < s.last:
            stage.control(self.ocp.control, n)
        return stage

    def dynamics(self, interval: Interval) -> None:
        """The jerk of q is the control (a free hand's acceleration is), constant in an interval;
        dT/dt = 0; while the pads open the relative states follow the sliding pivot."""
        if interval.phase == "opening":
            interval.set_second_derivative(REL, sliding_pivot)
        for block, end in zip((Q, DQ, DDQ), interval.at(interval.dt), strict=True):
            interval.set_next(block, end)
        if T in interval.stage.states:
            interval.set_next(T, interval.stage.states[T])

    def objective(self, interval: Interval) -> None:
        """The effort, and at the start the price of the carry's time."""
        ocp, ends = self.ocp, [interval.at(t)[2] for t in (ca.SX(0), interval.dt)]
        weights = Weights(*ca.vertsplit(interval.p("weights", len(Weights._fields))))
        first, last = (ddq / ocp.each("ddq_max") for ddq in ends)
        jerk = ca.SX.zeros(ocp.n)
        if ocp.structure.jerk_control:
            jerk = JERK_UNIT * interval.stage.controls[ocp.control] / ocp.each("jerk_max")
        interval.add_objective(interval.dt * ca.sum1(mean_effort(first, last, jerk, weights)))
        if interval.k == 0:
            interval.add_objective(weights.carry_time * interval.stage.states[T])

    def coordinate_limits(self, interval: Interval) -> None:
        """Positions and velocities inside their limits between the nodes, by inner Bezier control
        points; in an arm's opening intervals, some ms long, the position margin does it."""
        ocp, dt, (q, dq, ddq) = self.ocp, interval.dt, interval.coordinates
        if DQ in interval.stage.states:
            for constraint in self.constraints:
                constraint.at_rate(interval, q, dq)
        if not ocp.structure.jerk_control:
            interval.limit_position("position", q + dq * dt / 2)
            return
        interval.limit("velocity", (dq + ddq * dt / 2) / ocp.each("dq_max"))
        if interval.phase != "opening":
            interval.limit_position("position", q + dq * dt / 3)
            end, rate, _ = interval.at(dt)
            interval.limit_position("position", end - rate * dt / 3)

    def sticking(self, interval: Interval) -> None:
        """At instants of the interval the full grip holds the object without slip."""
        for instant in gripped_instants(interval):
            self.held_constraints(instant)

    def opening_constraints(self, interval: Interval) -> None:
        """At the opening's nodes; where the acceleration steps the full grip bears the new one."""
        s, start = self.ocp.structure, Instant.of(interval, ca.SX(0), "opening")
        if interval.k == s.opens and not s.jerk_control:
            self.held_constraints(start)
        else:
            self.scene_constraints(start)

    def held_constraints(self, at: Instant) -> None:
        """Grip use of at most one less the sticking margin, and the scene's constraints."""
        use = self.ocp.contact.utilisation_squared(*at.load, at.p("full_grip"))
        at.subject_to("grip while carrying", use / at.p("sticking_limit") ** 2, high=1.0)
        self.scene_constraints(at)

    def scene_constraints(self, at: Instant) -> None:
        """The constraints of the scene at an instant."""
        for constraint in self.constraints:
            constraint.at_instant(at)

    def landing(self, detach: Node) -> ca.SX:
        """x = x*, and theta = theta* if the target fixes it; an elastic problem pays for a miss."""
        flight = land(detach, detach.hand)
        for i, name in enumerate(("x", "theta") if self.ocp.structure.angle else ("x",)):
            miss = getattr(flight.end, name) - detach.p(f"target_{name}")
            if self.ocp.structure.elastic:
                short, far = (detach.stage.control(block.number(i)) for block in (SHORT, FAR))
                detach.add_objective(detach.p(f"price_{name}") * (short + far))
                miss = miss + short - far
            detach.subject_to(f"landing {name}", miss, low=0.0, high=0.0)
        for constraint in self.constraints:
            constraint.in_flight(flight)
        return ca.SX(ca.vertcat(flight.end.x, flight.end.z, flight.end.theta))

    def brake(self, last: Node) -> None:
        """From the last node each coordinate comes to rest inside its limits."""
        brake = Brake.of(last)
        last.limit_position("room to brake", brake.stop)
        if self.ocp.structure.jerk_control:
            last.limit("velocity", brake.peak / self.ocp.each("dq_max"))
        for constraint in self.constraints:
            constraint.at_rate(last, brake.place, brake.peak)
            constraint.at_last(brake)


def sliding_pivot(
    node: Node, state: list[ca.SX], hand: HandMotion, grip: ca.SX, opening: int = 0
) -> list[ca.SX]:
    """Accelerations of slip and angle (no angle without the pivot) by the smoothed law. It depends
    on seven numbers: slip, the object's angle and rate, the hand's acceleration. opening: 0 is the
    planned one."""
    x, z, turn, _, _, spin = node.ocp.full_relative_state(state)
    x, z, theta, omega, *acceleration = node.stage.lift(
        x, z, hand.theta + turn, hand.omega + spin, hand.a_x, hand.a_z, hand.alpha
    )
    zero, motion = ca.SX(0), HandMotion(theta, omega, *acceleration)
    rates = node.ocp.release(opening).rates([x, z, zero, zero, zero, zero], motion, grip)
    return rates[3:] if node.ocp.structure.pivot else rates[3:5]


def land(node: Node, hand: Hand, opening: int = 0) -> Flight:
    """The free flight from a node, down through the target's height after a free time t_f."""
    flight = Flight.of(node, hand, opening)
    flight.subject_to("landing z", flight.end.z - node.p("target_z"), low=0.0, high=0.0)
    flight.subject_to("coming down", flight.end.v_z, high=0.0)
    return flight


def mean_effort(first: Any, last: Any, jerk: Any, weights: Weights) -> Any:
    """Mean effort of each coordinate over an interval, for symbols and numbers. first, last:
    relative acceleration, linear between; jerk: relative, constant."""
    squared = (first**2 + first * last + last**2) / 3
    return weights.acceleration * squared + weights.jerk * jerk**2
