"""A throw in space over time: poses of links, hand and bar in the base frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...models import Array
from ...models.robot import PlanarArm, SpatialArm
from .drawings import cup_profile
from .timeline import Timeline, timeline

if TYPE_CHECKING:
    from ...problems import Pose, Scene, ThrowPlane
    from ..throw import Throw


@dataclass(frozen=True)
class SpaceThrow:
    """4x4 poses in the base frame over `line.times` (N,).

    hand (N, 4, 4): at the pads' centre, x the approach axis, z the plane's normal, which
    the pads press along; bar (N, 4, 4): at the CoM, x along the bar. joints (N, n, 4, 4):
    the arm's frames after each joint, n = 0 for a hand.
    """

    throw: Throw
    line: Timeline
    hand: Array
    bar: Array
    joints: Array

    @property
    def scene(self) -> Scene:
        """The scene, aimed at the target."""
        return self.throw.scene

    @property
    def name(self) -> str:
        """The scene's name."""
        return self.scene.name

    @property
    def plane(self) -> ThrowPlane:
        """The throw's plane in the base frame."""
        return self.throw.target.plane

    def phases(self) -> dict[str, float]:
        """First instant [s] of each phase that occurs, and of the landing.

        On the limit surface pivoting and sliding start together; the phase is then slide.
        """
        opening = self.throw.opening_time
        found = {"carry": 0.0, "stick": opening}
        for name, onset in zip(("pivot", "slide"), self.throw.deciding.onsets, strict=True):
            if onset is not None:
                found[name] = opening + float(onset)
        if found.get("pivot", -1.0) == found.get("slide"):
            del found["pivot"]
        return found | {"flight": self.throw.detach_time, "landing": self.throw.landing_time}

    def shown_phases(self) -> dict[str, float]:
        """`phases`, and the motion after the landing where it is followed."""
        landed = {"landed": self.throw.landing_time} if self.line.end else {}
        return self.phases() | landed

    def target(self, target: Pose | None = None) -> Array:
        """Pose (4, 4) of a target, default the throw's; of a region that nearest to the landing;
        the landing's angle if its own is open."""
        x, _, landed = map(float, self.line.com[:, self.line.index(self.throw.landing_time)])
        target = (target or self.throw.target).nearest(x, landed)
        theta = landed if target.theta is None else target.theta
        poses = target.plane.poses(np.array([[target.plane_x], [target.z], [theta]]))
        return np.asarray(poses[0])

    def extent(self) -> tuple[Array, Array]:
        """Least and largest (x, z) in the plane of what moves, the cup and an arm's base."""
        low, high = self.line.extent(self.scene)
        if self.scene.cup is not None:
            cup = cup_profile(self.scene.cup)
            low, high = np.minimum(low, cup.min(axis=0)), np.maximum(high, cup.max(axis=0))
        if self.scene.arm is not None:
            low, high = np.minimum(low, [-0.1, 0.0]), np.maximum(high, [0.1, 0.0])
        return low, high


def space_throw(throw: Throw) -> SpaceThrow:
    """The throw in space every millisecond, see `timeline`."""
    line, plane = timeline(throw), throw.target.plane
    hand, bar = plane.poses(line.hand), plane.poses(line.com)
    joints = np.empty((len(line.times), 0, 4, 4))
    arm = throw.manipulator.kinematics
    if isinstance(arm, PlanarArm):
        q = arm.all_joints(throw.path.at(line.times).pose.T, plane.azimuth)
        joints = SpatialArm(arm.arm).frames(q)[1:-1].swapaxes(0, 1)
    return SpaceThrow(throw, line, hand, bar, joints)
