"""Robust plans: constraints and costs against uncertain parameters.

Quiet release: while the pads may open, the hand follows the free flight of the held object, and
the pads transmit no force. Delay, opening time, friction, patch radius and mass then do not move
the landing. The load is b, the acceleration of the object's CoM less gravity's, and alpha, its
angular acceleration; a quiet release has b = 0, alpha = 0. The grip force of the earliest opening
sets the price of the load: a firm grip holds the object under load.

Errors of CoM, grasp and hand move the state at detach and with it the landing. Their price is the
variance of the landing, to first order.

Scenarios: several throws share the motion of the hand. Each has its own delay, opening, friction,
patch radius, mass, CoM and grasp.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import FlightState, held_wrench
from ..problem import land
from ..request import CONSTANT_RATES, SCENARIOS, Request
from ..scene_constraint import Brake, Flight, SceneConstraint
from ..stages import REL, Stage
from ..transcription import NODES, Interval, Ocp, grip_instants


@dataclass(frozen=True)
class RobustSettings:
    """Prices and thresholds of the robust methods.

    load_price [(m/s^2)^-2]: of the mean square load over the window, without grip. load_grip:
    share of the full grip at which that price has fallen to a quarter. miss_price [1/m^2]: of the
    mean square pose error of the scenarios. variance_price [1/m^2]: of the variance of the landing.
    min_fall_speed [m/s]: keeps the division by the speed of fall at the landing above zero.
    """

    load_price: float = 10.0
    load_grip: float = 0.05
    miss_price: float = 1e6
    variance_price: float = 1e6
    min_fall_speed: float = 0.01


SETTINGS = RobustSettings()


@dataclass(frozen=True)
class Quiet(SceneConstraint):
    """Constant rates in each interval of the window, or the price of the load."""

    rates: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a request with a window: constant rates, or the price of the load."""
        if request.window is None:
            return None
        s, profile, nodes = SETTINGS, request.scene.gripper.profile(), request.nodes
        grip = profile.force((nodes[:-1] + nodes[1:]) / 2 + request.window.lead) / profile.full
        price = request.refinement.quiet or s.load_price
        values = {
            "window_step": request.window.step,
            "window": nodes[-1] - nodes[0],
            "quiet_arm": request.scene.object.half_length,
            "quiet_weight": price * (s.load_grip / (s.load_grip + grip)) ** 2,
        }
        return cls(values, request.robust == CONSTANT_RATES)

    def in_interval(self, interval: Interval) -> None:
        """Constant rates, or the price, in the window: after the carry."""
        if interval.phase != "carry":
            (_keep_rates if self.rates else _price_load)(interval)


def _loads(interval: Interval) -> list[list[ca.SX]]:
    """(b_x, b_z, arm * alpha) [m/s^2] at two points of an interval."""
    ocp, arm = interval.ocp, interval.p("quiet_arm")
    loads, unit = [], replace(ocp.body, mass=1.0)
    for node in NODES:
        hand = interval.hand_at(node)[2]
        b_x, b_z, _ = held_wrench(unit, ocp.gravity, hand, ocp.grasp_angle)
        loads.append(interval.stage.lift(b_x, b_z, arm * hand.alpha))
    return loads


def _price_load(interval: Interval) -> None:
    """Adds the price of the mean square load over the window."""
    s, share = interval.ocp.structure, interval.dt / interval.p("window")
    price = interval.stage_parameter("quiet_weight", 1, s.carry, s.last - s.carry)
    for load in _loads(interval):
        squared = sum(value**2 for value in load)
        interval.add_objective(price * share / 2 * squared)


def _keep_rates(interval: Interval) -> None:
    """The coordinates move at constant rates."""
    for share in (0.0, 1.0):
        acceleration = interval.at(share * interval.dt)[2]
        interval.subject_to("constant joint velocity", acceleration, -1e-3, 1e-3)


@dataclass(frozen=True)
class LandingVariance(SceneConstraint):
    """The variance of the landing under errors of CoM, grasp and hand, as a cost.

    names: the uncertain parameters among STATE_ERRORS.
    """

    names: tuple[str, ...]

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a robust request of a scene that has such errors."""
        deviations = request.scene.deviations if request.robust else {}
        names = tuple(name for name in deviations if name in STATE_ERRORS)
        values = {
            "deviations": [deviations[name] for name in names],
            "drift_time": request.scene.gripper.profile().opening,
            "variance_weight": SETTINGS.variance_price,
        }
        return cls(values, names) if names else None

    def in_flight(self, flight: Flight) -> None:
        """The variance of the landing to first order."""
        p, h, t, end = flight.p, flight.ocp.body.com_offset, flight.time, flight.end
        drift, deviations = p("drift_time"), ca.vertsplit(p("deviations", len(self.names)))
        for name, deviation in zip(self.names, deviations, strict=True):
            x, z, theta, v_x, v_z, omega = STATE_ERRORS[name](flight.start, h, drift)
            delay = (z + v_z * t) / (SETTINGS.min_fall_speed - end.v_z)
            variance = (x + v_x * t + end.v_x * delay) ** 2
            if flight.ocp.structure.angle:
                variance += (p("quiet_arm") * (theta + omega * t + end.omega * delay)) ** 2
            flight.add_objective(p("variance_weight") * deviation**2 * variance)


def _moved(at: FlightState, x: Any, z: Any, turn: float) -> list[Any]:
    """Derivative of the state at detach as the CoM moves by x, z in the turning hand, and the bar
    turns by `turn`."""
    return [x, z, turn, -at.omega * z, at.omega * x, 0.0]


def _along_bar(at: FlightState, sign: float) -> list[Any]:
    """The derivative in a shift [m] of the CoM along the bar."""
    return _moved(at, sign * ca.cos(at.theta), sign * ca.sin(at.theta), 0.0)


def _about_pads(at: FlightState, h: ca.SX) -> list[Any]:
    """The derivative in an angle [rad] of the bar about the pads."""
    return _moved(at, -h * ca.sin(at.theta), h * ca.cos(at.theta), 1.0)


def _spin(at: FlightState, h: ca.SX, drift: ca.SX) -> list[Any]:
    """The derivative in an angular velocity [rad/s] during `drift` [s]."""
    x, z, *_ = _about_pads(at, h)
    return [drift * x, drift * z, drift, x, z, 1.0]


#: Derivative (6,) of the CoM's state at detach in each error, as a function of the state, the CoM's
#: offset [m] from the pads, and the duration [s] of an error of the hand's velocity.
STATE_ERRORS: dict[str, Callable[[FlightState, ca.SX, ca.SX], list[Any]]] = {
    "com_offset": lambda at, h, drift: _along_bar(at, 1.0),
    "grasp_offset": lambda at, h, drift: _along_bar(at, -1.0),
    "grasp_angle": lambda at, h, drift: _about_pads(at, h),
    "hand_theta": lambda at, h, drift: _about_pads(at, h),
    "hand_omega": _spin,
    "hand_x": lambda at, h, drift: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    "hand_z": lambda at, h, drift: [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    "hand_vx": lambda at, h, drift: [drift, 0.0, 0.0, 1.0, 0.0, 0.0],
    "hand_vz": lambda at, h, drift: [0.0, drift, 0.0, 0.0, 1.0, 0.0],
}

#: Signs of the errors in the four scenarios, in the order of their delays. Parameters of equal
#: effect on the landing have equal signs up to a factor; signs of different groups are orthogonal.
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
    """Throws with other parameters under the planned motion of the hand.

    count: their number. Their indices are 1 to count; the planned throw has 0.
    """

    count: int

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For the robust method of this name: grip force over the window, body, contact and grasp
        of each throw."""
        if request.robust != SCENARIOS or request.window is None:
            return None
        scene, values = request.scene, dict[str, Any](scenario_weight=SETTINGS.miss_price)
        profile, deviations = scene.gripper.profile(), scene.deviations
        instants = grip_instants(request.nodes).ravel()
        for i, delay in enumerate(request.window.delays, start=1):
            value = dict(scene.values)
            for name in SIGNS.keys() & deviations.keys():
                value[name] += SIGNS[name][(i - 1) % 4] * deviations[name]
            since = instants - delay
            since = np.where(since > 0.0, since * profile.opening / value["opening"], since)
            com_offset = value["com_offset"] - (value["grasp_offset"] - scene.grasp.offset)
            names = ("mass", "inertia", "friction", "patch_radius", "grasp_angle")
            values |= {f"{name} {i}": value[name] for name in names}
            values |= {f"com_offset {i}": com_offset}
            values[f"grip_force {i}"] = profile.force(since)
        return cls(values, len(request.window.delays))

    def add_states(self, ocp: Ocp, k: int, stage: Stage) -> None:
        """The relative states from the window's start on."""
        if k > ocp.structure.carry:
            for i in range(1, self.count + 1):
                stage.state(REL.number(i), ocp.rel_size)

    def in_interval(self, interval: Interval) -> None:
        """Each throw across an interval of the window with its own grip force.

        The law holds in all phases: the object sticks under full grip and flies without grip.
        """
        if interval.phase != "carry":
            for i in range(1, self.count + 1):
                interval.set_sliding_pivot(i)

    def at_last(self, brake: Brake) -> None:
        """Each throw's landing, and the price of missing the target."""
        p, hand = brake.p, brake.hand
        for i in range(1, self.count + 1):
            end = land(brake, hand, i).end
            miss = (end.x - p("target_x")) ** 2
            if brake.ocp.structure.angle:
                miss += (p("quiet_arm") * (end.theta - p("target_theta"))) ** 2
            brake.add_objective(p("scenario_weight") * miss / self.count)
