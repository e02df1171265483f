"""What a motion needs: the space that it sweeps, the load and the collision thresholds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array, held_wrench
from ..clearance import BAR, SweptBodies, bar_ends, bar_radii, held_bar
from .controller_files import JointMotion

#: Axes of the base frame.
AXES = "xyz"


def swept_bodies(motion: JointMotion, q: Array, times: Array) -> SweptBodies:
    """Links, hand and held bar in the base frame, with joints q (N, joints) at times (N,) [s].

    For an arm whose capsules are known.
    """
    throw, arm, capsules = motion.throw, motion.arm, motion.throw.manipulator.capsules
    assert capsules is not None
    links = _link_frames(motion)
    # (links, N, 4, 4), the base first.
    found = [np.array(v).T.reshape(-1, 4, 4).swapaxes(1, 2) for v in links.map(len(q))(q.T)]
    at = np.array([np.broadcast_to(np.eye(4), (len(q), 4, 4)), *found])
    bodies = [(c.link, np.array([c.begin, c.end])) for c in arm.capsules]
    radii = bar_radii(throw.scene.object)
    held = bar_ends(throw.scene.object, _held(motion))[:, :, ::2, 0]
    bodies += [(-1, ends) for ends in _in_hand(motion, held)]
    placed = [
        np.einsum("nij,kj->kin", at[link][:, :3, :3], two) + at[link][:, :3, 3].T
        for link, two in bodies
    ]
    cover = np.append(np.full(len(arm.capsules), arm.cover), np.zeros(len(radii)))
    radius = np.append(capsules.radius, radii)
    names = (*capsules.names, *[BAR] * len(radii))
    return SweptBodies(names, np.array(placed), radius, cover, times)


def _link_frames(motion: JointMotion) -> ca.Function:
    """4x4 poses of all links and the flange of the hand, by the joints."""
    arm = motion.arm
    angles = ca.SX.sym("q", arm.joints)
    frames = arm.frames(angles)
    hand = frames[-1] + 0
    hand[:3, 3] -= arm.tool.tcp * hand[:3, 2]
    return ca.Function("links", [angles], [ca.vec(f) for f in (*frames[: arm.joints], hand)])


def _held(motion: JointMotion) -> Array:
    """CoM pose (3, 1) of the object in the hand at the throw's start."""
    throw = motion.throw
    place = throw.path.at([0.0]).pose
    return held_bar(throw.scene, throw.manipulator.motion(place, 0 * place, 0 * place)[0])


def _in_hand(motion: JointMotion, points: Array) -> Array:
    """Points (..., 2) [m] of the throw's plane at its start, (..., 3) in the hand's frame, whose
    origin is on the flange."""
    placed = motion.throw.target.plane.points(points[..., 0], points[..., 1])
    grasp = np.array(_link_frames(motion)(motion.q[0])[-1]).reshape(4, 4, order="F")
    return np.asarray((placed - grasp[:3, 3]) @ grasp[:3, :3])


@dataclass(frozen=True)
class Expectations:
    """What a motion needs of its surroundings and of the controller.

    way (N, joints) [rad]: every millisecond to its start pose, if it is known.
    """

    motion: JointMotion
    way: Array | None = None

    @cached_property
    def swept(self) -> Array | None:
        """Lowest and highest place (2, 3) [m] of arm, hand and held bar in the base frame; None
        for an arm without capsules."""
        motion = self.motion
        if motion.throw.manipulator.capsules is None:
            return None
        q = motion.q if self.way is None else np.vstack([self.way, motion.q])
        q = q[np.unique(np.append(np.arange(0, len(q), 5), len(q) - 1))]
        bodies = swept_bodies(motion, q, np.arange(0.0, len(q)))
        parts = len(bar_radii(motion.throw.scene.object))
        moving = np.array([capsule.link > 0 for capsule in motion.arm.capsules] + [True] * parts)
        ends, around = bodies.ends[moving], bodies.reach[moving, None, None, None]
        low, high = ends - around, ends + around
        return np.array([low.min(axis=(0, 1, 3)), high.max(axis=(0, 1, 3))])

    @cached_property
    def flown(self) -> Array:
        """Lowest and highest place (2, 3) [m] of the object in the base frame until it lands."""
        throw, bar = self.motion.throw, self.motion.throw.scene.object
        x, z, _ = throw.flight(np.linspace(0.0, throw.landing.flight_time, 101))
        points = throw.target.plane.points(x, z)
        around = np.hypot(max(bar.com, bar.length - bar.com), bar.width / np.sqrt(2))
        return np.array([points.min(axis=0) - around, points.max(axis=0) + around])

    @cached_property
    def load(self) -> tuple[float, Array]:
        """Mass [kg] of the object, and its CoM (3,) [m] in the frame of the flange."""
        motion, bar = self.motion, self.motion.throw.scene.object
        com = _in_hand(motion, _held(motion)[:2, 0])
        angles = ca.SX.sym("q", motion.arm.joints)
        frames = motion.arm.frames(angles)
        turn = ca.Function("turn", [angles], [frames[-2][:3, :3].T @ frames[-1][:3, :3]])
        return bar.mass, np.array(turn(motion.q[0])) @ com

    @cached_property
    def thresholds(self) -> tuple[dict[int, float], float]:
        """Torque [N m] by joint and force [N] by which the controller errs because of the object:
        once it has left the hand, if it is set as load, and before that, if it is not."""
        throw, arm = self.motion.throw, self.motion.arm
        times = self.motion.times
        hand = throw.hand(times).motion
        x, z, _ = held_wrench(throw.scene.body, throw.scene.gravity, hand, throw.scene.grasp.angle)
        force = float(np.hypot(x, z).max())
        if not arm.links:
            return {}, force
        torques = throw.torques
        most = np.abs(torques.held - torques.free).max(axis=0)
        return dict(zip(arm.throwing_joints, most.tolist(), strict=True)), force

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units, base frame; the load in the flange's."""
        mass, com = self.load
        torque, force = self.thresholds
        swept = None if self.swept is None else _ranges(self.swept)
        return {
            "swept": swept,
            "flown": _ranges(self.flown),
            "load": {"mass": mass, "com": com.tolist()},
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
        mass, com = self.load
        torque, force = self.thresholds
        lines = [f"the object flies through {_range_words(self.flown)}, and on after its landing"]
        place = ", ".join(f"{value:.3f}" for value in com.round(3) + 0.0)
        lines.append(f"load to set: {mass:g} kg, CoM at [{place}] m from the flange (F_x_Cload)")
        if torque:
            limits = ", ".join(f"{value:.1f} N m (joint {j})" for j, value in torque.items())
            lines.append(
                f"collision thresholds: above {limits} and {force:.0f} N, by which the controller "
                "errs once the object has left the hand; what its model errs comes on top"
            )
        return "\n".join([self.swept_words, *(f"  {line}" for line in lines)])


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
