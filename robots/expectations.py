"""What a motion needs: the space that it sweeps, the load and the collision thresholds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..models import Array
from ..planner import SentMotion, SpatialScene, SweptBodies, bar_radii
from .gripper import FORCES
from .motions import arm_of, grasp_of, parts_of

#: Torques [N m] below this are not named.
UNFELT = 0.05
#: Axes of the base frame.
AXES = "xyz"


def swept_bodies(space: SpatialScene, q: Array, times: Array, *, held: bool = True) -> SweptBodies:
    """Arm with joints q (N, joints) at times (N,) [s], and the object in its hand if it is held;
    in the base frame. For an arm whose capsules are known."""
    bar = space.held_ends(space.spatial.pads(q, 0 * q, 0 * q)) if held else None
    return space.bodies(q, times, bar)


@dataclass(frozen=True)
class Expectations:
    """What a motion needs of its surroundings and of the controller.

    way (N, joints) [rad]: every millisecond to its start pose, if it is known.
    """

    motion: SentMotion
    way: Array | None = None

    @cached_property
    def swept(self) -> Array | None:
        """Lowest and highest place (2, 3) [m] of arm, hand and object in the base frame, as if the
        hand held one all the time; None for an arm without capsules."""
        motion = self.motion
        if motion.throw.manipulator.capsules is None:
            return None
        ways = [(motion.carries[k].space, motion.q[part]) for k, part in parts_of(motion)]
        ways += [] if self.way is None else [(motion.carries[0].space, self.way)]
        low, high = zip(*(_extent(space, q) for space, q in ways), strict=True)
        return np.array([np.min(low, axis=0), np.max(high, axis=0)])

    @cached_property
    def flown(self) -> Array:
        """Lowest and highest place (2, 3) [m] of the objects in the base frame until they land."""
        low, high = list[Array](), list[Array]()
        for throw in (carry.throw for carry in self.motion.carries):
            bar = throw.scene.object
            x, z, _ = throw.flight(np.linspace(0.0, throw.landing.flight_time, 101))
            points = throw.target.plane.points(x, z)
            around = np.hypot(max(bar.com, bar.length - bar.com), bar.width / np.sqrt(2))
            low.append(points.min(axis=0) - around)
            high.append(points.max(axis=0) + around)
        return np.array([np.min(low, axis=0), np.max(high, axis=0)])

    @cached_property
    def loads(self) -> dict[str, tuple[float, Array]]:
        """Mass [kg] of each object, and its CoM (3,) [m] in the frame of the flange."""
        arm = arm_of(self.motion)
        *_, flange, hand = arm.placed(self.motion.q[0].tolist())
        to_flange, pads = flange[:3, :3].T @ hand[:3, :3], np.array([0.0, 0.0, arm.tool.tcp])
        return {
            one.name: (one.throw.scene.object.mass, to_flange @ (pads + one.space.com_in_hand))
            for one in self.motion.carries
        }

    @cached_property
    def thresholds(self) -> tuple[dict[int, float], float]:
        """Torque [N m] by joint and force [N] by which the controller errs because of the object:
        while the hand does not hold it, if it is set as load, and while it does, if it is not."""
        motion, arm = self.motion, arm_of(self.motion)
        torque, force = np.zeros(arm.joints), 0.0
        for number, part in parts_of(motion):
            q, dq, ddq = motion.samples[part].rows
            space = motion.carries[number].space
            gravity = space.scene.gravity
            load = np.hstack(space.object_wrench(space.spatial.pads(q, dq, ddq)))
            force = max(force, float(np.linalg.norm(load[:, :3], axis=1).max()))
            if arm.links:
                free = space.spatial.torques(q, dq, ddq, gravity, 0 * load)
                change = np.abs(space.spatial.torques(q, dq, ddq, gravity, load) - free)
                torque = np.maximum(torque, change.max(axis=0))
        felt = np.flatnonzero(torque > UNFELT) + 1
        return {int(j): float(torque[j - 1]) for j in felt}, force

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units, base frame; the load in the flange's."""
        loads = [{"mass": mass, "com": com.tolist()} for mass, com in self.loads.values()]
        torque, force = self.thresholds
        swept = None if self.swept is None else _ranges(self.swept)
        return {
            "swept": swept,
            "flown": _ranges(self.flown),
            "load": loads,
            "thresholds": {
                "torque": {str(j): value for j, value in torque.items()},
                "force": force,
            },
        }

    @property
    def swept_words(self) -> str:
        """The space that the arm sweeps, as a line for people."""
        if self.swept is None:
            return "  the arm file has no capsules: the space that the arm sweeps is not known"
        words = f"  arm, hand and held object sweep {_range_words(self.swept)}"
        if self.swept[0, 0] < 0.0:
            words += f", {-self.swept[0, 0]:.2f} m behind the base's axis"
        return words

    @property
    def words(self) -> str:
        """All of it as lines for people."""
        torque, force = self.thresholds
        what, while_empty = "object flies", "once the object has left the hand"
        if self.motion.picks:
            what, while_empty = "objects fly", "while the hand is empty"
        lines = [f"the {what} through {_range_words(self.flown)}, and on after landing"]
        alike = dict[str, list[str]]()
        for name, (mass, com) in self.loads.items():
            place = ", ".join(f"{value:.3f}" for value in com.round(3) + 0.0)
            alike.setdefault(f"{mass:g} kg, CoM at [{place}] m", []).append(name)
        for load, names in alike.items():
            whose = f" for {', '.join(names)}" if len(alike) > 1 else ""
            lines.append(f"load to set{whose}: {load} from the flange (F_x_Cload)")
        if torque:
            limits = ", ".join(f"{value:.1f} N m (joint {j})" for j, value in torque.items())
            lines.append(
                f"collision thresholds: above {limits} and {force:.0f} N, by which the controller "
                f"errs {while_empty}; what its model errs comes on top"
            )
        grip = max(grasp_of(carry).force for carry in self.motion.carries)
        if grip > FORCES[0]:
            lines.append(
                f"grip force: {grip:g} N; a Franka Hand keeps {FORCES[0]:g} N for long, and "
                f"has {FORCES[1]:g} N at most"
            )
        return "\n".join([self.swept_words, *(f"  {line}" for line in lines)])


def _extent(space: SpatialScene, q: Array) -> Array:
    """Lowest and highest place (2, 3) [m] of what moves with joints q (N, joints)."""
    q = q[np.unique(np.append(np.arange(0, len(q), 5), len(q) - 1))]
    bodies = swept_bodies(space, q, np.arange(0.0, len(q)))
    parts = len(bar_radii(space.scene.object))
    capsules = space.kinematics.arm.capsules
    moving = np.array([capsule.link > 0 for capsule in capsules] + [True] * parts)
    ends, around = bodies.ends[moving], bodies.radius[moving, None, None, None]
    low, high = ends - around, ends + around
    return np.array([low.min(axis=(0, 1, 3)), high.max(axis=(0, 1, 3))])


def _ranges(ends: Array) -> dict[str, list[float]]:
    return {axis: ends[:, i].tolist() for i, axis in enumerate(AXES)}


def _range_words(ends: Array) -> str:
    """Ranges (2, 3) [m] in words."""
    return (
        ", ".join(
            f"{axis} {low:.2f} to {high:.2f}"
            for axis, (low, high) in zip(AXES, ends.T, strict=True)
        )
        + " m"
    )
