"""An arm in space: frames, velocities, accelerations and torques of all joints, for N states."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..body import Array, ReadOnly
from .arm import Arm, LinkInertia

#: Gravity, linear and angular quantities are columns (3, 1) of the base frame.
Column = ca.SX


@dataclass(frozen=True, eq=False)
class PadMotion(ReadOnly):
    """N states of the pads in the base frame: pose (N, 4, 4), z the approach axis and y the axis
    along which they close; velocity and acceleration of their centre, angular velocity and
    acceleration, each (N, 3) [m, rad, s]; flange_velocity (N, 3) [m/s]."""

    pose: Array
    velocity: Array
    acceleration: Array
    omega: Array
    alpha: Array
    flange_velocity: Array


@dataclass(frozen=True)
class SpatialArm:
    """Kinematics and dynamics of an arm with all its joints.

    Newton and Euler's equations, as of `PlanarDynamics`: it neglects friction and rotors of the
    drives. Joints q, dq, ddq are (N, joints) [rad and per s, s^2].
    """

    arm: Arm

    def frames(self, q: Array) -> Array:
        """4x4 poses (joints + 2, N, 4, 4): base, links, then the hand as in `Arm.links`."""
        flat = self._frames.map(len(q))(q.T)
        found = [np.array(values).T.reshape(-1, 4, 4).swapaxes(1, 2) for values in flat]
        return np.array([np.broadcast_to(np.eye(4), (len(q), 4, 4)), *found])

    def pads(self, q: Array, dq: Array, ddq: Array) -> PadMotion:
        """The motion of the pads."""
        pose, *rest = (np.array(value).T for value in self._pads.map(len(q))(q.T, dq.T, ddq.T))
        return PadMotion(pose.reshape(-1, 4, 4).swapaxes(1, 2), *rest)

    def torques(self, q: Array, dq: Array, ddq: Array, gravity: float, load: Array) -> Array:
        """Torque (N, joints) [N m] of each joint; for an arm with link masses.

        load (N, 6): force [N], and torque about the pads' centre [N m], that the hand gives to what
        it holds, in the base frame.
        """
        found = self._torques.map(len(q))(q.T, dq.T, ddq.T, gravity, load.T)
        return np.array(found).T

    @functools.cached_property
    def _frames(self) -> ca.Function:
        q = ca.SX.sym("q", self.arm.joints)
        frames = [*self.arm.frames(q)[: self.arm.joints], _hand(self.arm, q)]
        return ca.Function("frames", [q], [ca.vec(ca.densify(frame)) for frame in frames])

    @functools.cached_property
    def _pads(self) -> ca.Function:
        states, frames, spins, moves = _motions(self.arm)
        *_, flange, pads = frames
        omega, alpha = spins[-1]
        _, velocity, acceleration = _point(moves[-1], spins[-1], pads[:3, 3])
        _, flange_velocity, _ = _point(moves[-1], spins[-1], flange[:3, 3])
        outputs = ca.vec(ca.densify(pads)), velocity, acceleration, omega, alpha, flange_velocity
        return ca.Function("pads", states, list(outputs))

    @functools.cached_property
    def _torques(self) -> ca.Function:
        arm, (states, frames, spins, moves) = self.arm, _motions(self.arm)
        gravity, load = ca.SX.sym("g"), ca.SX.sym("load", 6)
        bodies = [*frames[: arm.joints], _hand(arm, states[0])]
        # Of what a joint carries, from the pads down: force, and torque about the base's origin.
        force, about = load[:3], load[3:] + ca.cross(frames[-1][:3, 3], load[:3])
        found = list[ca.SX]()
        for number in reversed(range(len(bodies))):
            joint = min(number, arm.joints - 1)
            push, moment = _push(
                arm.links[number], bodies[number], spins[joint], moves[joint], gravity
            )
            force, about = force + push, about + moment
            if number < arm.joints:
                axis, place = bodies[number][:3, 2], bodies[number][:3, 3]
                found.append(ca.dot(axis, about - ca.cross(place, force)))
        return ca.Function("torques", [*states, gravity, load], [ca.vertcat(*found[::-1])])


def _hand(arm: Arm, q: ca.SX) -> ca.SX:
    """4x4: the hand as in `Arm.links`, turned by the tool's rotation, at the flange."""
    hand = arm.frames(q)[-1] + 0
    hand[:3, 3] -= arm.tool.tcp * hand[:3, 2]
    return hand


def _motions(
    arm: Arm,
) -> tuple[list[ca.SX], list[ca.SX], list[Sequence[Column]], list[Sequence[Column]]]:
    """Symbols q, dq, ddq; all frames; angular velocity and acceleration of each link, and place,
    velocity and acceleration of its joint."""
    states = [ca.SX.sym(name, arm.joints) for name in ("q", "dq", "ddq")]
    frames, zero = arm.frames(states[0]), ca.SX.zeros(3)
    spins: list[Sequence[Column]] = []
    moves: list[Sequence[Column]] = []
    spin, move = (zero, zero), (zero, zero, zero)
    for i, frame in enumerate(frames[: arm.joints]):
        axis, (omega, alpha) = frame[:3, 2], spin
        move = _point(move, spin, frame[:3, 3])
        turning = axis * states[2][i] + ca.cross(omega, axis) * states[1][i]
        spin = omega + axis * states[1][i], alpha + turning
        spins.append(spin)
        moves.append(move)
    return states, frames, spins, moves


def _point(
    move: Sequence[Column], spin: Sequence[Column], place: Column
) -> tuple[Column, Column, Column]:
    """Place, velocity and acceleration of a point of a body."""
    (origin, velocity, acceleration), (omega, alpha) = move, spin
    arm = place - origin
    swing = ca.cross(omega, arm)
    return place, velocity + swing, acceleration + ca.cross(alpha, arm) + ca.cross(omega, swing)


def _push(
    link: LinkInertia, frame: ca.SX, spin: Sequence[Column], move: Sequence[Column], gravity: ca.SX
) -> tuple[Column, Column]:
    """Force [N], and torque about the base's origin [N m], that moves a link."""
    (xx, xy, xz, yy, yz, zz), (omega, alpha), axes = link.inertia, spin, frame[:3, :3]
    tensor = axes @ ca.DM([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T
    place, _, a = _point(move, spin, frame[:3, 3] + axes @ ca.DM(link.com))
    force = link.mass * (a + ca.vertcat(0, 0, gravity))
    moment = tensor @ alpha + ca.cross(omega, tensor @ omega)
    return force, moment + ca.cross(place, force)
