"""Limit surfaces of a patch contact: which wrenches friction can give, and which it gives.

A surface is described by its gauge: the normal force [N] (all faces together) at which
a wrench (f_x, f_z, torque) is just at the limit, sqrt(H(f)) for the ellipsoid of (19).
The gauge is homogeneous of degree one. Sliding with contact twist v, friction is the
wrench on the surface whose normal is along -v: Gamma(v) per newton of normal force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from .contact import Contact

Array = npt.NDArray[np.float64]
Norm = Literal["paper", "consistent"]


class LimitSurface(Protocol):
    """A convex, smooth limit surface."""

    def gauge(self, wrench: Array) -> float:
        """Normal force [N] at which `wrench` (3,) is at the limit."""

    def sliding_wrench(self, twist: Array) -> Array:
        """Gamma(v): friction wrench (3,) per newton for a contact twist (3,) that is not 0."""


class Ellipsoid:
    """sqrt(f^T A f): (19) with a diagonal A, or rotated with any positive definite A."""

    def __init__(self, matrix: npt.ArrayLike) -> None:
        self.matrix = np.asarray(matrix, float)
        self.inverse = np.linalg.inv(self.matrix)

    def gauge(self, wrench: Array) -> float:
        """Normal force [N] at which `wrench` (3,) is at the limit."""
        return math.sqrt(max(float(wrench @ self.matrix @ wrench), 0.0))

    def sliding_wrench(self, twist: Array) -> Array:
        """Gamma(v) = -A^-1 v / sqrt(v^T A^-1 v)."""
        image = self.inverse @ twist
        return np.asarray(-image / math.sqrt(float(twist @ image)))


def ellipsoid(contact: Contact) -> Ellipsoid:
    """The axis-aligned ellipsoid of a contact, (19)."""
    force, torque = contact.friction, contact.friction * contact.torsion_arm
    return Ellipsoid(np.diag([force**-2.0, force**-2.0, torque**-2.0]))


def rotated_ellipsoid(contact: Contact, angle: float = 0.4) -> Ellipsoid:
    """The same ellipsoid turned by `angle` [rad] in the plane of f_z and scaled torque.

    A pressure centre beside the patch's centre couples force and torque like this.
    """
    force, torque = contact.friction, contact.friction * contact.torsion_arm
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    stretch = np.diag([1.0, 1.4, 1.0])
    scale = np.diag([1 / force, 1 / force, 1 / torque])
    return Ellipsoid(scale @ turn.T @ stretch @ turn @ scale)


@dataclass(frozen=True)
class Quartic:
    """A fourth-order homogeneous polynomial, H(f) = F^4 + 2 k F^2 T^2 + T^4.

    F and T are force and torque over their own limits. coupling k in (0, 3]: 1 is the
    ellipsoid, below it bulges towards a cylinder, above it caves in. The sliding wrench
    has no closed form and is found by Newton's method.
    """

    contact: Contact
    coupling: float = 0.5

    @property
    def scale(self) -> Array:
        """Limits of f_x, f_z [N] and torque [N m] per newton of normal force."""
        mu = self.contact.friction
        return np.array([mu, mu, mu * self.contact.torsion_arm])

    def gauge(self, wrench: Array) -> float:
        """Normal force [N] at which `wrench` (3,) is at the limit."""
        y = wrench / self.scale
        force, torque = y[0] ** 2 + y[1] ** 2, y[2] ** 2
        return float((force**2 + 2 * self.coupling * force * torque + torque**2) ** 0.25)

    def gradient(self, y: Array) -> Array:
        """Gradient of H in scaled coordinates y (3,)."""
        force, torque, k = y[0] ** 2 + y[1] ** 2, y[2] ** 2, self.coupling
        common = 4 * (force + k * torque)
        return np.array([common * y[0], common * y[1], 4 * (k * force + torque) * y[2]])

    def hessian(self, y: Array) -> Array:
        """Hessian of H in scaled coordinates (3, 3)."""
        force, torque, k = y[0] ** 2 + y[1] ** 2, y[2] ** 2, self.coupling
        matrix = np.diag([4 * (force + k * torque)] * 2 + [4 * k * force + 12 * torque])
        matrix[:2, :2] += 8 * np.outer(y[:2], y[:2])
        matrix[:2, 2] += 8 * k * y[:2] * y[2]
        matrix[2, :2] += 8 * k * y[:2] * y[2]
        return matrix

    def sliding_wrench(self, twist: Array) -> Array:
        """Gamma(v): on the surface, its normal along -v; damped Newton on direction and scale."""
        w = -self.scale * twist
        w = w / np.linalg.norm(w)
        # Minimise H(y)/4 - w.y: the minimiser has gradient w; then scale onto H = 1.
        y = w.copy()
        for _ in range(60):
            residual = self.gradient(y) / 4 - w
            size = float(np.linalg.norm(residual))
            if size < 1e-13:
                break
            step = np.linalg.solve(self.hessian(y) / 4 + 1e-12 * np.eye(3), residual)
            share = 1.0
            while share > 1e-6 and self._merit(y - share * step, w) > self._merit(y, w):
                share /= 2
            y = y - share * step
        scaled = self.scale * y
        return np.asarray(scaled / self.gauge(scaled))

    def _merit(self, y: Array, w: Array) -> float:
        return self.gauge(self.scale * y) ** 4 / 4 - float(w @ y)


def slip_size(twist: Array, contact: Contact, norm: Norm) -> float:
    """|v| [m/s] of a contact twist.

    'paper' mixes m/s and rad/s in one norm, as printed; 'consistent' turns the rate into
    a speed by c r_p.
    """
    arm = 1.0 if norm == "paper" else float(contact.torsion_arm)
    return math.sqrt(twist[0] ** 2 + twist[1] ** 2 + (arm * twist[2]) ** 2)


def smoothed_sliding_wrench(
    surface: LimitSurface, twist: Array, size: float, half_band: float
) -> Array:
    """Gamma_d(v) = Gamma(v) min(|v|/d, 1); `size` is |v|, `half_band` is d [m/s]."""
    if size == 0.0:
        return np.zeros(3)
    return surface.sliding_wrench(twist) * min(size / half_band, 1.0)
