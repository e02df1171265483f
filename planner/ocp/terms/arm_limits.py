"""Limits of an arm beyond those that every throw keeps: slowing velocity, tool speed, torques."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import casadi as ca

from ....models.robot import PlanarArm, PlanarDynamics, flange_velocity
from ...throw import torque_limits
from ..request import TOOL_SPEED, Request
from ..scene_constraint import Brake, Instant, Load, SceneConstraint
from ..transcription import Hand, Node, Scope

#: Parameters of the slowing limits, see `models.robot.Slowing`.
CURVES = ("slowing", "slowing_offset", "slowing_upper", "slowing_lower")
#: Time [s] around a joint's stop in which its deceleration falls to zero smoothly.
STOP_TIME = 0.01


@dataclass(frozen=True)
class SlowingLimits(SceneConstraint):
    """Velocity limits that fall towards the position limits, as of the FR3."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For an arm that has such limits."""
        curves = request.manipulator.planning.slowing
        if curves is None:
            return None
        values = dict(zip(CURVES, curves, strict=True))
        # Between nodes the limits may fall faster than the velocity.
        values["slowing_offset"] = values["slowing_offset"] + request.refinement.margins["slowing"]
        return cls(values)

    def at_rate(self, node: Node, q: ca.SX, dq: ca.SX) -> None:
        """dq + offset <= sqrt(2 a (upper - q)), squared with its sign.

        The squared form has no root of a negative number at an iterate. Its error is at most
        5e-5 (rad/s)^2, on the safe side.
        """
        twice, offset, upper, lower = (node.ocp.each(name) for name in CURVES)
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
        scene = request.scene
        if scene.tool_speed is None or scene.robot is None or scene.arm is None:
            return None
        share = 1 - scene.robot.velocity_margin - request.refinement.margins[TOOL_SPEED.name]
        return cls({"tool_speed": share * scene.tool_speed, "tool_length": scene.arm.tool.tcp})

    def at_instant(self, at: Instant) -> None:
        """At each of them."""
        _limit_speed(at, at.hand)

    def at_last(self, brake: Brake) -> None:
        """At the last node."""
        _limit_speed(brake, brake.hand)


def _limit_speed(scope: Scope, hand: Hand) -> None:
    """Squared speeds of the pads' centre and of the flange behind it, over the limit's square."""
    p, (pose, twist, _) = scope.p, hand
    for x, z in (twist[:2], flange_velocity(p("tool_length"), pose[2], twist)):
        scope.subject_to("tool speed", (x**2 + z**2) / p("tool_speed") ** 2, high=1.0)


@dataclass(frozen=True)
class TorqueLimits(SceneConstraint):
    """Joint torques inside their limits at the nodes and some instants of the brake."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """With a section [torque], or as a lazy constraint, for an arm whose masses are known."""
        scene, limits = request.scene, torque_limits(request.scene)
        if limits is None or (scene.torque is None and "torque" not in request.refinement.lazy):
            return None
        margin = scene.torque_margin + request.refinement.margins["torque"]
        return cls({"torque_max": (1 - margin) * limits})

    def at_instant(self, at: Instant) -> None:
        """With the load of the object; without it after detach; both while the pads open."""
        if at.grip != "none":
            _limit_torques(at, at.q, at.dq, at.ddq, at.load)
        if at.grip != "full":
            _limit_torques(at, at.q, at.dq, at.ddq)

    def at_last(self, brake: Brake) -> None:
        """The brake with an empty hand: at its start, and when each joint comes to rest.

        Joints brake independently; a joint at rest has no deceleration.
        """
        place, rate, braking = brake.place, brake.rate, brake.ocp.each("braking")
        deceleration = -braking * rate / ca.sqrt(rate**2 + 1e-4)
        _limit_torques(brake, *brake.coordinates)
        _limit_torques(brake, place, rate, deceleration)
        stops = ca.sqrt(rate**2 + 1e-6) / braking
        for i in range(brake.ocp.n):
            since = stops - stops[i] + STOP_TIME
            moving = (1 + since / ca.sqrt(since**2 + STOP_TIME**2 / 4)) / 2
            moving[i] = 1.0  # Until then it decelerates in full.
            share = ca.fmin(stops[i] / stops, 1.0)
            place_then = place + rate * stops * (share - share**2 / 2)
            _limit_torques(brake, place_then, rate * (1 - share), moving * deceleration)


def _limit_torques(scope: Scope, q: ca.SX, dq: ca.SX, ddq: ca.SX, load: Load | None = None) -> None:
    """The torques inside their limits; load: force and torque of the hand on the object."""
    ocp, arm = scope.ocp, scope.ocp.kinematics
    assert isinstance(arm, PlanarArm)
    angles, rates, turns = map(arm.link_angles, (q, dq, ddq))
    torques = PlanarDynamics(arm).torques(angles, rates, turns, ocp.gravity, load)
    scope.limit("torque", ca.vertcat(*torques) / ocp.each("torque_max"))
