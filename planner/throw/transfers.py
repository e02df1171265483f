"""Motions of joints from one state of motion to another, in the least time: Ruckig's.

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
from .manipulator import Limits, State, joint_limits
from .sent_samples import SHARE, TICK, Excess, Samples, joint_excesses

if TYPE_CHECKING:
    import ruckig

#: Most attempts at a duration of whole samples.
ROUNDINGS = 5


@dataclass(frozen=True)
class Transfer:
    """A motion of n joints between two states of motion, in whole samples.

    ticks: number of samples after the first one.
    """

    trajectory: ruckig.Trajectory = field(repr=False)
    goal: State
    ticks: int

    @cached_property
    def samples(self) -> Samples:
        """Samples (N, n) every millisecond, with both states."""
        rows = np.empty((3, self.ticks + 1, len(self.goal.q)))
        rows[:, -1] = self.goal.q, self.goal.dq, self.goal.ddq
        times = TICK * np.arange(self.ticks)
        for j, profile in enumerate(self.trajectory.profiles[0]):
            # Seven phases of constant jerk, after up to two that brake to the limits.
            parts = profile.brake, profile
            starts = np.cumsum([0.0, *(t for part in parts for t in part.t)])[:-1]
            phase = np.searchsorted(starts, times, "right") - 1
            p, v, a, jerk = (
                np.array([x for part in parts for x in getattr(part, name)[: len(part.t)]])[phase]
                for name in "pvaj"
            )
            u = times - starts[phase]
            rows[0, :-1, j] = p + u * (v + u * (a / 2 + u * jerk / 6))
            rows[1, :-1, j] = v + u * (a + u * jerk / 2)
            rows[2, :-1, j] = a + u * jerk
        return Samples(*rows)


def transfer(
    limits: Limits,
    start: State,
    goal: State,
    velocity: float = 1.0,
    acceleration: float = 1.0,
    ticks: int = 0,
) -> Transfer | None:
    """The motion of joints from the first state to the other one in the least time.

    velocity, acceleration: shares of the limits on velocity, and on acceleration and jerk. ticks:
    least number of samples. None if a state is beyond these.
    """
    import ruckig

    n = len(limits.dq)
    order, trajectory, otg = ruckig.InputParameter(n), ruckig.Trajectory(n), ruckig.Ruckig(n)
    for name, state in (("current", start), ("target", goal)):
        setattr(order, f"{name}_position", state.q.tolist())
        setattr(order, f"{name}_velocity", state.dq.tolist())
        setattr(order, f"{name}_acceleration", state.ddq.tolist())
    order.max_velocity = (SHARE * velocity * limits.dq).tolist()
    order.max_acceleration = (SHARE * acceleration * limits.ddq).tolist()
    order.max_jerk = (SHARE * acceleration * limits.jerk).tolist()
    try:
        # A joint may have no motion of that duration: then the duration grows.
        for _ in range(ROUNDINGS):
            order.minimum_duration = TICK * ticks
            result = otg.calculate(order, trajectory)
            if result not in (ruckig.Result.Working, ruckig.Result.Finished):
                return None
            ticks = math.ceil(trajectory.duration / TICK - 1e-6)
            if abs(trajectory.duration - TICK * ticks) < 1e-9:
                return Transfer(trajectory, goal, ticks)
    except ruckig.RuckigError:
        pass
    return None


def arm_excesses(arm: Arm, sent: Samples) -> list[Excess]:
    """The largest excess of samples (N, joints) of all joints over the real limits, by joint."""
    found = list[Excess]()
    # Joint by joint: an arm may have more joints than the core takes at once.
    for j in range(arm.joints):
        found += joint_excesses(joint_limits(arm, [j + 1]), (f"joint {j + 1}",), sent[:, j : j + 1])
    return found
