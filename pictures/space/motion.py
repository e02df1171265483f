"""Throws and motions in space over time: poses of links, hand and objects in the base frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...models import Array, Indices, ReadOnly
from ...planner import PlanarArm, SpatialArm, Timeline, timeline
from ..drawings import cup_profile

if TYPE_CHECKING:
    from ...planner import Throw
    from ...problems import Pose, Scene, ThrowPlane


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
        if self.scene.opening is not None:
            cup = cup_profile(self.scene.opening)
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


@dataclass(frozen=True, eq=False)
class SpaceMotion(ReadOnly):
    """Throws as one motion, over times (N,) [s], every millisecond.

    names: of the objects. throws: each on a clock of its own, which begins at `begins` [s]; held
    [s]: from when on the hand carries the object. joints (N, n, 4, 4): the arm's frames after each
    joint; hand (N, 4, 4): as in `SpaceThrow`; all in the base frame.
    """

    name: str
    names: tuple[str, ...]
    throws: tuple[SpaceThrow, ...]
    begins: tuple[float, ...]
    held: tuple[float, ...]
    times: Array
    joints: Array
    hand: Array

    @property
    def is_single(self) -> bool:
        """Whether it is one throw of what the hand holds from the start."""
        return not self.names[0]

    @cached_property
    def _rows(self) -> tuple[Indices, ...]:
        """Indices (N,) into the times of each throw."""
        return tuple(
            np.clip(np.rint((self.times - begin) / 1e-3).astype(int), 0, len(throw.line.times) - 1)
            for throw, begin in zip(self.throws, self.begins, strict=True)
        )

    @cached_property
    def bars(self) -> tuple[Array, ...]:
        """Poses (N, 4, 4) of each object's CoM: at its pick, carried, thrown, at its end."""
        found = list[Array]()
        each = zip(self.throws, self.begins, self.held, self._rows, strict=True)
        for throw, begin, held, rows in each:
            in_hand = np.linalg.inv(throw.hand[0]) @ throw.bar[0]
            carrying = np.maximum(np.arange(len(self.times)), self.index(held))
            carried = self.hand[carrying] @ in_hand
            thrown = (self.times >= begin)[:, None, None]
            found.append(np.where(thrown, throw.bar[rows], carried))
        return tuple(found)

    def index(self, time: float) -> int:
        """Index of the instant nearest to `time` [s]."""
        return int(np.abs(self.times - time).argmin())

    def object_phase(self, number: int, index: int) -> str:
        """Phase of an object at an instant."""
        return self.throws[number].line.phase_name(int(self._rows[number][index]))

    def words(self, index: int) -> str:
        """The object that was taken last, its phase, and where it ends at its end."""
        time = float(self.times[index])
        number = max(0, sum(held <= time for held in self.held) - 1)
        phase = self.object_phase(number, index)
        phase = self.throws[number].line.end if phase == "landed" else phase
        return f"{self.names[number]}: {phase}" if self.names[number] else phase

    def since_detach(self, index: int) -> float:
        """Time [s] since the hand let go of the last object; negative while it holds one."""
        time, since = float(self.times[index]), math.inf
        for throw, begin, held in zip(self.throws, self.begins, self.held, strict=True):
            if held <= time:
                since = time - begin - throw.throw.detach_time
        return since

    def phases(self) -> dict[str, dict[str, float]]:
        """`SpaceThrow.phases` of each object, on the motion's clock."""
        each = zip(self.names, self.throws, self.begins, self.held, strict=True)
        return {
            name or "object": {
                phase: held if phase == "carry" else begin + time
                for phase, time in throw.phases().items()
            }
            for name, throw, begin, held in each
        }


def space_motion(throw: Throw) -> SpaceMotion:
    """The motion of one throw in space."""
    one = space_throw(throw)
    parts = ("",), (one,), (0.0,), (0.0,)
    return SpaceMotion(one.name, *parts, one.line.times, one.joints, one.hand)
