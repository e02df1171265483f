"""Floor, base column and hand: room for the held bar, the arm, and the bar in flight."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from ...models import FlightState
from .assembly import Stage
from .context import Context

#: Rounding [m] of the corner between two ways of being clear of an obstacle.
CORNER = 0.002


def held_clear(
    context: Context, stage: Stage, q: ca.SX, pose: list[ca.SX], *, given: bool = False
) -> None:
    """The held bar's far end clear of floor and base column, where the scene has them.

    q, pose: the coordinates and the hand's pose with them; given: by the scene, so that no more
    room than usual is asked. With the guard "carry" arm and hand are clear of the floor too.
    """
    s, p = context.structure, context.parameters
    if not (s.floor or s.column):
        return
    room = ca.SX(0) if given else p("held_room")
    theta = pose[2] + context.grasp_angle
    reach, half_width = context.body.com_offset + p("ahead"), p("half_width")
    cos, sin = ca.cos(theta), ca.sin(theta)
    tip_x, tip_z = pose[0] + reach * cos, pose[1] + reach * sin
    if s.floor:
        stage.row("floor", tip_z - half_width - p("floor") - room, 0.0, np.inf)
        if s.arm:
            _arm_above_floor(context, stage, q, pose, room)
    if s.column:
        beside = _off_column(context, tip_x, tip_z, cos, sin)
        stage.row("base column", beside - room, 0.0, np.inf)


def flight_clear(context: Context, stage: Stage, flight: FlightState) -> None:
    """The flying bar clear of hand and base column, where the scene asks for it."""
    for i in range(context.structure.palm):
        # A bar that has just been let go meets the hand with an end.
        points = [context.parameters("ahead"), -context.parameters("behind")]
        time = context.parameters("palm_times", context.structure.palm)[i]
        _off_hand(context, stage, flight, time, points)
    for i in range(context.structure.later):
        first = context.parameters("later_first")
        share = (i + 1) / context.structure.later
        time = first + share * (stage.controls["t_f"] - first)
        _off_hand(context, stage, flight, time, _along(context))
    if context.structure.passing:
        _past_column(context, stage, flight)


def _arm_above_floor(
    context: Context, stage: Stage, q: ca.SX, pose: list[ca.SX], room: ca.SX
) -> None:
    """Joint frames, the hand and its body not below the floor."""
    p, floor = context.parameters, context.parameters("floor") + room
    heights = context.heights(q)
    if context.structure.hand:
        cos, sin = ca.cos(pose[2]), ca.sin(pose[2])
        across = p("body_half_width") * ca.sqrt(cos**2 + 1e-6)
        heights += [pose[1] - p(name) * sin - across for name in ("body_back", "body_front")]
    for z in [*heights, pose[1]]:
        stage.row("floor", z - floor, 0.0, np.inf)


def _along(context: Context) -> list[ca.SX]:
    """Points of the bar's axis [m] from the CoM: its ends, and between them."""
    p = context.parameters
    return [p("ahead"), p("ahead") / 2, ca.SX(0), -p("behind") / 2, -p("behind")]


def _off_hand(
    context: Context, stage: Stage, flight: FlightState, time: ca.SX, points: Sequence[ca.SX]
) -> None:
    """Points of the flying bar clear of the hand's body at `time` after detach.

    Every coordinate brakes at the acceleration counted on. Seen from the hand a point is in
    front of the body, behind it or beside it.
    """
    p, braking = context.parameters, context.each("braking")
    q, dq, _ = context.node(stage)
    stop_time = ca.sqrt(dq**2 + 1e-6) / braking
    moving = ca.fmin(time / stop_time, 1.0)
    there = q + dq * stop_time * (moving - moving**2 / 2)
    still = ca.SX.zeros(context.n)
    pose, _, _ = context.hand(stage, there, still, still)
    cos_hand, sin_hand = ca.cos(pose[2]), ca.sin(pose[2])
    at = flight.after(time, context.gravity)
    for along in points:
        dx = at.x + along * ca.cos(at.theta) - pose[0]
        dz = at.z + along * ca.sin(at.theta) - pose[1]
        ahead = cos_hand * dx + sin_hand * dz
        before = ca.fmax(ahead + p("palm_front"), -ahead - p("palm_back"))
        beside = ca.sqrt((cos_hand * dz - sin_hand * dx) ** 2 + 1e-8) - p("palm_half_width")
        stage.row("palm", _soft_max(before, beside), 0.0, np.inf)


def _past_column(context: Context, stage: Stage, flight: FlightState) -> None:
    """Points of the flying bar clear of the base column, from detach to landing."""
    p = context.parameters
    count = context.structure.passing
    for i in range(count):
        # The landing pose itself is given: no room there, or targets beside the column are lost.
        share = min(1.0, (count - 1 - i) / 5)
        at = flight.after(stage.controls["t_f"] * (i / (count - 1)), context.gravity)
        for along in _along(context):
            theta = ca.SX(at.theta)
            cos, sin = ca.cos(theta), ca.sin(theta)
            x, z = at.x + along * cos, at.z + along * sin
            room = share * p("passing_room") - (1 - share) * p("column_room")
            stage.row("base column", _off_column(context, x, z, cos, sin) - room, 0.0, np.inf)


def _off_column(context: Context, x: ca.SX, z: ca.SX, cos: ca.SX, sin: ca.SX) -> ca.SX:
    """Room [m] of the bar at a point of its axis above the base column or to either side.

    cos, sin: of the bar's angle; its edges lie half its width across.
    """
    p = context.parameters
    over = z - p("half_width") * ca.sqrt(cos**2 + 1e-6) - p("column_height")
    beside = ca.sqrt(x**2 + 1e-8) - p("half_width") * ca.sqrt(sin**2 + 1e-6)
    beside = beside - p("column_radius")
    return _soft_max(over, beside)


def _soft_max(a: ca.SX, b: ca.SX) -> ca.SX:
    """max(a, b) rounded from below: it never claims room that is not there."""
    return 0.5 * (a + b + ca.sqrt((a - b) ** 2 + CORNER**2) - CORNER)
