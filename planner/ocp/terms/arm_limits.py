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

#: Parameters: as in `models.Slowing`.
NAMES = ("slowing", "slowing_offset", "slowing_upper", "slowing_lower")
#: A joint counts as braking until about this time [s] after its stop.
STILL = 0.01


@dataclass(frozen=True)
class SlowingLimits(SceneConstraint):
    """For arms like the FR3. The verdict checks every sample."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For an arm that has such limits."""
        return None if request.manipulator.planning.slowing is None else cls()

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """The limits' curves."""
        assert request.manipulator.planning.slowing is not None
        return dict(zip(NAMES, request.manipulator.planning.slowing, strict=True))

    def at_rate(self, node: Node, q: ca.SX, dq: ca.SX) -> None:
        """dq + offset <= sqrt(2 a (upper - q)), squared with the sign kept.

        So there is no root of what may be negative on the way, and the error is on the safe side
        by 5e-5 (rad/s)^2 at most.
        """
        twice, offset, upper, lower = (node.ocp.each(name) for name in NAMES)
        unit = node.ocp.each("dq_max") ** 2
        for side, end in ((1, upper), (-1, lower)):
            speed = side * dq + offset
            over = (speed * ca.sqrt(speed**2 + 1e-4) - 2 * twice * (side * (end - q))) / unit
            for i, name in enumerate(node.ocp.names):
                node.subject_to(f"{name} velocity", over[i], high=0.0)


@dataclass(frozen=True)
class ToolSpeed(SceneConstraint):
    """Flange and pads' centre keep the limit at which the controller stops.

    On a straight line of a rigid body one end is fastest, so these two stand for all between. At
    the instants of carry and opening it often binds; in the brake, which the verdict checks too,
    the speed only falls.
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
    """active: whether the NLP has them (lazy constraint "torque", or a section [torque]).

    They hold at nodes and at some instants of the brake; the verdict looks at every sample.
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
        """With the object, without, or, while the pads open, with all of it or nothing."""
        if not self.active:
            return
        if at.grip != "none":
            _limit_torques(at.ocp, at.constraints, at.q, at.dq, at.ddq, at.load)
        if at.grip != "full":
            _limit_torques(at.ocp, at.constraints, at.q, at.dq, at.ddq)

    def at_last(self, brake: Brake) -> None:
        """The brake with an empty hand: as it begins, and as each joint comes to rest.

        Every joint brakes by itself; those that have stopped no longer do.
        """
        if not self.active:
            return
        ocp, place, rate = brake.ocp, brake.place, brake.rate
        braking = ocp.each("braking")
        against = -braking * rate / ca.sqrt(rate**2 + 1e-4)
        _limit_torques(ocp, brake.stage, *brake.coordinates)
        _limit_torques(ocp, brake.stage, place, rate, against)
        stops = ca.sqrt(rate**2 + 1e-6) / braking
        for i in range(ocp.n):
            left = stops - stops[i]
            going = (1 + (left + STILL) / ca.sqrt((left + STILL) ** 2 + STILL**2 / 4)) / 2
            share = ca.fmin(stops[i] / stops, 1.0)
            there = place + rate * stops * (share - share**2 / 2)
            _limit_torques(ocp, brake.stage, there, rate * (1 - share), going * against)


def _limit_torques(
    ocp: Ocp,
    constraints: Constraints,
    q: ca.SX,
    dq: ca.SX,
    ddq: ca.SX,
    load: Load | None = None,
) -> None:
    """The torques inside their limits; load: what the hand gives to the object."""
    arm = ocp.kinematics
    assert isinstance(arm, PlanarArm)
    angles, rates, turns = map(arm.link_angles, (q, dq, ddq))
    torques = PlanarDynamics(arm).torques(angles, rates, turns, ocp.gravity, load)
    ocp.limit(constraints, "torque", ca.vertcat(*torques) / ocp.each("torque_max"))
