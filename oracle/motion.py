"""The sent motion, the arm's 3-D motion, and the hand's motion in the throw's plane.

In the plane: x forward, z up, angles counter-clockwise from x to z, so a turn about -y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly

Array = NDArray[np.float64]

#: Sampling interval [s] of motion.csv.
TICK = 1e-3
#: Number of parts of a tick between which the hand follows quintics.
PARTS = 4


def quintics(times: Array, q: Array, dq: Array, ddq: Array) -> PPoly:
    """Pieces with the given values, rates and accelerations (K, n) at both ends."""
    h = np.diff(times)[:, None]
    d = q[1:] - q[:-1] - h * dq[:-1] - h**2 / 2 * ddq[:-1]
    e, f = h * (dq[1:] - dq[:-1] - h * ddq[:-1]), h**2 * (ddq[1:] - ddq[:-1])
    c5, c4, c3 = 6 * d - 3 * e + f / 2, -15 * d + 7 * e - f, 10 * d - 4 * e + f / 2
    return PPoly(np.stack([c5 / h**5, c4 / h**4, c3 / h**3, ddq[:-1] / 2, dq[:-1], q[:-1]]), times)


@dataclass(frozen=True)
class Curve:
    """Coordinates over time, at rest before and after."""

    pieces: PPoly

    @cached_property
    def _derivatives(self) -> tuple[PPoly, PPoly]:
        return self.pieces.derivative(1), self.pieces.derivative(2)

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Values, rates and accelerations (..., n) at times (...) [s]."""
        first, last = self.pieces.x[[0, -1]]
        inside = ((t >= first) & (t <= last))[..., None]
        clipped = np.clip(t, first, last)
        rates, turns = (np.where(inside, curve(clipped), 0.0) for curve in self._derivatives)
        return self.pieces(clipped), rates, turns

    @property
    def end(self) -> float:
        return float(self.pieces.x[-1])

    def instants(self, until: float, parts: int) -> Array:
        """Instants up to `until` [s]: `parts` in a piece, both sides of its ends, and `until`."""
        x = self.pieces.x
        share = np.linspace(1e-6, 1 - 1e-6, parts)
        inside = (x[:-1, None] + np.diff(x)[:, None] * share).ravel()
        return np.append(inside[inside < until], min(until, self.end))


def rotation(rpy: Any) -> Array:
    """3x3: turns about the fixed axes x, y, z in turn."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ about_y @ about_x


@dataclass(frozen=True)
class Frame:
    """K poses of a rigid body: axes (K, 3, 3), origin, rates and accelerations (K, 3)."""

    axes: Array
    origin: Array
    omega: Array
    alpha: Array
    v: Array
    a: Array

    def point(self, place: Any) -> tuple[Array, Array, Array]:
        """Position, velocity, acceleration (K, 3) of a point given in the frame."""
        r = self.axes @ np.asarray(place, float)
        spin = np.cross(self.omega, r)
        turning = np.cross(self.alpha, r) + np.cross(self.omega, spin)
        return self.origin + r, self.v + spin, self.a + turning

    def moment(self, inertia: Array) -> Array:
        """Torque (K, 3) about its CoM of a body that moves along; inertia (3, 3): in the frame."""
        turned = self.axes @ inertia @ self.axes.transpose(0, 2, 1)
        spin = (turned @ self.omega[..., None])[..., 0]
        return (turned @ self.alpha[..., None])[..., 0] + np.cross(self.omega, spin)

    def fixed(self, place: Any, turn: Array) -> Frame:
        """A frame that moves along, at a place and turned in this one."""
        p, v, a = self.point(place)
        return Frame(self.axes @ turn, p, self.omega, self.alpha, v, a)

    def turned(self, q: Array, dq: Array, ddq: Array) -> Frame:
        """The frame after a joint about this one's z axis."""
        axis, zero, one = self.axes[:, :, 2], 0 * q, 0 * q + 1
        spin = np.array([[np.cos(q), -np.sin(q), zero], [np.sin(q), np.cos(q), zero]])
        turn = np.concatenate([spin, [[zero, zero, one]]]).transpose(2, 0, 1)
        omega = self.omega + axis * dq[:, None]
        alpha = self.alpha + axis * ddq[:, None] + np.cross(self.omega, axis) * dq[:, None]
        return Frame(self.axes @ turn, self.origin, omega, alpha, self.v, self.a)


def frames_of(arm: Any, q: Array, dq: Array, ddq: Array) -> list[Frame]:
    """Frames of the base, each joint, the hand (at the flange, turned as the tool) and the pads.

    q, dq, ddq (K, joints): all joints of an arm's data, modified Denavit-Hartenberg or URDF.
    """
    still, count = np.zeros((len(q), 3)), len(q)
    frames = [Frame(np.tile(np.eye(3), (count, 1, 1)), *[still] * 5)]
    for i, row in enumerate(arm.chain):
        if hasattr(row, "alpha"):
            turn = rotation((row.alpha, 0.0, 0.0))
            place = np.array([row.a, 0.0, 0.0]) + turn @ [0.0, 0.0, row.d]
        else:
            turn, place = rotation(row.rpy), np.array(row.xyz)
        frames.append(frames[-1].fixed(place, turn).turned(q[:, i], dq[:, i], ddq[:, i]))
    tool, turn = arm.tool, rotation(arm.tool.rpy)
    place = np.array(tool.xyz) + turn @ [0.0, 0.0, tool.flange]
    hand = frames[-1].fixed(place, turn @ rotation((0.0, 0.0, tool.rotation)))
    return [*frames, hand, hand.fixed((0.0, 0.0, tool.tcp), np.eye(3))]


@dataclass(frozen=True)
class Plane:
    """The throw's vertical plane in the base frame: azimuth [rad], lateral [m] to the left."""

    azimuth: float = 0.0
    lateral: float = 0.0

    @property
    def ways(self) -> tuple[Array, Array]:
        """Along the plane, and to its left."""
        c, s = math.cos(self.azimuth), math.sin(self.azimuth)
        return np.array([c, s, 0.0]), np.array([-s, c, 0.0])

    def points(self, x: Array, z: Array) -> Array:
        """(..., 3) in the base frame."""
        along, left = self.ways
        return x[..., None] * along + self.lateral * left + z[..., None] * [0.0, 0.0, 1.0]


@dataclass(frozen=True)
class Samples:
    """motion.csv: times (K,) [s], all joints, or x, z, theta of a free hand, (K, n)."""

    times: Array
    q: Array
    dq: Array
    ddq: Array


class ArmMotion:
    """An arm along its samples. throwing: the joints that throw, from 0."""

    def __init__(self, arm: Any, throwing: list[int], samples: Samples) -> None:
        self.arm, self.throwing, self.samples = arm, throwing, samples
        self.joints = Curve(quintics(samples.times, samples.q, samples.dq, samples.ddq))
        azimuth = arm.azimuth_joint - 1
        at_rest = frames_of(arm, *(values[:1] for values in (samples.q, samples.dq, samples.ddq)))
        up = at_rest[arm.azimuth_joint].axes[0, 2, 2]
        turn = float((samples.q[0, azimuth] - arm.posture[azimuth]) / up)
        self.plane = Plane(turn, float(Plane(turn).ways[1] @ at_rest[-1].origin[0]))
        self.turns = self._turns()
        ticks = np.unique(np.append(np.arange(0.0, self.joints.end, TICK / PARTS), self.joints.end))
        self.hand = Curve(quintics(ticks, *self._in_plane(ticks)))

    def frames(self, t: Array) -> list[Frame]:
        return frames_of(self.arm, *self.joints.at(t))

    def _turns(self) -> float:
        """The approach axis' angle at rest: unwrapped from where the throwing joints are at 0."""
        q = np.tile(self.samples.q[0], (400, 1))
        q[:, self.throwing] *= np.linspace(0.0, 1.0, 400)[:, None]
        axis = frames_of(self.arm, q, 0 * q, 0 * q)[-1].axes[:, :, 2]
        # An axis along -x is at +pi, whatever the sign of its rounding.
        up, along = np.round([axis[:, 2], axis @ self.plane.ways[0]], 12) + 0.0
        return float(np.unwrap(np.arctan2(up, along))[-1])

    def _in_plane(self, t: Array) -> tuple[Array, Array, Array]:
        """x, z, theta of the pads' centre, and their derivatives, (K, 3) each."""
        pads, (along, left) = self.frames(t)[-1], self.plane.ways
        axis = pads.axes[:, :, 2]
        theta = np.unwrap(np.arctan2(axis[:, 2], axis @ along))
        theta += self.turns - theta[0]
        linear = [np.column_stack([v @ along, v[:, 2]]) for v in (pads.origin, pads.v, pads.a)]
        angles = theta, -pads.omega @ left, -pads.alpha @ left
        return tuple(np.column_stack(pair) for pair in zip(linear, angles, strict=True))  # type: ignore[return-value]

    def off_plane(self, t: Array) -> Array:
        """How far (K,) [m] the pads' centre is beside the throw's plane."""
        return np.asarray(self.frames(t)[-1].origin @ self.plane.ways[1] - self.plane.lateral)

    def tool_speed(self, t: Array) -> Array:
        """The higher speed (K,) [m/s] of flange and pads' centre."""
        *_, hand, pads = self.frames(t)
        return np.maximum(np.linalg.norm(hand.v, axis=1), np.linalg.norm(pads.v, axis=1))

    def torques(self, t: Array, gravity: float) -> tuple[Array, Array]:
        """Torques (K, n) [N m] of the throwing joints with an empty hand, by virtual work, and the
        Jacobian (K, n, 3) of the pads' centre, x, z [m] and theta [rad], for those of the load."""
        frames, (along, left) = self.frames(t), self.plane.ways
        empty, lever = [], []
        for joint in self.throwing:
            axis = frames[joint + 1].axes[:, :, 2]
            moves = np.cross(axis, frames[-1].origin - frames[joint + 1].origin)
            empty.append(joint_torque(self.arm, frames, joint, gravity))
            lever.append(np.column_stack([moves @ along, moves[:, 2], -axis @ left]))
        return np.array(empty).T, np.array(lever).transpose(1, 0, 2)

    def heights(self, t: Array) -> Array:
        """Height (K,) [m] of the lowest joint's frame that throws or comes after, hand or pads."""
        return np.min([f.origin[:, 2] for f in self.frames(t)[self.throwing[0] + 1 :]], axis=0)

    def capsules(self, t: Array) -> Array:
        """Ends (C, 2, K, 3) [m] of the links' shapes."""
        frames = self.frames(t)
        ends = [[frames[c.link].point(e)[0] for e in (c.begin, c.end)] for c in self.arm.capsules]
        return np.array(ends).reshape(-1, 2, t.size, 3)


def joint_torque(arm: Any, frames: list[Frame], j: int, gravity: float) -> Array:
    """Torque (K,) [N m] of joint j, counted from 0, that moves and bears the links after it."""
    joint, total = frames[j + 1], np.zeros(len(frames[0].origin))
    for frame, link in zip(frames[j + 1 : -1], arm.links[j:], strict=True):
        xx, xy, xz, yy, yz, zz = link.inertia
        moment = frame.moment(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        place, _, a = frame.point(link.com)
        force = link.mass * (a + np.array([0.0, 0.0, gravity]))
        moment = moment + np.cross(place - joint.origin, force)
        total += (joint.axes[:, :, 2] * moment).sum(axis=1)
    return total


class HandMotion:
    """A free planar hand along its samples."""

    def __init__(self, samples: Samples) -> None:
        self.samples, self.plane = samples, Plane()
        self.hand = Curve(quintics(samples.times, samples.q, samples.dq, samples.ddq))
