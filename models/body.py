"""A rigid planar body, gripped by two pads or in flight: its parameters and kinematics.

The equations are written component by component with the few functions of `backend`, so
that the same lines run on floats, on NumPy arrays (N throws) and on CasADi expressions.

Frame: x forward, z up, angles counter-clockwise from +x towards +z, unwrapped; SI units.
The contact point is the point of the body under the centre of the pads, `r = (x_r, z_r)`
is the CoM seen from it. Source: (11)-(15), (28)-(33) of Liu and Billard, "On Transient
Release Dynamics in Robot Throwing: A Sliding Pivot Model".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Protocol

import casadi as ca
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int_]
#: float, NumPy array of shape (N,), or a scalar CasADi SX/MX expression.
Value = Any

_NUMPY = SimpleNamespace(
    sqrt=np.sqrt, sin=np.sin, cos=np.cos, maximum=np.maximum, minimum=np.minimum, where=np.where
)
_CASADI = SimpleNamespace(
    sqrt=ca.sqrt, sin=ca.sin, cos=ca.cos, maximum=ca.fmax, minimum=ca.fmin, where=ca.if_else
)


def backend(*values: Value) -> SimpleNamespace:
    """Functions that suit `values`: CasADi's if any of them is symbolic, else NumPy's."""
    for value in values:  # called in every step of a batch: no generator
        if isinstance(value, ca.SX | ca.MX):
            return _CASADI
    return _NUMPY


def components(vector: Value) -> tuple[Value, ...]:
    """Rows of a CasADi column or of an array (rows, ...) as separate values."""
    if isinstance(vector, ca.SX | ca.MX):
        return tuple(ca.vertsplit(vector))
    return tuple(vector)


@dataclass(frozen=True)
class Body:
    """mass [kg], inertia about the CoM [kg m^2], com_offset [m].

    `com_offset` is h, the distance from the grasped point to the CoM along the body's
    long axis.
    """

    mass: Value
    inertia: Value
    com_offset: Value

    @property
    def grasp_inertia(self) -> Value:
        """J = m h^2 + I [kg m^2], the inertia about the grasped point."""
        return self.mass * self.com_offset * self.com_offset + self.inertia


@dataclass(frozen=True)
class Contact:
    """Pad patch: friction [-], patch_radius r_p [m], torsion c [-], number of faces [-].

    The normal force is that of one pad; a bar pinched between two pads has two faces, and
    both friction limits count each of them.
    """

    friction: Value
    patch_radius: Value
    torsion: Value = 0.6
    faces: Value = 2

    def force_limit(self, normal_force: Value) -> Value:
        """f_max = faces mu f_N [N], the largest tangential force."""
        return self.faces * self.friction * normal_force

    @property
    def torsion_arm(self) -> Value:
        """c r_p [m]: the torsional limit is tau_max = c r_p f_max."""
        return self.torsion * self.patch_radius

    def utilisation_squared(
        self, force_x: Value, force_z: Value, torque: Value, normal_force: Value
    ) -> Value:
        """(|f|/f_max)^2 + (tau/tau_max)^2: below 1 inside the ellipsoidal limit surface (19)."""
        limit = self.force_limit(normal_force)
        arm = self.torsion_arm
        return (force_x**2 + force_z**2 + (torque / arm) ** 2) / limit**2


@dataclass(frozen=True)
class HandMotion:
    """Hand angle [rad], angular rate [rad/s], acceleration (a_x, a_z) [m/s^2], alpha [rad/s^2]."""

    theta: Value
    omega: Value
    a_x: Value
    a_z: Value
    alpha: Value


@dataclass(frozen=True)
class HandSamples:
    """Hand pose, twist and acceleration, each (3, K), at `times` (K,) [s].

    Rows: x, z [m], theta [rad] and their first and second derivatives. For a batch of N
    throws each is (3, K, N); at one instant (3,), or (3, N).
    """

    times: Value
    pose: Array
    twist: Array
    acceleration: Array

    @property
    def motion(self) -> HandMotion:
        """What the contact equations need."""
        return HandMotion(self.pose[2], self.twist[2], *components(self.acceleration))

    def __iter__(self) -> Iterator[Array]:
        """pose, twist, acceleration."""
        return iter((self.pose, self.twist, self.acceleration))

    def every(self, first: int, stride: int) -> HandSamples:
        """Every `stride`-th sample from `first` on."""
        part = slice(first, None, stride)
        return HandSamples(self.times[part], *(rows[:, part] for rows in self))


def hand_of(numbers: Value) -> HandSamples:
    """The hand at one instant from its nine numbers: pose, twist, acceleration."""
    return HandSamples(0.0, numbers[:3], numbers[3:6], numbers[6:9])


class HandTrack(Protocol):
    """A hand motion over time, counted from the start of the opening."""

    def at(self, times: Array) -> HandSamples:
        """The hand at `times` (K,) [s]."""


def contact_twist(
    v_x: Value, v_z: Value, omega: Value, x_r: Value, z_r: Value
) -> tuple[Value, Value, Value]:
    """v^c = G v^o: twist of the body's contact point from its CoM twist, (11)-(12)."""
    return v_x + omega * z_r, v_z - omega * x_r, omega


def com_twist(
    v_x: Value, v_z: Value, omega: Value, x_r: Value, z_r: Value
) -> tuple[Value, Value, Value]:
    """v^o = G^-1 v^c: twist of the CoM from the contact point's, the inverse of (12)."""
    return v_x - omega * z_r, v_z + omega * x_r, omega


def com_wrench(
    f_x: Value, f_z: Value, torque: Value, x_r: Value, z_r: Value
) -> tuple[Value, Value, Value]:
    """f^o = G^T f^c: wrench about the CoM of a wrench at the contact point, (13)."""
    return f_x, f_z, torque + f_x * z_r - f_z * x_r


def pivot_wrench(
    body: Body, gravity: Value, hand: HandMotion, omega: Value, x_r: Value, z_r: Value
) -> tuple[Value, Value, Value]:
    """Wrench (f_x, f_z [N], torque [N m]) at the contact that lets the body move with the hand.

    (28), (31) and (33), with gravity in the last as in (28): the force that keeps the
    contact point on the hand, and the torque that the hand must give at the contact so
    that the body turns with alpha^h. `omega` [rad/s] is the body's rate.
    """
    mass = body.mass
    f_x = mass * (hand.a_x - hand.alpha * z_r - omega * omega * x_r)
    f_z = mass * (hand.a_z + hand.alpha * x_r - omega * omega * z_r + gravity)
    torque = body.grasp_inertia * hand.alpha - (
        mass * (hand.a_x * z_r - hand.a_z * x_r) - mass * gravity * x_r
    )
    return f_x, f_z, torque


def sticking_state(pose: Value, twist: Value, grasp_angle: Value, com_offset: Value) -> list[Value]:
    """CoM pose and twist (6 values) of a body that sticks to a hand of this pose and twist."""
    x, z, theta = components(pose)
    v_x, v_z, omega = components(twist)
    angle = theta + grasp_angle
    xp = backend(angle)
    x_r, z_r = com_offset * xp.cos(angle), com_offset * xp.sin(angle)
    return [x + x_r, z + z_r, angle, *com_twist(v_x, v_z, omega, x_r, z_r)]


@dataclass(frozen=True)
class FlightState:
    """CoM position [m], angle [rad], velocity [m/s] and rate [rad/s] of a body in flight."""

    x: Value
    z: Value
    theta: Value
    v_x: Value
    v_z: Value
    omega: Value

    def after(self, time: Value, gravity: Value) -> FlightState:
        """State `time` seconds later under `gravity` [m/s^2] along -z, without drag."""
        return FlightState(
            self.x + self.v_x * time,
            self.z + self.v_z * time - 0.5 * gravity * time * time,
            self.theta + self.omega * time,
            self.v_x,
            self.v_z - gravity * time,
            self.omega,
        )


def land(detach: Array, height: float, gravity: float) -> Array:
    """x [m], theta [rad] and flight time [s] (N, 3) of coming down through `height`.

    detach (N, 6): x, z, theta, v_x, v_z, omega of the CoM. NaN where it never does.
    """
    x, _, theta, v_x, _, omega = detach.T
    time = _fall_time(detach[:, 1] - height, detach[:, 4], gravity)
    return np.column_stack([x + v_x * time, theta + omega * time, time])


def time_to_height(state: FlightState, height: float, gravity: float) -> float:
    """Time [s] until the CoM comes down through `height`; NaN if it never does.

    Numbers only: inside the NLP the flight time is an unknown with a polynomial
    constraint, which cannot give a NaN.
    """
    drop, v_z = float(state.z) - height, float(state.v_z)
    if gravity <= 0:
        time = -drop / v_z if v_z < 0 else math.nan
        return time if time >= 0 else math.nan
    square = v_z * v_z + 2 * gravity * drop
    if not square >= 0:
        return math.nan
    # As in `_fall_time`.
    root = math.sqrt(square)
    if v_z > 0:
        return (v_z + root) / gravity
    time = 2 * drop / (root - v_z) if drop else 0.0
    return time if time >= 0 else math.nan


def _fall_time(drop: Array, v_z: Array, gravity: float) -> Array:
    """Later root of drop + v_z t - g t^2 / 2 = 0 [s], in the form that does not cancel."""
    with np.errstate(invalid="ignore", divide="ignore"):
        if gravity > 0:
            root = np.sqrt(v_z**2 + 2 * gravity * drop)
            time = np.where(v_z > 0, (v_z + root) / gravity, 2 * drop / (root - v_z))
            time = np.where((drop == 0) & (v_z <= 0), 0.0, time)
        else:
            time = np.where(v_z < 0, -drop / v_z, np.nan)
        return np.where(time >= 0, time, np.nan)


# Frames of the kinematics, as CasADi matrices.


def placement(xyz: tuple[float, float, float], rpy: tuple[float, float, float]) -> ca.SX:
    """4x4 pose of a frame at xyz, turned by rpy about the fixed x, y, z axes in turn."""
    (cr, sr), (cp, sp), (cy, sy) = ((exact(math.cos(a)), exact(math.sin(a))) for a in rpy)
    rows: list[list[float]] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
        [-sp, cp * sr, cp * cr, xyz[2]],
        [0.0, 0.0, 0.0, 1.0],
    ]
    return ca.sparsify(ca.SX(ca.DM([[exact(value) for value in row] for row in rows])))


def screw(angle: ca.SX | float, distance: float) -> ca.SX:
    """Rot_z(angle) Trans_z(distance)."""
    if isinstance(angle, ca.SX):
        cos, sin = ca.cos(angle), ca.sin(angle)
    else:
        cos, sin = ca.SX(exact(math.cos(angle))), ca.SX(exact(math.sin(angle)))
    pose = ca.SX(4, 4)
    pose[0, 0], pose[0, 1], pose[1, 0], pose[1, 1] = cos, -sin, sin, cos
    pose[2, 2], pose[3, 3] = 1, 1
    if distance:
        pose[2, 3] = distance
    return pose


def exact(value: float) -> float:
    """Zeros as zeros: cos(pi/2) is not 6e-17, so the planar chain stays planar."""
    return 0.0 if abs(value) < 1e-15 else value
