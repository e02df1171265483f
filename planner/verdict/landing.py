"""Limits on the landing, for one throw and for arrays of N throws alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...models import Array, Flags, FlightState
from ...problems import Bin, Cup, Pose, Scene, Tolerance
from ..throw import TICK, cup_entries
from .findings import Code

#: Least speed [m/s] at which the CoM must fall through the target's height. At slower falls, near
#: the apex, micrometres of the release are millimetres of the landing.
FALLS = 0.02
#: Allowed excess over the tolerance, a share of it: covers rounding in files.
ROUNDING = 1e-6
#: Error [m] of a clearance in the cup, from the bisection of its instants.
CUP_NEAR = 1e-5


def least_cup_clearance(cup: Cup | Bin) -> float:
    """The clearance [m] in cup or bin must exceed this; 0 is contact with wall or rim."""
    return max(cup.clearance - CUP_NEAR, 0.0)


class LimitUse(NamedTuple):
    """A value [SI] that must be at most its limit, or, with sign -1, at least; of one throw or an
    array (N,).

    body: distinguishes several values of one code. time [s]: when it is so; None without an
    instant. slack: allowed excess, which covers rounding.
    """

    code: Code
    value: Any
    limit: float
    sign: float = 1.0
    body: str = ""
    time: Any = None
    slack: float = 0.0

    @property
    def broken(self) -> Any:
        """Whether the value is beyond the limit; NaN is beyond every limit."""
        return ~(self.sign * (np.asarray(self.value) - self.limit) <= self.slack)


@dataclass(frozen=True)
class LandingStates:
    """Landings of throws, floats or arrays (N,): dx [m] and dtheta [rad] off the target; start and
    end (6, ...) of the flight, x, z, theta and their rates; lands: landing time [s] on the motion's
    clock, None if no limit of it counts."""

    dx: Any
    dtheta: Any
    start: Any
    end: Any
    lands: Any


def tolerance_uses(tolerance: Tolerance, dx: Any, dtheta: Any | None) -> list[LimitUse]:
    """The uses of a tolerance by a landing; dtheta: None where theta is open."""
    allowed = (1 + ROUNDING) * tolerance.position, (1 + ROUNDING) * tolerance.angle
    errors = [LimitUse(Code.LANDING, np.abs(dx), allowed[0], body="position")]
    if dtheta is not None:
        errors.append(LimitUse(Code.LANDING, np.abs(dtheta), allowed[1], body="angle"))
    return errors


def landing_uses(scene: Scene, target: Pose, at: LandingStates) -> list[LimitUse]:
    """The uses of tolerance, [landing] and [target] arrival."""
    bounds, (v_x, v_z, omega) = scene.landing, at.end[3:]
    uses = tolerance_uses(scene.tolerance, at.dx, None if target.theta is None else at.dtheta)
    uses.append(LimitUse(Code.GRAZING, -v_z, FALLS, sign=-1.0))
    if bounds is not None:
        speed = np.hypot(v_x, v_z)
        uses.append(LimitUse(Code.LANDING_SPEED, speed, bounds.speed_min, -1.0))
        if bounds.speed_max is not None:
            uses.append(LimitUse(Code.LANDING_SPEED, speed, bounds.speed_max))
        if bounds.rate_max is not None:
            uses.append(LimitUse(Code.LANDING_RATE, np.abs(omega), bounds.rate_max))
    if target.arrival is not None and at.lands is not None:
        # The landing may be one sample early or late.
        earliest, latest = target.window
        uses.append(LimitUse(Code.ARRIVAL, at.lands, earliest - TICK, -1.0))
        uses.append(LimitUse(Code.ARRIVAL, at.lands, latest + TICK))
    return uses


def lands_well(scene: Scene, detach: Array, landing: Array, more: float = 0.0) -> Flags:
    """Flags (N,) of the flights inside [landing], [cup] and [bin], these moved to each landing.

    detach (N, 6): CoM pose and twist; landing (N, 3): x, theta and flight time at the height of the
    scene's target; more [m]: clearance in the cup beyond the scene's.
    """
    target, (x, theta, time) = scene.aim, landing.T
    at = scene.flight.after(FlightState(*detach.T), time)
    end = x, np.full(len(x), target.z), theta, at.v_x, at.v_z, at.omega
    uses = landing_uses(scene, target, LandingStates(0.0 * x, 0.0 * x, detach.T, end, None))
    good = ~np.logical_or.reduce([np.broadcast_to(use.broken, len(x)) for use in uses])
    if (cup := scene.opening) is not None:
        shifted = detach.copy()
        shifted[:, 0] += target.plane_x - x
        good &= cup_entries(scene, shifted, time) > least_cup_clearance(cup) + more
    return np.asarray(good)
