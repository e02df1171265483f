"""Planar contact of a gripped body: parameters, contact kinematics and friction limits.

Frame: x forward, z up, angles counter-clockwise from +x towards +z; SI units.
The contact point is the point of the body under the centre of the pad patches,
`r = (x_r, z_r)` is the CoM seen from it. Source: equations (11)-(15) of Liu and
Billard, "On Transient Release Dynamics in Robot Throwing: A Sliding Pivot Model".
"""

from __future__ import annotations

from dataclasses import dataclass

from .backend import Value


@dataclass(frozen=True)
class Body:
    """Rigid planar body: mass [kg], inertia about the CoM [kg m^2], com_offset [m].

    `com_offset` is h, the distance from the grasped point to the CoM along the
    body's long axis.
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

    The normal force is that of one pad; a bar pinched between two pads has two
    faces, and both friction limits count each of them.
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


def contact_acceleration(
    a_x: Value, a_z: Value, alpha: Value, omega: Value, x_r: Value, z_r: Value
) -> tuple[Value, Value, Value]:
    """Acceleration of the contact point from the CoM's, (15), centripetal part included."""
    return (
        a_x + alpha * z_r + omega * omega * x_r,
        a_z - alpha * x_r + omega * omega * z_r,
        alpha,
    )


def pivot_wrench(
    body: Body, gravity: Value, hand: HandMotion, omega: Value, x_r: Value, z_r: Value
) -> tuple[Value, Value, Value]:
    """Wrench at the contact that lets the body move with the hand.

    (28), (31) and (33) with gravity in the last as in (28): the force that keeps
    the contact point on the hand, and the torque that the hand must give at the
    contact so that the body turns with alpha^h. `omega` [rad/s] is the body's rate.
    Returns (f_x, f_z, torque) in N, N, N m.
    """
    mass = body.mass
    f_x = mass * (hand.a_x - hand.alpha * z_r - omega * omega * x_r)
    f_z = mass * (hand.a_z + hand.alpha * x_r - omega * omega * z_r + gravity)
    torque = body.grasp_inertia * hand.alpha - (
        mass * (hand.a_x * z_r - hand.a_z * x_r) - mass * gravity * x_r
    )
    return f_x, f_z, torque
