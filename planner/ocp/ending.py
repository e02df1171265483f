"""The last stage: detach, flight, landing, room to brake, and the way into the cup."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...models import FlightState
from .assembly import Stage
from .clearance import flight_clear
from .context import Context
from .integration import full_state, relative_state

#: For so long [s] after its stop a joint counts as braking, more or less.
STILL = 0.01


def detached(context: Context, stage: Stage) -> list[ca.SX]:
    """Adds the flight time and what is asked of the flight; returns the landing (x, z, theta)."""
    flight = _detach(context, stage)
    land = flight.after(stage.control("t_f"), context.gravity)
    _landing(context, stage, land)
    if context.structure.cup:
        _cup(context, stage, flight, land)
    flight_clear(context, stage, flight)
    _landing_bounds(context, stage, land)
    return [land.x, land.z, land.theta]


def _detach(context: Context, stage: Stage) -> FlightState:
    """CoM pose and twist in the world at detach."""
    pose, twist, motion = context.hand(stage, *context.node(stage))
    state = full_state(context, relative_state(context, stage))
    return FlightState(*stage.lift(*context.release.com_state(state, pose, twist, motion)))


def _landing(context: Context, stage: Stage, land: FlightState) -> None:
    """The CoM comes down through the target's height at x, with theta if asked."""
    s, p = context.structure, context.parameters
    stage.row("landing z", land.z - p("target_z"), 0.0, 0.0)
    stage.row("coming down", land.v_z, -np.inf, 0.0)
    for name in ("x", "theta") if s.angle else ("x",):
        miss = getattr(land, name) - p(f"target_{name}")
        if s.elastic:
            short, far = stage.control(f"{name}_short"), stage.control(f"{name}_far")
            stage.cost += p(f"price_{name}") * (short + far)
            miss = miss + short - far
        stage.row(f"landing {name}", miss, 0.0, 0.0)


def at_rest(context: Context, stage: Stage) -> None:
    """Rest within the position limits, and no velocity overshoot on the way there."""
    q, dq, ddq = context.node(stage)
    braking = context.each("braking")
    place, rate = q, dq
    if context.structure.jerk_control:
        # First the jerk limit turns the acceleration into full braking, against the rate.
        jerk, ahead = context.each("jerk_max"), dq / ca.sqrt(dq**2 + 1e-2)
        turning = (braking + ahead * ddq) / jerk
        place = q + turning * (dq + turning * (ddq / 2 - turning * ahead * jerk / 6))
        rate = dq + turning * (ddq - turning * ahead * jerk / 2)
    stop = place + rate * ca.sqrt(rate**2 + 1e-4) / (2 * braking)
    context.inside_positions(stage, "room to brake", stop)
    if context.structure.jerk_control:
        # While the jerk limit turns the acceleration round, the rate goes on growing.
        peak = dq + ddq * ca.sqrt(ddq**2 + 1e-2) / (2 * context.each("jerk_max"))
        context.limit(stage, "velocity", peak / context.each("dq_max"))
        context.limit_slowing(stage, place, peak)
    else:
        context.limit_slowing(stage, q, dq)
    if context.structure.torque:
        context.limit_torque(stage, q, dq, ddq)
        _brake_torque(context, stage, place, rate)


def _brake_torque(context: Context, stage: Stage, q: ca.SX, dq: ca.SX) -> None:
    """Torques of the brake with an empty hand: as it begins, and as each joint comes to rest.

    Every joint brakes by itself; those that have stopped no longer do.
    """
    braking = context.each("braking")
    against = -braking * dq / ca.sqrt(dq**2 + 1e-4)
    context.limit_torque(stage, q, dq, against)
    stops = ca.sqrt(dq**2 + 1e-6) / braking
    for i in range(context.n):
        left = stops - stops[i]
        going = (1 + (left + STILL) / ca.sqrt((left + STILL) ** 2 + STILL**2 / 4)) / 2
        share = ca.fmin(stops[i] / stops, 1.0)
        there = q + dq * stops * (share - share**2 / 2)
        context.limit_torque(stage, there, dq * (1 - share), going * against)


def _cup(context: Context, stage: Stage, flight: FlightState, land: FlightState) -> None:
    """The bar's outline inside the opening at several depths of its lower end.

    First its lowest corner passes the rim, at one unknown time, clear of the wall. Then, per
    depth, one unknown time at which the middle of the lower end is that far below
    the rim; the end's corners keep the clearance to the wall, and the long edges
    keep it to the rim. `lower_end` is that end's distance from the CoM along the
    axis, negative for the grasped end. The cup goes with the target, so with a landing
    that may miss it goes with that.
    """
    p, depths = context.parameters, context.structure.cup
    radius, clearance, half_width = p("cup_radius"), p("cup_clearance"), p("half_width")
    cup_x = p("cup_x") + (land.x - p("target_x") if context.structure.elastic else 0)
    end = p("lower_end")
    at = flight.after(stage.control("t_rim"), context.gravity)
    cos, sin = ca.cos(at.theta), ca.sin(at.theta)
    across = half_width * cos / ca.sqrt(cos**2 + 1e-6)
    stage.row("cup depth", at.z + end * sin - across * cos - p("cup_rim"), 0.0, 0.0)
    corner = at.x + end * cos + across * sin - cup_x
    stage.row("cup clearance", corner / (radius - clearance), -1.0, 1.0)
    for i in range(depths):
        at = flight.after(stage.control(f"t_cup{i}"), context.gravity)
        cos, sin = ca.cos(at.theta), ca.sin(at.theta)
        depth = p("cup_insertion") * i / max(depths - 1, 1)
        stage.row("cup depth", at.z + end * sin - (p("cup_rim") - depth), 0.0, 0.0)
        for side in (-1, 1):
            corner = at.x + end * cos - side * half_width * sin - cup_x
            stage.row("cup clearance", corner / (radius - clearance), -1.0, 1.0)
        # The rim's two edges lie to either side of the bar's axis: signed distances.
        offset = (at.x - cup_x) * sin + (p("cup_rim") - at.z) * cos
        room = radius * ca.sqrt(sin**2 + 1e-9) - half_width - clearance
        stage.row("cup clearance", (offset - room) / radius, -np.inf, 0.0)
        stage.row("cup clearance", (offset + room) / radius, 0.0, np.inf)


def _landing_bounds(context: Context, stage: Stage, land: FlightState) -> None:
    """Speed and turning rate at landing, as far as the scene bounds them."""
    p, bounds = context.parameters, context.structure.landing
    speed2 = land.v_x**2 + land.v_z**2
    if "speed_min" in bounds:
        stage.row("landing speed", speed2 - p("speed_min") ** 2, 0.0, np.inf)
    if "speed_max" in bounds:
        stage.row("landing speed", speed2 - p("speed_max") ** 2, -np.inf, 0.0)
    if "rate_max" in bounds:
        stage.row("landing rate", land.omega / p("rate_max"), -1.0, 1.0)
