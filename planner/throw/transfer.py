"""Motions of all joints of an arm from one state of motion to another, in the least time: Ruckig's.

They keep the limits on velocity, acceleration and jerk; ranges of the joints and velocity limits
that depend on them are for the verdict.
"""

from __future__ import annotations

import math

import numpy as np

from ...models.robot import Arm
from .manipulator import State, joint_limits
from .sending import SHARE, TICK, Excess, Samples, joint_excesses

#: Most attempts at a duration of whole samples.
ROUNDINGS = 5


def transfer(
    arm: Arm, start: State, goal: State, velocity: float = 1.0, acceleration: float = 1.0
) -> Samples | None:
    """Samples (N, joints) every millisecond from the first state to the other one, both included.

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
    ticks = 0
    try:
        # A joint may have no motion of that duration: then the duration grows.
        for _ in range(ROUNDINGS):
            result = otg.calculate(order, trajectory)
            if result not in (ruckig.Result.Working, ruckig.Result.Finished):
                return None
            ticks = math.ceil(trajectory.duration / TICK - 1e-6)
            if abs(trajectory.duration - TICK * ticks) < 1e-9:
                break
            order.minimum_duration = TICK * ticks
        else:
            return None
    except ruckig.RuckigError:
        return None
    states = [trajectory.at_time(TICK * k) for k in range(ticks)]
    states.append((goal.q.tolist(), goal.dq.tolist(), goal.ddq.tolist()))
    return Samples(*np.moveaxis(np.array(states), 1, 0))


def arm_excesses(arm: Arm, sent: Samples) -> list[Excess]:
    """The largest excess of samples (N, joints) of all joints over the real limits, by joint."""
    found = list[Excess]()
    # Joint by joint: an arm may have more joints than the core takes at once.
    for j in range(arm.joints):
        part = Samples(*(rows[:, j : j + 1] for rows in (sent.q, sent.dq, sent.ddq)))
        found += joint_excesses(joint_limits(arm, [j + 1]), (f"joint {j + 1}",), part)
    return found
