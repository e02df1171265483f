"""The decision vector of a throw's NLP: its structure and its blocks of variables, declared once.

Stage by stage (n coordinates; C carry intervals, O opening intervals):

    stage          states                                     controls
    k = 0          q (n, unless the start is given), T         c (n)
    0 < k < C      q (n), dq (n), ddq (n, jerk control), T     c (n)
    k = C          q (n), dq (n), ddq (n, jerk control)        c (n)
    C < k < C + O  like k = C, rel (6; 4 without the pivot)    c (n), acc (collocation)
    k = C + O      like k = C, rel                             t_f, those of scene constraints

A robust plan has intervals of fixed length before the opening, stages like k = C, and after it,
without rel; the stage of detach then has c too. With other openings (`terms.robust.Scenarios`) rel,
acc and t_f have indices: 0 is the planned opening. Known values (rest, a given start pose, the
object under full grip) are no variables.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..throw import Limits
from .request import Request

#: Unit of the jerk control [rad/s^3], so that the variables are of order one.
JERK_UNIT = 1000.0
#: Longest flight that is searched [s].
FLIGHT_MAX = 3.0
#: Shortest carry [s].
CARRY_MIN = 0.02

Bounds = tuple[Any, Any]


@dataclass(frozen=True)
class Structure:
    """The sizes and options of an NLP; numbers of a scene are parameters.

    carry, early, opening, late: numbers of intervals of the phases. instants: parts of a carry
    interval at whose ends grip and held bar are constrained. under_way: whether the start is a
    state of motion. pivot: whether the object's rotation against the hand matters (it does not
    for a CoM grasp with the landing angle open).
    """

    carry: int
    opening: int
    early: int
    late: int
    integrator: str
    substeps: int
    instants: int
    jerk_control: bool
    free_start: bool
    under_way: bool
    angle: bool
    pivot: bool
    elastic: bool

    @property
    def opens(self) -> int:
        """Number of the stage at which the grip force starts to fall."""
        return self.carry + self.early

    @property
    def detach(self) -> int:
        """Number of the stage at which it is zero."""
        return self.opens + self.opening

    @property
    def robust(self) -> bool:
        """Whether it has the window of a robust request."""
        return self.late > 0

    @property
    def last(self) -> int:
        """Number of the last stage: at detach, or at the end of the window."""
        return self.detach + self.late


def _unbounded(request: Request) -> Bounds:
    return -math.inf, math.inf


@dataclass(frozen=True)
class Block:
    """A block of decision variables.

    index: number among the blocks of a name, e.g. of the opening. bounds: (low, high) of a
    request; limit: name of a bound that binds. each: one variable per coordinate.
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
    return lambda request: pick(request.manipulator.planning)


def _carry(request: Request) -> Bounds:
    """The opening command precedes the opening by dwell and mean delay; the start precedes it."""
    earliest = request.scene.gripper.profile().dwell + request.scene.mean_delay + request.nodes[0]
    return max(earliest, CARRY_MIN), request.scene.mesh.carry_max


def _jerk(limits: Limits) -> Bounds:
    assert limits.jerk is not None
    return -limits.jerk / JERK_UNIT, limits.jerk / JERK_UNIT


_POSITION = _of_limits(lambda limits: (limits.q_min, limits.q_max))
_VELOCITY = _of_limits(lambda limits: (-limits.dq, limits.dq))
_ACCELERATION = _of_limits(lambda limits: (-limits.ddq, limits.ddq))

#: Coordinates, their rates and accelerations.
Q = Block("q", "rad; m", "position", _POSITION, each=True)
DQ = Block("dq", "rad/s; m/s", "velocity", _VELOCITY, each=True)
DDQ = Block("ddq", "rad/s^2", "acceleration", _ACCELERATION, each=True)
#: The control: the coordinates' jerk, or acceleration, constant in an interval.
JERK = Block("c", "1000 rad/s^3", "jerk", _of_limits(_jerk), each=True)
ACCELERATION = Block("c", "rad/s^2; m/s^2", "acceleration", _ACCELERATION, each=True)
#: The carry's duration: the release timing.
T = Block("T", "s", "carry time", _carry)
#: Relative state of the sliding pivot: slip, angle, and their rates.
REL = Block("rel", "m, rad, m/s, rad/s")
#: Unknown relative accelerations of collocation.
ACC = Block("acc", "10 m/s^2, 100 rad/s^2")
#: Flight time.
T_F = Block("t_f", "s", "flight time", lambda request: (0.0, FLIGHT_MAX))
#: Slacks of an elastic landing, below and above its target, of x (0) and theta (1).
SHORT = Block("short", "m; rad", bounds=lambda request: (0.0, math.inf))
FAR = Block("far", "m; rad", bounds=lambda request: (0.0, math.inf))
