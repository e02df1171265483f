"""The phases that every throw has: carry, opening, detach and flight, and the brake to rest.

While carrying the object sticks. In the opening the smoothed law of the sliding pivot moves it,
by collocation or by Runge-Kutta steps: two-point Gauss collocation (order 4, A-stable) takes the
accelerations at its points as unknowns: two evaluations of the friction law an interval, each a
row of its own, and a next state that is linear in the unknowns. Classical Runge-Kutta needs
eight for the same accuracy, nested in one another, and has a stability limit in step / epsilon.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array, FlightState, HandMotion, rk4_step
from ...problems import Mesh
from .context import Context, Hand, Instant
from .layout import ACC, DQ, FAR, JERK_UNIT, REL, SHORT, T_F, T
from .stages import Stage

#: Two-point Gauss method: nodes, coefficients, weights; its coefficients applied twice
#: integrate accelerations to positions.
NODES = (0.5 - math.sqrt(3) / 6, 0.5 + math.sqrt(3) / 6)
_RATE = ((0.25, 0.25 - math.sqrt(3) / 6), (0.25 + math.sqrt(3) / 6, 0.25))
_PLACE = tuple(
    tuple(sum(_RATE[i][k] * _RATE[k][j] for k in range(2)) for j in range(2)) for i in range(2)
)
_END = tuple(sum(0.5 * _RATE[k][j] for k in range(2)) for j in range(2))
#: Units of the unknown accelerations: slip [m/s^2], rotation [rad/s^2].
SLIP_UNIT, TURN_UNIT = 10.0, 100.0


def add_interval(context: Context, k: int, stage: Stage, following: Stage) -> None:
    """Adds what holds in the interval after stage k.

    While carrying and waiting for the opening there are hand states only: the full grip holds the
    object all along. In the opening the relative states come in; after detach the hand is empty.
    """
    s = context.structure
    carrying, opening = k < s.carry, s.opens <= k < s.detach
    dt = stage.states[T] / s.carry if carrying else context.length(k, stage)
    ends = {T: stage.states[T]} if T in stage.states else {}
    if opening:
        ends[REL] = _open(context, k, stage, dt)
    context.close(stage, following, dt, ends)
    _add_effort(context, stage, dt)
    if k == 0:
        stage.cost += context.parameters("weights", 3)[2] * stage.states[T]
    _limit_velocity(context, stage, dt)
    if not (opening and s.jerk_control):
        _limit_position(context, stage, dt)
    if k < s.opens:
        _hold(context, k, stage, dt)
    elif not opening:
        _constrain(context.instant(stage, ca.SX(0), "none"))
    for term in s.terms:
        term.in_interval(context, k, stage, dt)
        if k >= s.carry:
            term.in_window(context, k, stage, following)


def _open(context: Context, k: int, stage: Stage, dt: ca.SX) -> ca.SX:
    """The relative states at the end of an opening interval, by the smoothed law."""
    s = context.structure
    start = context.instant(stage, ca.SX(0), "opening")
    if k == s.opens and not s.jerk_control:
        # The acceleration may step here: the full grip must bear the new one too.
        _stick(start)
    _constrain(start)
    integrate = gauss_interval if s.integrator == "gauss" else _runge_kutta_interval
    return integrate(context, stage, dt)


def _hold(context: Context, k: int, stage: Stage, dt: ca.SX) -> None:
    """At instants of the interval the full grip holds the object without slip."""
    s = context.structure
    parts = s.instants if k < s.carry else 1
    # With continuous acceleration an interval's start is the last one's end.
    known = k not in (0, s.carry) and (s.jerk_control or k > s.carry)
    if k == 0 and not s.free_start:
        _bear(context.instant(stage, ca.SX(0), "full", given=True))
        known = True
    rows, (share,) = stage.at_instants(np.arange(known, parts + 1) / parts)
    _bear(Instant(context, rows, *context.inside(stage, share * dt), "full", given=False))


def _bear(at: Instant) -> None:
    _stick(at)
    _constrain(at)


def _constrain(at: Instant) -> None:
    for term in at.context.structure.terms:
        term.at_instant(at)


def _stick(at: Instant) -> None:
    """The full grip bears the load."""
    p = at.context.parameters
    use = at.context.contact.utilisation_squared(*at.load, p("full_grip"))
    at.stage.row("grip while carrying", use / p("sticking_limit") ** 2, -np.inf, 1.0)


def _add_effort(context: Context, stage: Stage, dt: ca.SX) -> None:
    """Integral of the squared relative acceleration, and of a small share of jerk."""
    weights, most = context.parameters("weights", 3), context.each("ddq_max")
    first = context.inside(stage, ca.SX(0))[2] / most
    last = context.inside(stage, dt)[2] / most
    jerk = None
    if context.structure.jerk_control:
        jerk = JERK_UNIT * stage.controls[context.control] / context.each("jerk_max")
    stage.cost += dt * interval_effort(first, last, jerk, weights, ca.sum1)


def interval_effort(
    first: Any, last: Any, jerk: Any, weights: Any, total: Callable[[Any], Any]
) -> Any:
    """The same per second, for symbols and numbers; exact where the acceleration goes evenly from
    `first` to `last` and `jerk` (None: not counted) is constant; total: sum over coordinates."""
    cost = weights[0] * total(first**2 + first * last + last**2) / 3
    return cost if jerk is None else cost + weights[1] * total(jerk**2)


def _limit_velocity(context: Context, stage: Stage, dt: ca.SX) -> None:
    """Velocity inside its limits all along an interval of constant jerk.

    The middle control point of the parabola's Bezier form bounds it; the end points
    are nodes. For constant acceleration the nodes are enough. Limits that depend on the
    position hold at the nodes; the velocity margin covers what lies between.
    """
    q, dq, ddq = context.node(stage)
    if DQ in stage.states:
        for term in context.structure.terms:
            term.at_rate(context, stage, q, dq)
    if context.structure.jerk_control:
        context.limit(stage, "velocity", (dq + ddq * dt / 2) / context.each("dq_max"))


def _limit_position(context: Context, stage: Stage, dt: ca.SX) -> None:
    """Position inside its limits all along an interval: inner Bezier control points.

    In an arm's opening intervals, some ms long, the position margin covers the difference.
    """
    q, dq, _ = context.node(stage)
    jerk_control = context.structure.jerk_control
    context.inside_positions(stage, "position", q + dq * dt / (3 if jerk_control else 2))
    if jerk_control:
        end, rate, _ = context.inside(stage, dt)
        context.inside_positions(stage, "position", end - rate * dt / 3)


def gauss_interval(context: Context, stage: Stage, dt: ca.SX, opening: int = 0) -> ca.SX:
    """The relative states at the interval's end by collocation at two points.

    opening: 0 is the planned one, others are those of scenarios.
    """
    grips = context.datum(stage, grip_force(opening), 2, window=opening > 0)
    state = relative_state(context, stage, opening)
    place, rate = state[: len(state) // 2], state[len(state) // 2 :]
    units = [SLIP_UNIT, SLIP_UNIT, TURN_UNIT][: len(place)]
    unknown = stage.control(ACC.number(opening), 2 * len(place))
    points = [unknown[: len(place)], unknown[len(place) :]]
    accelerations = [[u * a for u, a in zip(units, ca.vertsplit(p), strict=True)] for p in points]

    def moved(i: int, share: float, row: tuple[float, ...]) -> ca.SX:
        return share * dt * rate[i] + dt**2 * sum(
            weight * a[i] for weight, a in zip(row, accelerations, strict=True)
        )

    def gained(i: int, row: tuple[float, ...]) -> ca.SX:
        return dt * sum(weight * a[i] for weight, a in zip(row, accelerations, strict=True))

    for k, node in enumerate(NODES):
        at = [p + moved(i, node, _PLACE[k]) for i, p in enumerate(place)]
        speed = [r + gained(i, _RATE[k]) for i, r in enumerate(rate)]
        _, _, hand = context.hand(stage, *context.inside(stage, node * dt))
        law = _accelerations(context, stage, [*at, *speed], hand, grips[k])
        for unit, variable, value in zip(units, ca.vertsplit(points[k]), law, strict=True):
            stage.row("sliding pivot", variable - value / unit, 0.0, 0.0)
    end = [p + moved(i, 1.0, _END) for i, p in enumerate(place)]
    return ca.vertcat(*end, *[r + gained(i, (0.5, 0.5)) for i, r in enumerate(rate)])


def grip_force(opening: int) -> str:
    """Name of the parameter with the grip force of an opening."""
    return f"grip_force {opening}"


def grip_instants(mesh: Mesh, nodes: Array) -> Array:
    """Times (intervals, k) at which the integrator needs the grip force."""
    shares = np.array(NODES)
    if mesh.integrator == "rk4":
        shares = np.linspace(0.0, 1.0, 2 * mesh.substeps + 1)
    return np.asarray(nodes[:-1, None] + np.diff(nodes)[:, None] * shares)


def _runge_kutta_interval(context: Context, stage: Stage, dt: ca.SX) -> ca.SX:
    """The same by `substeps` classical Runge-Kutta steps.

    The hand is needed at 2 * substeps + 1 instants only, which the stages share.
    """
    substeps = context.structure.substeps
    grips = ca.vertsplit(context.datum(stage, grip_force(0), 2 * substeps + 1))
    hands = [
        context.hand(stage, *context.inside(stage, dt * i / (2 * substeps)))[2]
        for i in range(2 * substeps + 1)
    ]

    def rates(state: list[ca.SX], hand: HandMotion, grip: ca.SX) -> list[ca.SX]:
        half = len(state) // 2
        return [*state[half:], *stage.lift(*_accelerations(context, stage, state, hand, grip))]

    state = relative_state(context, stage)
    for i in range(0, 2 * substeps, 2):
        state = rk4_step(rates, state, hands[i : i + 3], grips[i : i + 3], dt / substeps)
    return ca.vertcat(*state)


def _accelerations(
    context: Context, stage: Stage, state: list[ca.SX], hand: HandMotion, grip: ca.SX
) -> list[ca.SX]:
    """Relative accelerations: slip, and rotation where the scene has it.

    The law depends on seven numbers: the slip, the body's angle and rate, and the
    hand's acceleration. They are lifted.
    """
    x, z, turn, _, _, spin = _full_state(context, state)
    x, z, theta, omega, *acceleration = stage.lift(
        x, z, hand.theta + turn, hand.omega + spin, hand.a_x, hand.a_z, hand.alpha
    )
    zero = ca.SX(0)
    motion = HandMotion(theta, omega, *acceleration)
    found = context.release.rates([x, z, zero, zero, zero, zero], motion, grip)[3:]
    return found if context.structure.pivot else found[:2]


def relative_state(context: Context, stage: Stage, opening: int = 0) -> list[ca.SX]:
    """The relative states at the stage's node; sticking at the opening's start."""
    block = REL.number(opening)
    if block in stage.states:
        return list(ca.vertsplit(stage.states[block]))
    zero = ca.SX(0)
    if context.structure.pivot:
        return [zero, zero, context.grasp_angle, zero, zero, zero]
    return [zero] * 4


def _full_state(context: Context, state: list[ca.SX]) -> list[ca.SX]:
    """All six relative states: without the pivot the object keeps its grasp angle."""
    if context.structure.pivot:
        return state
    return [state[0], state[1], context.grasp_angle, state[2], state[3], ca.SX(0)]


def let_go(context: Context, stage: Stage, hand: Hand, opening: int = 0) -> FlightState:
    """CoM pose and twist in the world at the stage's node, nothing held any more."""
    pose, twist, motion = hand
    state = _full_state(context, relative_state(context, stage, opening))
    return FlightState(*stage.lift(*context.release.com_state(state, pose, twist, motion)))


def land(context: Context, stage: Stage, flight: FlightState, opening: int = 0) -> FlightState:
    """The flight's end after an unknown time: down through the target's height."""
    end = flight.after(stage.control(T_F.number(opening)), context.gravity)
    stage.row("landing z", end.z - context.parameters("target_z"), 0.0, 0.0)
    stage.row("coming down", end.v_z, -np.inf, 0.0)
    return end


def add_flight(context: Context, stage: Stage) -> ca.SX:
    """Adds the flight from the stage of detach; returns the landing (x, z, theta).

    The CoM lands at the target's x, with its theta if that is fixed.
    """
    s, p = context.structure, context.parameters
    flight = let_go(context, stage, context.hand(stage, *context.node(stage)))
    end = land(context, stage, flight)
    for i, name in enumerate(("x", "theta") if s.angle else ("x",)):
        miss = getattr(end, name) - p(f"target_{name}")
        if s.elastic:
            short, far = stage.control(SHORT.number(i)), stage.control(FAR.number(i))
            stage.cost += p(f"price_{name}") * (short + far)
            miss = miss + short - far
        stage.row(f"landing {name}", miss, 0.0, 0.0)
    for term in s.terms:
        term.in_flight(context, stage, flight, end, stage.controls[T_F])
    return ca.SX(ca.vertcat(end.x, end.z, end.theta))


def add_brake(context: Context, stage: Stage) -> None:
    """Adds to the last stage: rest within the position limits, no velocity overshoot before."""
    s, (q, dq, ddq) = context.structure, context.node(stage)
    braking = context.each("braking")
    place, rate, peak = q, dq, dq
    if s.jerk_control:
        # First the jerk limit turns the acceleration into full braking, against the rate.
        jerk, ahead = context.each("jerk_max"), dq / ca.sqrt(dq**2 + 1e-2)
        turning = (braking + ahead * ddq) / jerk
        place = q + turning * (dq + turning * (ddq / 2 - turning * ahead * jerk / 6))
        rate = dq + turning * (ddq - turning * ahead * jerk / 2)
        # Meanwhile the rate goes on growing.
        peak = dq + ddq * ca.sqrt(ddq**2 + 1e-2) / (2 * jerk)
    stop = place + rate * ca.sqrt(rate**2 + 1e-4) / (2 * braking)
    context.inside_positions(stage, "room to brake", stop)
    if s.jerk_control:
        context.limit(stage, "velocity", peak / context.each("dq_max"))
    for term in s.terms:
        term.at_rate(context, stage, place, peak)
        term.at_last(context, stage, place, rate)
