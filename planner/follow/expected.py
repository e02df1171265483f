"""The throw that is expected of what is sent, and how far off a moving target it lands."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

from ...models import Array, Trajectory
from ...problems import Pose
from ..throw import TICK, Throw


@dataclass(frozen=True, eq=False)
class ExpectedThrow:
    """The throw that is expected of what is sent, and of a target that is somewhere `now` [s].

    joints (3, N, n): its joints, rates and accelerations, of which those after the pads' opening
    count for the way to rest only.
    """

    throw: Throw
    joints: Array
    target: Pose
    now: float

    @property
    def goal(self) -> Pose:
        """Where the target is when the object lands."""
        if not self.target.speed or not self.throw.lands:
            return self.target
        return self.target.changed(since=self.now).at(self.throw.landing_time)

    @cached_property
    def off(self) -> tuple[float, float]:
        """How far off it lands: dx [m], dtheta [rad]."""
        return self.throw.miss(self.goal)

    @property
    def pose_error(self) -> float:
        """Pose error [m] (39) of the expected landing; inf where it does not come down."""
        dx, dtheta = self.off
        pose_error = self.throw.scene.object.pose_error(dx, dtheta)
        return pose_error if math.isfinite(pose_error) else math.inf

    def moved(self, joints: Array) -> ExpectedThrow:
        """Of other joints."""
        throw = dataclasses.replace(self.throw, path=Trajectory.quintics(TICK, *joints))
        return ExpectedThrow(throw, joints, self.target, self.now)
