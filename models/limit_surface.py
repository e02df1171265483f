"""Limit surfaces of a patch contact: which wrenches friction can give, and which it gives.

A surface is described by its gauge: the normal force [N] (all faces together) at which
a wrench (f_x, f_z, torque) is just at the limit, sqrt(H(f)) for the ellipsoid of (19).
The gauge is homogeneous of degree one. Sliding with contact twist v, friction is the
wrench on the surface whose normal is along -v: Gamma(v) per newton of normal force.

As long as a body sticks, the wrench that it needs is known along the hand's motion, (28)
and (31). Slip begins where that wrench first reaches the surface of the falling grip
force. From there the contact moves along the surface's normal, so turning and sliding
begin at one instant; a motion that the normal does not have, such as turning where no
torque is carried, has not begun.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from .body import Array, Contact, pivot_wrench
from .release import ReleaseCase

Norm = Literal["paper", "consistent"]
#: Normal force [N], all faces, at which wrenches (3, K) slip on a hand at angles (K,).
Gauge = Callable[[Array, Array], Array]

#: Even intervals of the opening that are searched for the first slip.
INTERVALS = 200
#: Share of the surface's normal below which a motion does not begin.
SMALL = 1e-6
#: Share of the full grip that is nothing: a wrench of rounding errors does not slip.
NOTHING = 1e-11


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

    A pressure centre off the patch's centre couples force and torque like this.
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
        """Gamma(v): on the surface, its normal along -v."""
        w = -self.scale * twist
        w = w / np.linalg.norm(w)
        return np.asarray(self.scale * self.farthest(np.zeros((3, 3)), w, w))

    def farthest(self, k: Array, rhs: Array, near: Array) -> Array:
        """Scaled y (3,) on the surface that minimises y.K y / 2 - rhs.y; begins at `near`."""
        y = near / self.gauge(self.scale * near)
        y = _on_surface(self, k, rhs, y)
        return np.asarray(y / self.gauge(self.scale * y))


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


# The impulse of a step on a quartic surface.


def quartic_impulse(surface: Quartic, k: Array, rhs: Array, radius: float) -> Array:
    """Impulse y (3,) of maximum dissipation, in half axes of the surface.

    The minimiser of y.K y / 2 - rhs.y on or inside the surface of size `radius`.
    """
    y: Array = np.asarray(np.linalg.solve(k, rhs), float)
    size = surface.gauge(surface.scale * y)
    if size <= radius:
        return np.asarray(y)
    if radius <= 0.0:
        return np.zeros(3)
    # In units of the radius, where the surface is H(y) = 1.
    return np.asarray(radius * surface.farthest(k * radius, rhs, y))


def _on_surface(surface: Quartic, k: Array, rhs: Array, y: Array) -> Array:
    """K y + w grad H / 4 = rhs with H = 1 and w >= 0 by Newton's method, from y on."""
    first, weight = y, float((rhs - k @ y) @ y)
    matrix, residual = np.zeros((4, 4)), np.zeros(4)
    for _ in range(25):
        gradient = surface.gradient(y) / 4
        residual[:3] = k @ y - rhs + weight * gradient
        residual[3] = (float(gradient @ y) - 1.0) / 4
        if np.abs(residual[:3]).max() < 1e-11 * np.abs(rhs).max() and abs(residual[3]) < 1e-12:
            break
        matrix[:3, :3] = k + weight * surface.hessian(y) / 4
        matrix[:3, 3] = matrix[3, :3] = gradient
        try:
            step = np.linalg.solve(matrix, residual)
        except np.linalg.LinAlgError:
            return _by_optimiser(surface, k, rhs, first)
        share = min(1.0, 0.5 / max(float(np.abs(step[:3]).max()), 1e-300))
        y, weight = y - share * step[:3], weight - share * float(step[3])
    else:
        return _by_optimiser(surface, k, rhs, first)
    return y if weight >= 0 else _by_optimiser(surface, k, rhs, first)


def _by_optimiser(surface: Quartic, k: Array, rhs: Array, y: Array) -> Array:
    """The same where Newton's method does not get there: a convex problem, so to 1e-8 or so."""
    from scipy.optimize import minimize

    limit = {
        "type": "ineq",
        "fun": lambda y: 1.0 - surface.gauge(surface.scale * y) ** 4,
        "jac": lambda y: -surface.gradient(y),
    }
    size = np.abs(rhs).max()
    found = minimize(
        lambda y: (y @ k @ y / 2 - rhs @ y) / size,
        y,
        jac=lambda y: (k @ y - rhs) / size,
        method="SLSQP",
        constraints=limit,
        options={"ftol": 1e-14, "maxiter": 200},
    )
    return np.asarray(found.x)


# When slip begins.


def surface_gauge(surface: LimitSurface) -> Gauge:
    """The gauge of a limit surface that does not turn with the hand."""

    def gauge(wrench: Array, _: Array) -> Array:
        return np.array([surface.gauge(column) for column in wrench.T])

    return gauge


def slip_onset(
    case: ReleaseCase, gauge: Gauge, intervals: int = INTERVALS
) -> tuple[float | None, float | None]:
    """Times [s] at which pivot and slide begin, None for what does not.

    To 1e-12 of the opening; 0 for a body that the full grip does not hold.
    """
    from scipy.optimize import brentq

    opening = case.grip.opening

    def excess(times: Array) -> Array:
        """Normal force [N] that the body lacks."""
        wrench, angle = held_wrench(case, times)
        force = case.grip.force(times) + NOTHING * case.grip.full
        return np.asarray(gauge(wrench, angle) - case.contact.faces * force)

    times = np.linspace(0.0, opening, intervals + 1)
    above = np.flatnonzero(excess(times) > 0)
    if above.size == 0:
        return None, None
    i = int(above[0])
    onset = float(times[i])
    if i > 0:
        onset = float(
            brentq(lambda t: float(excess(np.array([t]))[0]), times[i - 1], onset, xtol=1e-12)
        )
    pivots, slides = _moves(case, gauge, onset)
    return onset if pivots else None, onset if slides else None


def held_wrench(case: ReleaseCase, times: Array) -> tuple[Array, Array]:
    """Contact wrench (3, K) that a sticking body needs, world axes, and the hand's angle (K,)."""
    hand = case.hand.at(times)
    theta, h = hand.pose[2] + case.grasp_angle, case.body.com_offset
    lever = h * np.cos(theta), h * np.sin(theta)
    wrench = pivot_wrench(case.body, case.gravity, hand.motion, hand.twist[2], *lever)
    return np.array(np.broadcast_arrays(*wrench)), hand.pose[2]


def _moves(case: ReleaseCase, gauge: Gauge, time: float) -> tuple[bool, bool]:
    """Whether the surface's normal at the held wrench turns, and whether it slides."""
    wrench, angle = held_wrench(case, np.array([time]))
    # In newtons: a torque counts by the patch's torsion arm.
    scale = np.array([1.0, 1.0, case.contact.torsion_arm])
    step = 1e-4 * np.linalg.norm(wrench[:, 0] / scale)
    sides = np.concatenate([step * np.diag(scale), -step * np.diag(scale)], axis=1)
    values = gauge(wrench + sides, np.repeat(angle, 6))
    normal = np.abs(values[:3] - values[3:])
    total = float(normal.max())
    return bool(normal[2] > SMALL * total), bool(normal[:2].max() > SMALL * total)
