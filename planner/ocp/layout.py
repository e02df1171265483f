"""The decision vector of a throw's NLP, declared once.

Stage by stage (n coordinates; C carry intervals, O opening intervals):

    stage          states                                    controls
    k = 0          q (n, unless the start is given), T        c (n)
    0 < k < C      q (n), dq (n), ddq (n, jerk control), T    c (n)
    k = C          q (n), dq (n), ddq (n, jerk control)       c (n)
    C < k < C + O  the same and rel (6; 4 without the pivot)  c (n), acc (collocation)
    k = C + O      the same                                   t_f, and what terms add

A robust plan has intervals of fixed length before the opening, stages like k = C, and
after it, without rel; the stage of detach then has c too. With other openings
(`terms.scenarios`) rel, acc and t_f have indices: 0 is the planned opening.

At rest dq and ddq are zero and no variables, rel is so at the opening's start, and a given
start pose is no variable either.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..check import Limits
from .asked import Request

#: Unit of the jerk control [rad/s^3], so that the variables are of order one.
JERK_UNIT = 1000.0
#: Longest flight that is searched [s].
FLIGHT_MAX = 3.0
#: Shortest carry [s].
CARRY_MIN = 0.02

Bounds = tuple[Any, Any]


def _unbounded(request: Request) -> Bounds:
    return -math.inf, math.inf


@dataclass(frozen=True)
class Block:
    """A block of decision variables.

    index: which of several of its name, e.g. of which opening. bounds: (low, high) for a request;
    limit: what a bound is called where it binds. each: one variable per coordinate.
    """

    name: str
    unit: str
    limit: str = ""
    bounds: Callable[[Request], Bounds] = _unbounded
    each: bool = False
    index: int = 0

    def number(self, index: int) -> Block:
        """Another block of the same name."""
        return dataclasses.replace(self, index=index)


def _of_limits(pick: Callable[[Limits], Bounds]) -> Callable[[Request], Bounds]:
    return lambda request: pick(request.mover.planning)


def _carry(request: Request) -> Bounds:
    """The opening command comes the dwell and the mean delay before the opening, not earlier
    than the start."""
    earliest = request.scene.gripper.profile().dwell + request.scene.mean_delay + request.nodes[0]
    return max(earliest, CARRY_MIN), request.scene.mesh.carry_max


def _jerk(limits: Limits) -> Bounds:
    assert limits.jerk is not None
    return -limits.jerk / JERK_UNIT, limits.jerk / JERK_UNIT


_POSITION = _of_limits(lambda limits: (limits.q_min, limits.q_max))
_VELOCITY = _of_limits(lambda limits: (-limits.dq, limits.dq))
_ACCELERATION = _of_limits(lambda limits: (-limits.ddq, limits.ddq))

#: Coordinates, their rates and accelerations; the control, constant in an interval, so that
#: the coordinates inside it are closed forms: their jerk, or their acceleration.
Q = Block("q", "rad; m", "position", _POSITION, each=True)
DQ = Block("dq", "rad/s; m/s", "velocity", _VELOCITY, each=True)
DDQ = Block("ddq", "rad/s^2", "acceleration", _ACCELERATION, each=True)
JERK = Block("c", "1000 rad/s^3", "jerk", _of_limits(_jerk), each=True)
ACCELERATION = Block("c", "rad/s^2; m/s^2", "acceleration", _ACCELERATION, each=True)
#: The carry's duration: the release timing.
T = Block("T", "s", "carry time", _carry)
#: Relative state of the sliding pivot: slip, angle, and their rates; and the unknown relative
#: accelerations of collocation.
REL = Block("rel", "m, rad, m/s, rad/s")
ACC = Block("acc", "10 m/s^2, 100 rad/s^2")
#: Flight time; how far a landing that may miss falls short or goes too far, of x (0), theta (1).
T_F = Block("t_f", "s", "flight time", lambda request: (0.0, FLIGHT_MAX))
SHORT = Block("short", "m; rad", bounds=lambda request: (0.0, math.inf))
FAR = Block("far", "m; rad", bounds=lambda request: (0.0, math.inf))
