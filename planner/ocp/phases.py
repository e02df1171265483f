"""The two phases in the hand: carry (the object sticks) and opening (sliding pivot)."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...models import HandMotion, pivot_wrench
from .assembly import Stage
from .clearance import held_clear
from .context import JERK_UNIT, Context
from .integration import gauss_interval, runge_kutta_interval


def carry_interval(context: Context, first: bool, stage: Stage, following: Stage) -> None:
    """A carry interval: hand states only; the full grip holds the object all along."""
    s = context.structure
    duration = stage.states["T"]
    dt = duration / s.carry
    context.close(stage, following, dt, {"T": duration})
    stage.cost = _effort(context, stage, dt)
    if first:
        stage.cost += context.parameters("weights", 3)[2] * duration
    _velocity_between_nodes(context, stage, dt)
    _position_between_nodes(context, stage, dt)
    # With continuous acceleration an interval's start is the last one's end.
    for i in range(s.jerk_control and not first, s.instants + 1):
        _held(context, stage, i / s.instants * dt, given=first and i == 0 and not s.free_start)


def waiting_interval(context: Context, first: bool, stage: Stage, following: Stage) -> None:
    """An interval of fixed length before the opening: hand only, held, like a carry's."""
    dt = context.window_step()
    context.close(stage, following, dt, {})
    stage.cost = _effort(context, stage, dt)
    _velocity_between_nodes(context, stage, dt)
    _position_between_nodes(context, stage, dt)
    for fraction in [0.0, 1.0] if first else [1.0]:
        _held(context, stage, fraction * dt)


def leaving_interval(context: Context, stage: Stage, following: Stage) -> None:
    """An interval of fixed length after detach: hand only, empty."""
    dt = context.window_step()
    context.close(stage, following, dt, {})
    stage.cost = _effort(context, stage, dt)
    context.limit_torque(stage, *context.node(stage))
    _velocity_between_nodes(context, stage, dt)
    _position_between_nodes(context, stage, dt)


def opening_interval(context: Context, first: bool, stage: Stage, following: Stage) -> None:
    """An opening interval: the hand, and the relative states by the smoothed law."""
    s = context.structure
    dt = context.datum(stage, "interval")
    if first and not s.jerk_control:
        # The acceleration may step here: the full grip must bear the new one too.
        _held(context, stage, ca.SX(0))
    elif s.floor or s.column:
        q, dq, ddq = context.node(stage)
        pose, _, _ = context.hand(stage, q, dq, ddq)
        held_clear(context, stage, q, pose)
    _opening_torque(context, stage)
    integrate = gauss_interval if s.integrator == "gauss" else runge_kutta_interval
    end = integrate(context, stage, dt)
    context.close(stage, following, dt, {"rel": end})
    stage.cost = _effort(context, stage, dt)
    _velocity_between_nodes(context, stage, dt)
    if not s.jerk_control:
        _position_between_nodes(context, stage, dt)


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
    are nodes. For constant acceleration the nodes are enough. Limits that depend on the
    position are looked at at the nodes; the velocity margin covers what lies between.
    """
    q, dq, ddq = context.node(stage)
    if "dq" in stage.states:
        context.limit_slowing(stage, q, dq)
    if context.structure.jerk_control:
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


def _opening_torque(context: Context, stage: Stage) -> None:
    """While the pads open the hand may bear all of the object or nothing."""
    if not context.structure.torque:
        return
    coordinates = context.node(stage)
    pose, _, motion = context.hand(stage, *coordinates)
    context.limit_torque(stage, *coordinates, _held_wrench(context, pose, motion))
    context.limit_torque(stage, *coordinates)


def _held_wrench(
    context: Context, pose: list[ca.SX], motion: HandMotion
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Force and torque at the pads that keep the object in the hand."""
    theta, h = pose[2] + context.grasp_angle, context.body.com_offset
    x, z = h * ca.cos(theta), h * ca.sin(theta)
    return pivot_wrench(context.body, context.gravity, motion, motion.omega, x, z)


def _held(context: Context, stage: Stage, t: ca.SX, *, given: bool = False) -> None:
    """At time t of the interval the full grip holds the object, clear of obstacles.

    given: the pose is given by the scene.
    """
    q, dq, ddq = context.inside(stage, t)
    pose, _, motion = context.hand(stage, q, dq, ddq)
    wrench, p = _held_wrench(context, pose, motion), context.parameters
    context.limit_torque(stage, q, dq, ddq, wrench)
    use = context.contact.utilisation_squared(*wrench, p("full_grip"))
    stage.row("grip while carrying", use / p("sticking_limit") ** 2, -np.inf, 1.0)
    held_clear(context, stage, q, pose, given=given)
