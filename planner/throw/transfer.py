"""Motions of all joints of an arm from one state of motion to another, in the least time: Ruckig's.

They keep the limits on velocity, acceleration and jerk; ranges of the joints and velocity limits
that depend on them are for the verdict.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...models.robot import Arm
from .manipulator import State, joint_limits
from .sending import SHARE, TICK, Excess, Samples, joint_excesses

if TYPE_CHECKING:
    import ruckig

#: Most attempts at a duration of whole samples.
ROUNDINGS = 5


@dataclass(frozen=True)
class Transfer:
    """A motion of all joints of an arm between two states of motion, in whole samples.

    ticks: number of samples after the first one.
    """

    trajectory: ruckig.Trajectory = field(repr=False)
    goal: State
    ticks: int

    @cached_property
    def samples(self) -> Samples:
        """Samples (N, joints) every millisecond, with both states."""
        states = [self.trajectory.at_time(TICK * k) for k in range(self.ticks)]
        states.append([row.tolist() for row in (self.goal.q, self.goal.dq, self.goal.ddq)])
        return Samples(*np.moveaxis(np.array(states), 1, 0))


def transfer(
    arm: Arm, start: State, goal: State, velocity: float = 1.0, acceleration: float = 1.0
) -> Transfer | None:
    """The motion from the first state to the other one in the least time.

    velocity, acceleration: shares of the limits on velocity, and on acceleration and jerk. None if
    a state is beyond these.
    """
    import ruckig

    n, limits = arm.joints, joint_limits(arm, range(1, arm.joints + 1))
    assert limits.jerk is not None
    order, trajectory, otg = ruckig.InputParameter(n), ruckig.Trajectory(n), ruckig.Ruckig(n)
    for name, state in (("current", start), ("target", goal)):
        setattr(order, f"{name}_position", state.q.tolist())
        setattr(order, f"{name}_velocity", state.dq.tolist())
        setattr(order, f"{name}_acceleration", state.ddq.tolist())
    shares = SHARE * velocity, SHARE * acceleration, SHARE * acceleration
    order.max_velocity, order.max_acceleration, order.max_jerk = (
        (share * limit).tolist()
        for share, limit in zip(shares, (limits.dq, limits.ddq, limits.jerk), strict=True)
    )
    try:
        # A joint may have no motion of that duration: then the duration grows.
        for _ in range(ROUNDINGS):
            result = otg.calculate(order, trajectory)
            if result not in (ruckig.Result.Working, ruckig.Result.Finished):
                return None
            ticks = math.ceil(trajectory.duration / TICK - 1e-6)
            if abs(trajectory.duration - TICK * ticks) < 1e-9:
                return Transfer(trajectory, goal, ticks)
            order.minimum_duration = TICK * ticks
    except ruckig.RuckigError:
        pass
    return None


def arm_excesses(arm: Arm, sent: Samples) -> list[Excess]:
    """The largest excess of samples (N, joints) of all joints over the real limits, by joint."""
    found = list[Excess]()
    # Joint by joint: an arm may have more joints than the core takes at once.
    for j in range(arm.joints):
        part = Samples(*(rows[:, j : j + 1] for rows in (sent.q, sent.dq, sent.ddq)))
        found += joint_excesses(joint_limits(arm, [j + 1]), (f"joint {j + 1}",), part)
    return found
