"""What a robust plan asks of the hand over the window in which the gripper may open.

The quiet release: while the pads may open, the hand follows the held object's own free
flight, so that they transmit nothing; then neither delay nor opening time nor friction
moves the landing. b is the held object's acceleration at its CoM less gravity's, and
alpha its angular acceleration; quiet is b = 0, alpha = 0.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from ...models import HandMotion
from .assembly import Stage
from .context import Context
from .integration import NODES


def interval_length(context: Context, k: int, stage: Stage) -> ca.SX:
    """Length [s] of the interval after stage k of the window."""
    s = context.structure
    if s.opens <= k < s.detach:
        return context.datum(stage, "interval")
    return context.window_step()


def loads(context: Context, k: int, stage: Stage) -> list[list[ca.SX]]:
    """(b_x, b_z, arm * alpha) [m/s^2] at two points of the interval after stage k."""
    dt = interval_length(context, k, stage)
    arm, h = context.parameters("quiet_arm"), context.body.com_offset
    found = []
    for node in NODES:
        pose, _, hand = context.hand(stage, *context.inside(stage, node * dt))
        theta = pose[2] + context.grasp_angle
        x_r, z_r = h * ca.cos(theta), h * ca.sin(theta)
        b_x = hand.a_x - hand.alpha * z_r - hand.omega**2 * x_r
        b_z = hand.a_z + hand.alpha * x_r - hand.omega**2 * z_r + context.gravity
        found.append(stage.lift(b_x, b_z, arm * hand.alpha))
    return found


def _quiet_penalty(context: Context, k: int, stage: Stage) -> None:
    """A price on the mean square of the load over the window."""
    share = interval_length(context, k, stage) / context.parameters("window")
    weight = context.parameters("quiet_weight")
    for load in loads(context, k, stage):
        stage.cost += weight * share / 2 * sum(value**2 for value in load)


def _quiet_rows(context: Context, k: int, stage: Stage) -> None:
    """No load at all, within a hair."""
    hair = context.parameters("quiet_hair")
    for load in loads(context, k, stage):
        for value in load:
            stage.row("quiet release", value / hair, -1.0, 1.0)


def _constant_hand(context: Context, k: int, stage: Stage) -> None:
    """The hand moves and turns at constant velocity."""
    dt = interval_length(context, k, stage)
    arm, hair = context.parameters("quiet_arm"), context.parameters("quiet_hair")
    for node in NODES:
        hand = context.hand(stage, *context.inside(stage, node * dt))[2]
        for value in stage.lift(*_accelerations(hand, arm)):
            stage.row("constant hand velocity", value / hair, -1.0, 1.0)


def _accelerations(hand: HandMotion, arm: ca.SX) -> list[ca.SX]:
    return [hand.a_x, hand.a_z, arm * hand.alpha]


def _constant_joints(context: Context, k: int, stage: Stage) -> None:
    """The coordinates move at constant rates."""
    dt = interval_length(context, k, stage)
    for share in (0.0, 1.0):
        acceleration = context.inside(stage, share * dt)[2]
        stage.row("constant joint velocity", acceleration, -1e-3, 1e-3)


def _steady(context: Context, k: int, stage: Stage) -> None:
    """The coordinates keep one acceleration."""
    if context.structure.jerk_control:
        stage.row("constant acceleration", stage.controls["c"], -1e-4, 1e-4)


#: What is asked in each interval of the window, by method.
ROBUST: dict[str, Callable[[Context, int, Stage], None]] = {
    "quiet": _quiet_penalty,
    "quiet-exactly": _quiet_rows,
    "stationary": _steady,
    "hand-velocity": _constant_hand,
    "joint-velocity": _constant_joints,
}
