"""Limits of an arm beyond those that every throw keeps: slowing velocity, tool speed, torques."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import casadi as ca

from ....models.robot import PlanarArm, PlanarDynamics, flange_velocity
from ....problems import Torque
from ...throw import torque_limits
from ..lazy_constraints import TOOL_SPEED
from ..request import Request
from ..scene_constraint import Brake, Instant, Load, SceneConstraint
from ..stages import Constraints
from ..transcription import Hand, Node, Ocp

#: Parameters of the slowing limits, see `models.Slowing`.
SLOWING = ("slowing", "slowing_offset", "slowing_upper", "slowing_lower")
#: Time [s] around its stop over which a joint's deceleration falls to zero, smoothly.
STOP_TIME = 0.01


@dataclass(frozen=True)
class SlowingLimits(SceneConstraint):
    """Velocity limits that fall towards the position limits, as of the FR3."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For an arm that has such limits."""
        return None if request.manipulator.planning.slowing is None else cls()

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """The limits' curves."""
        assert request.manipulator.planning.slowing is not None
        return dict(zip(SLOWING, request.manipulator.planning.slowing, strict=True))

    def at_rate(self, node: Node, q: ca.SX, dq: ca.SX) -> None:
        """dq + offset <= sqrt(2 a (upper - q)), squared with its sign.

        The squared form has no root of a negative number at an iterate. Its error is at most
        5e-5 (rad/s)^2, on the safe side.
        """
        twice, offset, upper, lower = (node.ocp.each(name) for name in SLOWING)
        unit = node.ocp.each("dq_max") ** 2
        for side, end in ((1, upper), (-1, lower)):
            speed = side * dq + offset
            over = (speed * ca.sqrt(speed**2 + 1e-4) - 2 * twice * (side * (end - q))) / unit
            for i, name in enumerate(node.ocp.names):
                node.subject_to(f"{name} velocity", over[i], high=0.0)


@dataclass(frozen=True)
class ToolSpeed(SceneConstraint):
    """Speed of flange and pads' centre below the limit at which the controller stops.

    On a straight line of a rigid body an end is fastest: these two ends are enough. The limit holds
    at instants of carry and opening; the speed falls in the brake, which only the verdict checks.
    """

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For an arm, or a scene, with such a limit."""
        return None if request.scene.tool_speed is None else cls()

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """The limit less its margins; the distance of the flange behind the pads' centre."""
        scene = request.scene
        assert scene.tool_speed is not None and scene.robot is not None and scene.arm is not None
        share = 1 - scene.robot.velocity_margin - request.refinement.margins[TOOL_SPEED.name]
        return {"tool_speed": share * scene.tool_speed, "tool_length": scene.arm.tool.tcp}

    def at_instant(self, at: Instant) -> None:
        """At each of them."""
        _limit_speed(at.ocp, at.constraints, at.hand)

    def at_last(self, brake: Brake) -> None:
        """At the last node."""
        _limit_speed(brake.ocp, brake.stage, brake.hand)


def _limit_speed(ocp: Ocp, constraints: Constraints, hand: Hand) -> None:
    """Squared speeds of the pads' centre and of the flange behind it, over the limit's square."""
    p, (pose, twist, _) = ocp.parameters, hand
    for x, z in (twist[:2], flange_velocity(p("tool_length"), pose[2], twist)):
        constraints.subject_to("tool speed", (x**2 + z**2) / p("tool_speed") ** 2, high=1.0)


@dataclass(frozen=True)
class TorqueLimits(SceneConstraint):
    """Joint torques inside their limits at the nodes and some instants of the brake.

    active: the NLP has them (lazy constraint "torque", or a section [torque]).
    """

    active: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For an arm whose masses are known."""
        if torque_limits(request.scene) is None:
            return None
        return cls(request.scene.torque is not None or "torque" in request.refinement.lazy)

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """The limits less the scene's margin and the refinement's."""
        limits, section = torque_limits(request.scene), request.scene.torque or Torque()
        assert limits is not None
        return {"torque_max": (1 - section.margin - request.refinement.margins["torque"]) * limits}

    def at_instant(self, at: Instant) -> None:
        """With the load of the object; without it after detach; both while the pads open."""
        if not self.active:
            return
        if at.grip != "none":
            _limit_torques(at.ocp, at.constraints, at.q, at.dq, at.ddq, at.load)
        if at.grip != "full":
            _limit_torques(at.ocp, at.constraints, at.q, at.dq, at.ddq)

    def at_last(self, brake: Brake) -> None:
        """The brake with an empty hand: at its start, and when each joint comes to rest.

        Joints brake independently; a joint at rest has no deceleration.
        """
        if not self.active:
            return
        ocp, place, rate = brake.ocp, brake.place, brake.rate
        braking = ocp.each("braking")
        deceleration = -braking * rate / ca.sqrt(rate**2 + 1e-4)
        _limit_torques(ocp, brake.stage, *brake.coordinates)
        _limit_torques(ocp, brake.stage, place, rate, deceleration)
        stops = ca.sqrt(rate**2 + 1e-6) / braking
        for i in range(ocp.n):
            remaining = stops - stops[i]
            moving = (
                1
                + (remaining + STOP_TIME) / ca.sqrt((remaining + STOP_TIME) ** 2 + STOP_TIME**2 / 4)
            ) / 2
            share = ca.fmin(stops[i] / stops, 1.0)
            place_then = place + rate * stops * (share - share**2 / 2)
            _limit_torques(ocp, brake.stage, place_then, rate * (1 - share), moving * deceleration)


def _limit_torques(
    ocp: Ocp,
    constraints: Constraints,
    q: ca.SX,
    dq: ca.SX,
    ddq: ca.SX,
    load: Load | None = None,
) -> None:
    """The torques inside their limits; load: force and torque of the hand on the object."""
    arm = ocp.kinematics
    assert isinstance(arm, PlanarArm)
    angles, rates, turns = map(arm.link_angles, (q, dq, ddq))
    torques = PlanarDynamics(arm).torques(angles, rates, turns, ocp.gravity, load)
    ocp.limit(constraints, "torque", ca.vertcat(*torques) / ocp.each("torque_max"))
