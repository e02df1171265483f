"""The two phases in the hand: carry (the object sticks) and opening (sliding pivot)."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ..models.contact import HandMotion, pivot_wrench
from ..models.integrate import rk4_step
from .context import JERK_UNIT, Context
from .ocp import Stage

#: Rounding [m] of the corner between two ways of being clear of an obstacle.
CORNER = 0.005


def carry_interval(context: Context, k: int, stage: Stage, following: Stage) -> None:
    """Carry interval k: hand states only; the full grip holds the object all along."""
    s = context.structure
    duration = stage.states["T"]
    dt = duration / s.carry
    context.gap(stage, following, dt, {"T": duration})
    stage.cost = _effort(context, stage, dt)
    if k == 0:
        stage.cost += context.parameters("weights", 3)[2] * duration
    _velocity_between_nodes(context, stage, dt)
    _position_between_nodes(context, stage, dt)
    # With continuous acceleration an interval's start is the last one's end.
    for fraction in [0.5, 1.0] if s.jerk_control and k > 0 else [0.0, 0.5, 1.0]:
        _held(context, stage, fraction * dt)


def opening_interval(context: Context, k: int, stage: Stage, following: Stage) -> None:
    """Opening interval k: the relative states by Runge-Kutta on the smoothed law.

    The hand is needed at 2 * substeps + 1 instants only, which the stages share; so is
    the grip force, a parameter per instant.
    """
    s = context.structure
    dt = context.parameters("opening_time") / s.opening
    instants = 2 * s.substeps
    grips = context.parameters("grip_force", instants * s.opening + 1)
    hands = []
    for i in range(instants + 1):
        pose, _, motion = context.hand(*context.inside(stage, dt * i / instants))
        hands.append(motion)
        if i == 0 and k == 0 and not s.jerk_control:
            # The acceleration may step here: the full grip must bear the new one too.
            _held(context, stage, ca.SX(0))
        elif i == 0:
            _off_obstacles(context, stage, pose)
    state = relative_state(context, stage)
    for i in range(0, instants, 2):
        forces = [grips[instants * k + i + j] for j in range(3)]
        state = rk4_step(_rates(context), state, hands[i : i + 3], forces, dt / s.substeps)
    context.gap(stage, following, dt, {"rel": ca.vertcat(*state)})
    stage.cost = _effort(context, stage, dt)
    _velocity_between_nodes(context, stage, dt)
    if not s.jerk_control:
        _position_between_nodes(context, stage, dt)


def relative_state(context: Context, stage: Stage) -> list[ca.SX]:
    """The relative states at the stage's node; sticking at the opening's start."""
    if "rel" in stage.states:
        return list(ca.vertsplit(stage.states["rel"]))
    zero = ca.SX(0)
    if context.structure.pivot:
        return [zero, zero, context.grasp_angle, zero, zero, zero]
    return [zero] * 4


def full_state(context: Context, state: list[ca.SX]) -> list[ca.SX]:
    """All six relative states: without the pivot the object keeps its grasp angle."""
    if context.structure.pivot:
        return state
    return [state[0], state[1], context.grasp_angle, state[2], state[3], ca.SX(0)]


def _rates(context: Context) -> Any:
    """Sliding-pivot rates; without the pivot only those of the slip."""
    if context.structure.pivot:
        return context.release.rates

    def slip_rates(state: Any, hand: HandMotion, grip: ca.SX) -> list[ca.SX]:
        rates = context.release.rates(full_state(context, list(state)), hand, grip)
        return [rates[0], rates[1], rates[3], rates[4]]

    return slip_rates


def _effort(context: Context, stage: Stage, dt: ca.SX) -> ca.SX:
    """Integral of the squared relative acceleration, and of a little jerk."""
    weights, most = context.parameters("weights", 3), context.each("ddq_max")
    first = context.inside(stage, ca.SX(0))[2] / most
    last = context.inside(stage, dt)[2] / most
    # Exact for an acceleration that is linear in time.
    cost = weights[0] * ca.sum1(first**2 + first * last + last**2) / 3
    if context.structure.jerk_control:
        jerk = JERK_UNIT * stage.controls["c"] / context.each("jerk_max")
        cost += weights[1] * ca.sumsqr(jerk)
    return dt * cost


def _velocity_between_nodes(context: Context, stage: Stage, dt: ca.SX) -> None:
    """Velocity inside its limits all along an interval of constant jerk.

    The middle control point of the parabola's Bezier form bounds it; the end points
    are nodes. For constant acceleration the nodes are enough.
    """
    if context.structure.jerk_control:
        _, dq, ddq = context.node(stage)
        context.limit(stage, "velocity", (dq + ddq * dt / 2) / context.each("dq_max"))


def _position_between_nodes(context: Context, stage: Stage, dt: ca.SX) -> None:
    """Position inside its limits all along an interval: inner Bezier control points.

    In an arm's opening intervals, some ms long, the position margin covers the difference.
    """
    q, dq, _ = context.node(stage)
    jerk_control = context.structure.jerk_control
    context.inside_positions(stage, "position", q + dq * dt / (3 if jerk_control else 2))
    if jerk_control:
        end, rate, _ = context.inside(stage, dt)
        context.inside_positions(stage, "position", end - rate * dt / 3)


def _held(context: Context, stage: Stage, t: ca.SX) -> None:
    """At time t of the interval the full grip holds the object, clear of obstacles."""
    pose, _, motion = context.hand(*context.inside(stage, t))
    theta, h, p = pose[2] + context.grasp_angle, context.body.com_offset, context.parameters
    wrench = pivot_wrench(
        context.body, context.gravity, motion, motion.omega, h * ca.cos(theta), h * ca.sin(theta)
    )
    use = context.contact.utilisation_squared(*wrench, p("full_grip"))
    stage.row("grip while carrying", use / p("sticking_limit") ** 2, -np.inf, 1.0)
    _off_obstacles(context, stage, pose)


def _off_obstacles(context: Context, stage: Stage, pose: ca.SX) -> None:
    """The held bar's far end clear of floor and base column, where the scene has them."""
    s, p = context.structure, context.parameters
    if not (s.floor or s.column):
        return
    theta = pose[2] + context.grasp_angle
    reach, half_width = context.body.com_offset + p("ahead"), p("half_width")
    tip_x, tip_z = pose[0] + reach * ca.cos(theta), pose[1] + reach * ca.sin(theta)
    if s.floor:
        stage.row("floor", tip_z - half_width - p("floor"), 0.0, np.inf)
    if s.column:
        # Above the column or beside it.
        over = tip_z - half_width - p("column_height")
        beside = tip_x - half_width - p("column_radius")
        stage.row("base column", soft_max(over, beside), 0.0, np.inf)


def soft_max(a: ca.SX, b: ca.SX) -> ca.SX:
    """max(a, b) rounded from below: it never claims room that is not there."""
    return 0.5 * (a + b + ca.sqrt((a - b) ** 2 + CORNER**2) - CORNER)
