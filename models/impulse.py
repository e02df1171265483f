"""The contact impulse of one step on an ellipsoidal limit surface.

With p = S y, S S^T = A^-1, the surface is a sphere |y| <= R and the inverse mass
W = G M^-1 G^T becomes K = S^T W S. Sticking is K y = rhs; if that is outside, y solves
(K + s I) y = rhs with |y| = R for the one scalar s > 0: a trust-region problem, by
Newton's method on 1/|y(s)|.

The parts are separate functions so that a compiled batch can run the same equations in a
loop of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .backend import Value, backend
from .contact import Body, Contact

#: Newton iterations on 1/|y(s)|; it converges monotonically, mostly in 2 to 4; at 8 a few
#: of 400,000 extreme random steps had not converged, at 16 all had.
ITERATIONS = 12
#: Distance of |y| from the radius, over the radius, that ends the iterations.
TOLERANCE = 1e-10

#: Columns of S with S S^T = A^-1: the surface's half axes per newton of normal force.
Factor = tuple[tuple[Value, ...], ...]


@dataclass(frozen=True)
class Iterate:
    """y (3 values) for one shift s, and its size |y|."""

    shift: Value
    y: Sequence[Value]
    norm: Value


@dataclass(frozen=True)
class ImpulseProblem:
    """One step's trust-region problem.

    matrix: entries 11, 22, 33, 12, 13, 23 of K; rhs: 3 values; radius: R [N s].
    """

    matrix: Sequence[Value]
    rhs: Sequence[Value]
    radius: Value

    def solve(self, iterations: int = ITERATIONS, settle: bool = False) -> list[Value]:
        """y (3 values); with `settle` (numbers only) it stops when all have converged."""
        found = self.sticking()
        held = found.norm <= self.radius
        for _ in range(iterations):
            moving = self.moving(found, held)
            if settle and not np.any(moving):
                break
            found = self.refined(found, moving)
        return self.trimmed(found, held)

    def sticking(self) -> Iterate:
        """The impulse that leaves no slip; it is the answer where |y| <= R."""
        shift = 0.0 * self.radius
        y = _solve(self.matrix, shift, self.rhs)
        return Iterate(shift, y, _size(y))

    def moving(self, found: Iterate, held: Value) -> Value:
        """Which entries still have to be refined: neither sticking nor converged."""
        off = abs(found.norm - self.radius) > TOLERANCE * self.radius
        return backend(off, held).where(held, False, off)

    def refined(self, found: Iterate, moving: Value) -> Iterate:
        """One Newton iteration; other entries than `moving` stay, whatever these do."""
        y, norm, shift = found.y, found.norm, found.shift
        xp = backend(*self.matrix, *self.rhs, self.radius)
        w = _solve(self.matrix, shift, y)
        curvature = y[0] * w[0] + y[1] * w[1] + y[2] * w[2] + 1e-300
        radius = xp.maximum(self.radius, 1e-300)
        step = norm * norm / curvature * (norm - radius) / radius
        shift = xp.where(moving, xp.maximum(shift + step, 0.0), shift)
        y = _solve(self.matrix, shift, self.rhs)
        return Iterate(shift, y, _size(y))

    def trimmed(self, found: Iterate, held: Value) -> list[Value]:
        """y without the last digits beyond the radius: outside it would create energy."""
        xp = backend(*self.matrix, *self.rhs, self.radius)
        trim = xp.where(held, 1.0, xp.minimum(self.radius / found.norm, 1.0))
        return [trim * value for value in found.y]


def axis_factor(contact: Contact) -> Factor:
    """The half axes of the axis-aligned ellipsoid (19)."""
    force, torque = contact.friction, contact.friction * contact.torsion_arm
    return (force, 0.0, 0.0), (0.0, force, 0.0), (0.0, 0.0, torque)


def scaled_inverse_mass(
    body: Body, factor: Factor, x_r: Value, z_r: Value
) -> tuple[Value, Value, Value, Value, Value, Value]:
    """K = S^T G M^-1 G^T S: entries 11, 22, 33, 12, 13, 23."""
    # Rows of G^T S: the CoM twist, times mass, that one unit of y gives.
    moved = [(f[0], f[1], f[2] + f[0] * z_r - f[1] * x_r) for f in factor]

    def entry(i: int, j: int) -> Value:
        a, b = moved[i], moved[j]
        return (a[0] * b[0] + a[1] * b[1]) / body.mass + a[2] * b[2] / body.inertia

    return entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)


def _size(y: Sequence[Value]) -> Value:
    return backend(*y).sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2 + 1e-300)


def _solve(matrix: Sequence[Value], shift: Value, rhs: Sequence[Value]) -> list[Value]:
    """x of (K + shift I) x = rhs, K symmetric positive definite, by L D L^T."""
    k_xx, k_zz, k_tt, k_xz, k_xt, k_zt = matrix
    d1 = k_xx + shift
    l21 = k_xz / d1
    l31 = k_xt / d1
    d2 = k_zz + shift - l21 * k_xz
    m32 = k_zt - l21 * k_xt
    l32 = m32 / d2
    d3 = k_tt + shift - l31 * k_xt - l32 * m32
    y2 = rhs[1] - l21 * rhs[0]
    x3 = (rhs[2] - l31 * rhs[0] - l32 * y2) / d3
    x2 = y2 / d2 - l32 * x3
    x1 = rhs[0] / d1 - l21 * x2 - l31 * x3
    return [x1, x2, x3]
