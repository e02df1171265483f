"""Robust plans: constraints and costs against what is uncertain.

The quiet release: while the pads may open, the hand follows the held object's own free
flight, so that they transmit nothing; then neither delay, opening time, friction, patch
radius nor mass moves the landing. b is the held object's acceleration at its CoM less
gravity's, and alpha its angular acceleration; quiet is b = 0, alpha = 0. The load matters
where the grip may be too weak for it, so its price falls with the grip force of the earliest
opening.

Errors of CoM, grasp and hand move the state at detach, and with it the landing: their price is the
landing's variance by its derivatives.

Scenarios: other throws share the hand's motion, each with its own delay, opening, friction, patch
radius, mass, CoM and grasp.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import FlightState
from ....problems import Robust
from ..problem import land, sliding_pivot
from ..request import Request
from ..scene_constraint import Brake, Flight, SceneConstraint
from ..stages import Stage
from ..transcription import NODES, Interval, Ocp, grip_force, grip_instants
from ..variables import REL

#: Price of the mean square load over the window, where the grip is open [(m/s^2)^-2].
WEIGHT = 10.0
#: Share of the full grip at which the load's price is a quarter of that.
GRIP = 0.05
#: Acceleration [m/s^2] below which the load is zero.
NONE = 0.05
#: Price of the scenarios' mean square pose error, and of the landing's variance [1/m^2].
SCENARIO_WEIGHT, VARIANCE_WEIGHT = 1e6, 1e6
#: Least speed [m/s] of coming down, by which derivatives of the landing are divided.
SLOWEST = 0.01


@dataclass(frozen=True)
class Quiet(SceneConstraint):
    """The method's constraints or cost in each interval of the window; sweeps judge the load."""

    method: str

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a robust request. Scenarios have the quiet cost too."""
        if not request.robust:
            return None
        return cls(Robust.QUIET if request.robust == "scenarios" else request.robust)

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """The window's lengths [s], and prices."""
        assert request.window is not None
        profile, nodes = request.scene.gripper.profile(), request.nodes
        earliest = request.window.early * request.window.step
        grip = profile.force((nodes[:-1] + nodes[1:]) / 2 + earliest) / profile.full
        return {
            "window_step": request.window.step,
            "window": nodes[-1] - nodes[0],
            "quiet_arm": request.scene.object.half_length,
            "quiet_weight": WEIGHT * (GRIP / (GRIP + grip)) ** 2,
            "quiet_none": NONE,
        }

    def in_window(self, interval: Interval) -> None:
        """The method's constraints or cost."""
        METHODS[self.method](interval)


def _loads(interval: Interval) -> list[list[ca.SX]]:
    """(b_x, b_z, arm * alpha) [m/s^2] at two points of an interval."""
    ocp, arm = interval.ocp, interval.p("quiet_arm")
    h, found = ocp.body.com_offset, []
    for node in NODES:
        pose, _, hand = ocp.hand(interval.stage, *interval.at(node * interval.dt))
        theta = pose[2] + ocp.grasp_angle
        x_r, z_r = h * ca.cos(theta), h * ca.sin(theta)
        b_x = hand.a_x - hand.alpha * z_r - hand.omega**2 * x_r
        b_z = hand.a_z + hand.alpha * x_r - hand.omega**2 * z_r + ocp.gravity
        found.append(interval.stage.lift(b_x, b_z, arm * hand.alpha))
    return found


def _penalised(interval: Interval) -> None:
    """A price on the mean square of the load over the window."""
    s, share = interval.ocp.structure, interval.dt / interval.p("window")
    price = interval.stage_parameter("quiet_weight", 1, s.carry, s.last - s.carry)
    for load in _loads(interval):
        squared = sum(value**2 for value in load)
        interval.add_objective(price * share / 2 * squared)


def _exact(interval: Interval) -> None:
    """No load at all."""
    for load in _loads(interval):
        for value in load:
            interval.subject_to("quiet release", value / interval.p("quiet_none"), -1.0, 1.0)


def _constant_hand(interval: Interval) -> None:
    """The hand moves and turns at constant velocity."""
    ocp, none = interval.ocp, interval.p("quiet_none")
    for node in NODES:
        hand = ocp.hand(interval.stage, *interval.at(node * interval.dt))[2]
        for value in interval.stage.lift(hand.a_x, hand.a_z, interval.p("quiet_arm") * hand.alpha):
            interval.subject_to("constant hand velocity", value / none, -1.0, 1.0)


def _constant_joints(interval: Interval) -> None:
    """The coordinates move at constant rates."""
    for share in (0.0, 1.0):
        acceleration = interval.at(share * interval.dt)[2]
        interval.subject_to("constant joint velocity", acceleration, -1e-3, 1e-3)


def _steady(interval: Interval) -> None:
    """The coordinates keep one acceleration."""
    if interval.ocp.structure.jerk_control:
        jerk = interval.stage.controls[interval.ocp.control]
        interval.subject_to("constant acceleration", jerk, -1e-4, 1e-4)


#: What each robust method adds to an interval of the window.
METHODS: dict[str, Callable[[Interval], None]] = {
    Robust.QUIET: _penalised,
    "quiet-exactly": _exact,
    "stationary": _steady,
    "hand-velocity": _constant_hand,
    "joint-velocity": _constant_joints,
}


@dataclass(frozen=True)
class LandingVariance(SceneConstraint):
    """The price of what errors of CoM, grasp and hand do to the landing.

    names: the uncertain ones among them.
    """

    names: tuple[str, ...]

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a robust request of a scene that has such errors."""
        deviations = request.scene.deviations if request.robust else {}
        names = tuple(name for name in deviations if name in STATE_ERRORS)
        return cls(names) if names else None

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """Standard deviations of the errors, and the price."""
        deviations = request.scene.deviations
        return {
            "deviations": [deviations[name] for name in self.names],
            "drift_time": request.scene.gripper.profile().opening,
            "variance_weight": VARIANCE_WEIGHT,
            "quiet_arm": request.scene.object.half_length,
        }

    def in_flight(self, flight: Flight) -> None:
        """The variance of the landing to first order."""
        p, h, t, end = flight.p, flight.ocp.body.com_offset, flight.time, flight.end
        drift, deviations = p("drift_time"), ca.vertsplit(p("deviations", len(self.names)))
        for name, deviation in zip(self.names, deviations, strict=True):
            x, z, theta, v_x, v_z, omega = STATE_ERRORS[name](flight.start, h, drift)
            later = (z + v_z * t) / (SLOWEST - end.v_z)
            moved = (x + v_x * t + end.v_x * later) ** 2
            if flight.ocp.structure.angle:
                moved += (p("quiet_arm") * (theta + omega * t + end.omega * later)) ** 2
            flight.add_objective(p("variance_weight") * deviation**2 * moved)


def _moved_along(at: FlightState, sign: float) -> list[Any]:
    """Derivative of the state at detach by a way [m] of the CoM along the bar."""
    x, z = sign * ca.cos(at.theta), sign * ca.sin(at.theta)
    return [x, z, 0.0, -at.omega * z, at.omega * x, 0.0]


def _turned(at: FlightState, h: ca.SX) -> list[Any]:
    """Derivative of the state at detach by an angle [rad] of the bar about the pads."""
    x, z = -h * ca.sin(at.theta), h * ca.cos(at.theta)
    return [x, z, 1.0, -at.omega * z, at.omega * x, 0.0]


def _spun(at: FlightState, h: ca.SX, drift: ca.SX) -> list[Any]:
    """Derivative of the state at detach by an angular velocity [rad/s] that lasts `drift` [s]."""
    x, z = -h * ca.sin(at.theta), h * ca.cos(at.theta)
    return [drift * x, drift * z, drift, x, z, 1.0]


#: Derivative (6,) of the CoM's state at detach by each error that moves it: of the state, the CoM's
#: offset [m] from the pads, and the time [s] that errors of the hand's velocity last.
STATE_ERRORS: dict[str, Callable[[FlightState, ca.SX, ca.SX], list[Any]]] = {
    "com_offset": lambda at, h, drift: _moved_along(at, 1.0),
    "grasp_offset": lambda at, h, drift: _moved_along(at, -1.0),
    "grasp_angle": lambda at, h, drift: _turned(at, h),
    "hand_theta": lambda at, h, drift: _turned(at, h),
    "hand_omega": _spun,
    "hand_x": lambda at, h, drift: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    "hand_z": lambda at, h, drift: [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    "hand_vx": lambda at, h, drift: [drift, 0.0, 0.0, 1.0, 0.0, 0.0],
    "hand_vz": lambda at, h, drift: [0.0, drift, 0.0, 0.0, 1.0, 0.0],
}

#: Signs of the errors in the scenarios, whose delays rise: the errors of each group act alike on
#: the landing, and the groups' signs are orthogonal.
SIGNS = {
    "opening": (-1.0, 1.0, -1.0, 1.0),
    "friction": (1.0, -1.0, -1.0, 1.0),
    "patch_radius": (1.0, -1.0, -1.0, 1.0),
    "mass": (-1.0, 1.0, 1.0, -1.0),
    "inertia": (-1.0, 1.0, 1.0, -1.0),
    "com_offset": (1.0, -1.0, 1.0, -1.0),
    "grasp_offset": (-1.0, 1.0, -1.0, 1.0),
    "grasp_angle": (1.0, 1.0, -1.0, -1.0),
}


@dataclass(frozen=True)
class Scenarios(SceneConstraint):
    """count: number of the other throws. Their indices are 1 to count, the planned one's is 0."""

    count: int

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For the robust method of this name."""
        if request.robust != "scenarios" or request.window is None:
            return None
        return cls(len(request.window.delays))

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """Each throw's grip force over the window, its body, contact and grasp."""
        assert request.window is not None
        scene, found = request.scene, dict[str, Any]()
        profile, deviations = scene.gripper.profile(), scene.deviations
        instants = grip_instants(scene.mesh, request.nodes).ravel()
        for i, delay in enumerate(request.window.delays, start=1):
            value = dict(scene.values)
            for name in SIGNS.keys() & deviations.keys():
                value[name] += SIGNS[name][(i - 1) % 4] * deviations[name]
            since = instants - delay
            since = np.where(since > 0.0, since * profile.opening / value["opening"], since)
            com_offset = value["com_offset"] - (value["grasp_offset"] - scene.grasp.offset)
            names = ("mass", "inertia", "friction", "patch_radius", "grasp_angle")
            found |= {f"{name} {i}": value[name] for name in names}
            found |= {f"com_offset {i}": max(com_offset, 0.0)}
            found[grip_force(i)] = profile.force(since)
        return {"scenario_weight": SCENARIO_WEIGHT, **found}

    def add_states(self, ocp: Ocp, k: int, stage: Stage) -> None:
        """The relative states from the window's start on."""
        if k > ocp.structure.carry:
            for i in range(1, self.count + 1):
                stage.state(REL.number(i), ocp.rel_size)

    def in_window(self, interval: Interval) -> None:
        """Each throw across the interval with its own grip force.

        Under full grip it sticks, without any it flies: one law serves all along.
        """
        for i in range(1, self.count + 1):
            law = functools.partial(sliding_pivot, opening=i)
            interval.set_second_derivative(REL.number(i), law, window=True)

    def at_last(self, brake: Brake) -> None:
        """Each throw's landing, and the price of missing the target."""
        p, hand = brake.p, brake.hand
        for i in range(1, self.count + 1):
            end = land(brake, hand, i).end
            miss = (end.x - p("target_x")) ** 2
            if brake.ocp.structure.angle:
                miss += (p("quiet_arm") * (end.theta - p("target_theta"))) ** 2
            brake.add_objective(p("scenario_weight") * miss / self.count)
