"""A rigid planar body, gripped by two pads: its parameters, kinematics and laws.

The equations use the few functions of `backend`, component by component: they run on floats, on
NumPy arrays (N throws) and on CasADi expressions.

Frame: x forward, z up, angles counter-clockwise from +x towards +z, unwrapped; SI units.
The contact point is the point of the body under the centre of the pads; `r = (x_r, z_r)`
leads from it to the CoM. Source: (11)-(13), (28)-(33) of Liu and Billard, "On Transient
Release Dynamics in Robot Throwing: A Sliding Pivot Model".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from .backend import Value, backend, components

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int_]
ArrayLike = TypeVar("ArrayLike", bound=npt.NDArray[Any])
#: Halvings of the interval in which the use of a pinch lies: to rounding.
HALVINGS = 60
#: A use of a pinch below this is rounding.
NEGLIGIBLE = 1e-12


class ReadOnly:
    """Base of dataclasses that share their arrays: no one can write to these by accident."""

    def __post_init__(self) -> None:
        """Arrays become views that cannot be written to, also in tables and tuples of them."""
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                vars(self)[name] = read_only(value)
            elif type(value) is tuple:
                vars(self)[name] = tuple(
                    read_only(one) if isinstance(one, np.ndarray) else one for one in value
                )
            elif isinstance(value, dict):
                arrays = {k: read_only(v) for k, v in value.items() if isinstance(v, np.ndarray)}
                vars(self)[name] = value | arrays

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A copy is as its original."""
        vars(self).update(state)
        ReadOnly.__post_init__(self)


def read_only(values: ArrayLike) -> ArrayLike:
    """A view of an array that cannot be written to."""
    if not values.flags.writeable:
        return values
    seen = values.view()
    seen.flags.writeable = False
    return seen


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
class PinchContact:
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
        """Squared share of the friction limit that a wrench uses: below 1 inside the surface.

        (|f|/f_max)^2 + (tau/tau_max)^2, the ellipsoid (19).
        """
        limit = self.force_limit(normal_force)
        return (force_x**2 + force_z**2 + (torque / self.torsion_arm) ** 2) / limit**2

    def sliding_wrench(self, twist: Array) -> Array:
        """Gamma(v) = -A^-1 v / sqrt(v^T A^-1 v) of the ellipsoid (19).

        Friction (3, ...) per newton of normal force for a contact twist (3, ...); 0 for none.
        """
        v_x, v_z, omega = twist
        arm = self.torsion_arm
        size = np.sqrt(v_x**2 + v_z**2 + (arm * omega) ** 2)
        image = self.friction * np.array([v_x, v_z, arm**2 * omega])
        return np.asarray(-image / np.maximum(size, 1e-300))


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
        """The hand's motion for the contact equations."""
        return HandMotion(self.pose[2], self.twist[2], *components(self.acceleration))

    def __iter__(self) -> Iterator[Array]:
        """pose, twist, acceleration."""
        return iter((self.pose, self.twist, self.acceleration))


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

    (28) and (31)-(33), with gravity in the last as in (28): the force that keeps the
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


def held_wrench(
    body: Body, gravity: Value, hand: HandMotion, grasp_angle: Value
) -> tuple[Value, Value, Value]:
    """`pivot_wrench` of a body that sticks to the hand at `grasp_angle` [rad]."""
    theta, h = hand.theta + grasp_angle, body.com_offset
    xp = backend(theta)
    return pivot_wrench(body, gravity, hand, hand.omega, h * xp.cos(theta), h * xp.sin(theta))


def sticking_state(pose: Value, twist: Value, grasp_angle: Value, com_offset: Value) -> list[Value]:
    """CoM pose and twist (6 values) of a body that sticks to a hand of this pose and twist."""
    x, z, theta = components(pose)
    v_x, v_z, omega = components(twist)
    angle = theta + grasp_angle
    xp = backend(angle)
    x_r, z_r = com_offset * xp.cos(angle), com_offset * xp.sin(angle)
    return [x + x_r, z + z_r, angle, *com_twist(v_x, v_z, omega, x_r, z_r)]


def lowest_point(z: Value, cos: Value, sin: Value, ends: tuple[Value, Value], half: Value) -> Value:
    """Height [m] of a bar's lowest corner: of a rectangle along an axis with this cosine and sine,
    between `ends` (before and behind the CoM at height z) and `half` [m] wide to either side."""
    xp = backend(z, cos, sin)
    return z + xp.minimum(ends[0] * sin, ends[1] * sin) - half * abs(cos)


# Free flight; `write_core_laws` writes `after` and `fall_time` as C.


@dataclass(frozen=True, eq=False)
class PinchUse(ReadOnly):
    """Share (N,) of the pads' force that a wrench needs: above 1 the body slips, tilts or lifts.

    Its parts, each by itself: friction in the pads' plane, tilting out of it, the force across it.
    """

    use: Array
    friction: Array
    tilting: Array
    lifting: Array


def pinch_use(contact: PinchContact, force: Array, torque: Array, normal_force: float) -> PinchUse:
    """Use of a pinch at `normal_force` [N] of one pad, by wrenches in space on the body.

    force [N], torque [N m] about the middle of the pads: rows (3, N) along the hand, across it in
    the pads' plane, and along the pads' normal, which completes them right-handed.

    In the pads' plane the limit surface holds, as in a throw. Across it pads only press: a torque
    that tilts the body shifts the middle of the pressure of one pad one way, and of the other pad
    the other way. Each stays inside its patch of radius r_p, so the torque is at most r_p times the
    force of the pads. A force along their normal lets one pad press less, and a pad does not
    adhere.

    A tilt by the share d of r_p leaves each pad a disc of radius (1 - d) r_p about the middle of
    its pressure, with the torsional friction of that radius: a lower bound. The force across takes
    from the pads' force; the pad that it presses on counts no more than before. With only a wrench
    in the pads' plane the use is the root of `PinchContact.utilisation_squared`.
    """
    pads = contact.faces * normal_force

    def planar(forces: Array, torsion: Array) -> Array:
        return np.asarray(
            np.sqrt(contact.utilisation_squared(forces[0], forces[1], torsion, normal_force))
        )

    tilting = np.hypot(torque[0], torque[1]) / (contact.patch_radius * pads)
    lifting, friction = np.abs(force[2]) / pads, planar(force[:2], torque[2])
    # The use u solves u = planar(torque u / (u - tilting)); searched is u - tilting. The right side
    # falls with it, and the upper bound follows from convexity.
    low = np.zeros_like(friction)
    high = planar(force[:2], 0 * torque[2]) + planar(0 * force[:2], torque[2])
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        torsion = torque[2] * (1.0 + tilting / np.maximum(middle, NEGLIGIBLE))
        above = planar(force[:2], torsion) > middle + tilting
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    held = np.where(tilting > 0.0, high + tilting, friction)
    return PinchUse(held + lifting, friction, tilting, lifting)
