"""What a robust plan asks of the hand over the window in which the gripper may open.

The quiet release: while the pads may open, the hand follows the held object's own free
flight, so that they transmit nothing; then neither delay nor opening time nor friction
moves the landing. b is the held object's acceleration at its CoM less gravity's, and
alpha its angular acceleration; quiet is b = 0, alpha = 0.

Scenarios: other openings share one hand motion, early, late, slow ones, thrown in the NLP too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca

from ....problems import QUIET
from ..asked import Request
from ..context import Context, Term
from ..layout import REL, Block
from ..phases import NODES, gauss_interval, grip_force, grip_instants, land, let_go
from ..stages import Stage

#: Price of the mean square load (m/s^2)^2 over the window.
WEIGHT = 10.0
#: Acceleration [m/s^2] that counts as none.
NONE = 0.05
#: Price of the mean square scaled miss [1/m^2].
SCENARIO_WEIGHT = 1e4


@dataclass(frozen=True)
class Quiet(Term):
    """The method's demand in each interval of the window; the load is judged by sweeps."""

    method: str

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a robust request. Scenarios are quiet too, as far as that costs nothing."""
        if not request.robust:
            return None
        return cls(QUIET if request.robust == "scenarios" else request.robust)

    def numbers(self, request: Request) -> dict[str, Any]:
        """The window's lengths [s], and prices."""
        assert request.window is not None
        return {
            "window_step": request.window.step,
            "window": request.nodes[-1] - request.nodes[0],
            "quiet_arm": request.scene.object.length / 2,
            "quiet_weight": WEIGHT,
            "quiet_none": NONE,
        }

    def in_window(self, context: Context, k: int, stage: Stage, following: Stage) -> None:
        """The method's rows or price."""
        METHODS[self.method](context, stage, context.length(k, stage))


def _loads(context: Context, stage: Stage, dt: ca.SX) -> list[list[ca.SX]]:
    """(b_x, b_z, arm * alpha) [m/s^2] at two points of an interval."""
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


def _priced(context: Context, stage: Stage, dt: ca.SX) -> None:
    """A price on the mean square of the load over the window."""
    share = dt / context.parameters("window")
    weight = context.parameters("quiet_weight")
    for load in _loads(context, stage, dt):
        stage.cost += weight * share / 2 * sum(value**2 for value in load)


def _exact(context: Context, stage: Stage, dt: ca.SX) -> None:
    """No load at all."""
    for load in _loads(context, stage, dt):
        for value in load:
            stage.row("quiet release", value / context.parameters("quiet_none"), -1.0, 1.0)


def _constant_hand(context: Context, stage: Stage, dt: ca.SX) -> None:
    """The hand moves and turns at constant velocity."""
    arm, none = context.parameters("quiet_arm"), context.parameters("quiet_none")
    for node in NODES:
        hand = context.hand(stage, *context.inside(stage, node * dt))[2]
        for value in stage.lift(hand.a_x, hand.a_z, arm * hand.alpha):
            stage.row("constant hand velocity", value / none, -1.0, 1.0)


def _constant_joints(context: Context, stage: Stage, dt: ca.SX) -> None:
    """The coordinates move at constant rates."""
    for share in (0.0, 1.0):
        acceleration = context.inside(stage, share * dt)[2]
        stage.row("constant joint velocity", acceleration, -1e-3, 1e-3)


def _steady(context: Context, stage: Stage, dt: ca.SX) -> None:
    """The coordinates keep one acceleration."""
    if context.structure.jerk_control:
        stage.row("constant acceleration", stage.controls[context.control], -1e-4, 1e-4)


#: What is asked in each interval of the window.
METHODS: dict[str, Callable[[Context, Stage, ca.SX], None]] = {
    QUIET: _priced,
    "quiet-exactly": _exact,
    "stationary": _steady,
    "hand-velocity": _constant_hand,
    "joint-velocity": _constant_joints,
}


@dataclass(frozen=True)
class Scenarios(Term):
    """count: of the other openings. They have the numbers 1 to count, the planned one has 0."""

    count: int

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For the robust method of this name."""
        if request.robust != "scenarios" or request.window is None:
            return None
        return cls(len(request.window.delays))

    def numbers(self, request: Request) -> dict[str, Any]:
        """Each opening's grip force over the window."""
        assert request.window is not None
        profile = request.scene.gripper.profile()
        instants = grip_instants(request.scene.mesh, request.nodes).ravel()
        forces = {
            grip_force(number): profile.force(instants - delay)
            for number, delay in enumerate(request.window.delays, start=1)
        }
        return {"scenario_weight": SCENARIO_WEIGHT, **forces}

    def states(self, context: Context, k: int) -> dict[Block, int]:
        """The relative states from the window's start on."""
        if k <= context.structure.carry:
            return {}
        return {REL.number(i): context.rel_size for i in range(1, self.count + 1)}

    def in_window(self, context: Context, k: int, stage: Stage, following: Stage) -> None:
        """Each opening across the interval with its own grip force.

        Under full grip it sticks, without any it flies: the same law serves all along.
        """
        dt = context.length(k, stage)
        for i in range(1, self.count + 1):
            end = gauss_interval(context, stage, dt, i)
            context.close(stage, following, dt, {REL.number(i): end})

    def at_last(self, context: Context, stage: Stage, place: ca.SX, rate: ca.SX) -> None:
        """Each opening's landing, and the price of missing the target."""
        p, hand = context.parameters, context.hand(stage, *context.node(stage))
        for i in range(1, self.count + 1):
            end = land(context, stage, let_go(context, stage, hand, i), i)
            miss = (end.x - p("target_x")) ** 2
            if context.structure.angle:
                miss += (p("quiet_arm") * (end.theta - p("target_theta"))) ** 2
            stage.cost += p("scenario_weight") * miss / self.count
