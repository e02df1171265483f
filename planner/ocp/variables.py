"""The decision vector of a throw's NLP: its sizes and its blocks of variables.

Stage by stage (n coordinates; C carry intervals, O opening intervals):

    stage          states                                     controls
    k = 0          q (n, unless the start is given), T         c (n)
    0 < k < C      q (n), dq (n), ddq (n, jerk control), T     c (n)
    k = C          q (n), dq (n), ddq (n, jerk control)        c (n)
    C < k < C + O  like k = C, rel (6; 4 without the pivot)    c (n), acc (collocation)
    k = C + O      like k = C, rel                             t_f, those of scene constraints

A robust plan has intervals of fixed length before the opening (stages like k = C) and after detach
(without rel); its stage of detach has c too. With several openings (`terms.robust.Scenarios`) rel,
acc and t_f have indices: 0 is the planned opening. Known values are no variables: rest, a given
start pose, the object under full grip.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

#: Unit of the jerk control [rad/s^3]: the variables are of order one.
JERK_UNIT = 1000.0
#: Longest flight [s] of a plan.
FLIGHT_MAX = 3.0
#: Shortest carry [s] of a plan.
CARRY_MIN = 0.02


@dataclass(frozen=True)
class Structure:
    """The sizes and options of an NLP; numbers of a scene are parameters.

    carry, early, opening, late: numbers of intervals of the phases. instants: parts of a carry
    interval; grip and held bar are constrained at their ends. initial_motion: whether the throw
    starts from a given motion instead of rest. pivot: whether the object's rotation in the pads
    matters (not for a CoM grasp with the landing angle open).
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
    initial_motion: bool
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


@dataclass(frozen=True)
class Block:
    """A block of decision variables.

    limit: name of its bounds where they bind, empty for none. each: one variable per coordinate.
    index: number among the blocks of a name, e.g. of the opening.
    """

    name: str
    unit: str
    limit: str = ""
    each: bool = False
    index: int = 0

    def number(self, index: int) -> Block:
        """The block of this name with another index."""
        return dataclasses.replace(self, index=index)


#: Coordinates, their rates and accelerations.
Q = Block("q", "rad; m", "position", each=True)
DQ = Block("dq", "rad/s; m/s", "velocity", each=True)
DDQ = Block("ddq", "rad/s^2", "acceleration", each=True)
#: Controls, constant in an interval: the jerk of the coordinates, or their acceleration.
JERK = Block("c", "1000 rad/s^3", "jerk", each=True)
ACCELERATION = Block("c", "rad/s^2; m/s^2", "acceleration", each=True)
#: Duration of the carry: the release timing.
T = Block("T", "s", "carry time")
#: State of the object in the pads: slip, angle, and their rates.
REL = Block("rel", "m, rad, m/s, rad/s")
#: Accelerations of slip and angle at the collocation points.
ACC = Block("acc", "10 m/s^2, 100 rad/s^2")
#: Duration of the flight.
T_F = Block("t_f", "s", "flight time")
#: Slacks of an elastic landing below and above its target, of x (index 0) and theta (1).
SLACKS = (Block("undershoot", "m; rad"), Block("overshoot", "m; rad"))
