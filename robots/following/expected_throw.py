"""The throw expected from what is sent, and its landing error to a moving target."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

from ...models import Array, Trajectory
from ...planner import TICK, Throw
from ...problems import Pose


@dataclass(frozen=True, eq=False)
class ExpectedThrow:
    """The throw expected from what is sent, to a target given at time `now` [s].

    joints (3, N, n): expected joints, rates and accelerations; those after the pads' opening are
    the way to rest.
    """

    throw: Throw
    joints: Array
    target: Pose
    now: float

    @property
    def goal(self) -> Pose:
        """The target's pose when the object lands."""
        if not self.target.speed or not self.throw.lands:
            return self.target
        return self.target.changed(since=self.now).at(self.throw.landing_time)

    @cached_property
    def off(self) -> tuple[float, float]:
        """Landing error: dx [m], dtheta [rad]."""
        return self.throw.miss(self.goal)

    @property
    def pose_error(self) -> float:
        """Pose error [m] (39) of the expected landing; inf without a landing."""
        dx, dtheta = self.off
        pose_error = self.throw.scene.object.pose_error(dx, dtheta)
        return pose_error if math.isfinite(pose_error) else math.inf

    def moved(self, joints: Array) -> ExpectedThrow:
        """The throw with other joints."""
        throw = dataclasses.replace(self.throw, path=Trajectory.quintics(TICK, *joints))
        return ExpectedThrow(throw, joints, self.target, self.now)
