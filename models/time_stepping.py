"""Limit surface (LS) release by time stepping: no smoothing and no stiffness.

The ellipsoidal limit surface H(f) = f^T A f <= f_N^2, (19) of Liu and Billard, is
a maximum-dissipation law. Moreau-Jean stepping applies it to the impulse of one
step: with the free contact velocity b and the contact's inverse mass
W = G M^-1 G^T, the impulse is p = -W^-1 b if that lies inside the surface, else
the p with (W + s A) p = -b and H(p) = R^2 for the one scalar s > 0 (a
trust-region problem). This is the limit of the viscous-smoothed law (ILS) as its
half-band goes to zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .backend import Value, backend, components
from .contact import Body, Contact

#: Newton iterations on 1/|y(s)|; it converges monotonically, mostly in 2 to 4; at 8 a few
#: of 400,000 extreme random steps had not converged, at 16 all had.
ITERATIONS = 12


@dataclass(frozen=True)
class HandState:
    """Pose (x, z, theta) and twist (v_x, v_z, omega) of the hand at one instant."""

    x: Value
    z: Value
    theta: Value
    v_x: Value
    v_z: Value
    omega: Value


#: Columns of S with S S^T = A^-1: the surface's half axes per newton of normal force.
Factor = tuple[tuple[Value, ...], ...]


@dataclass(frozen=True)
class LimitSurfaceStepping:
    """Moreau-Jean stepping of a body held by an ellipsoidal limit surface.

    The state is the CoM's pose and twist in the world: x, z, theta, v_x, v_z, omega.
    factor: columns of S with S S^T = A^-1 for another ellipsoid than the contact's own.
    settle: stop the iterations when all have converged (numbers only).
    """

    body: Body
    contact: Contact
    gravity: Value = 9.81
    iterations: int = ITERATIONS
    factor: Factor | None = None
    settle: bool = False

    def step(
        self,
        state: Value,
        start: HandState,
        end: HandState,
        normal_force: Value,
        dt: Value,
    ) -> list[Value]:
        """State `dt` later; `start`, `end`: the hand then; `normal_force`: mid-step, one pad [N].

        The lever is taken at the middle of the step, which keeps a sticking body on
        a turning hand to second order.
        """
        x, z, theta, v_x, v_z, omega = components(state)
        mass, inertia = self.body.mass, self.body.inertia
        half = 0.5 * dt
        x_r = x + half * v_x - 0.5 * (start.x + end.x)
        z_r = z + half * v_z - 0.5 * (start.z + end.z)
        fall = v_z - dt * self.gravity
        # Mean hand velocity of the step: its position is then met exactly.
        b = (
            v_x + omega * z_r - 0.5 * (start.v_x + end.v_x),
            fall - omega * x_r - 0.5 * (start.v_z + end.v_z),
            omega - 0.5 * (start.omega + end.omega),
        )
        p_x, p_z, p_t = self._impulse(b, x_r, z_r, self.contact.faces * normal_force * dt)
        v_x = v_x + p_x / mass
        v_z = fall + p_z / mass
        omega = omega + (p_t + p_x * z_r - p_z * x_r) / inertia
        return [x + dt * v_x, z + dt * v_z, theta + dt * omega, v_x, v_z, omega]

    def _impulse(self, b: Sequence[Value], x_r: Value, z_r: Value, radius: Value) -> list[Value]:
        """Contact impulse (p_x, p_z, p_theta) for the free contact twist `b`."""
        # With p = S y the surface is a sphere, |y| <= R, and W becomes K = S^T W S.
        factor = self.factor or _axis_factor(self.contact)
        matrix = _scaled_inverse_mass(self.body, factor, x_r, z_r)
        rhs = [-(f[0] * b[0] + f[1] * b[1] + f[2] * b[2]) for f in factor]
        xp = backend(*rhs, *matrix, radius)

        y = _solve(matrix, 0.0 * radius, rhs)
        norm = xp.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2 + 1e-300)
        held = norm <= radius
        shift = 0.0 * radius
        safe_radius = xp.maximum(radius, 1e-300)
        for _ in range(self.iterations):
            # A converged entry stays as it is, whatever its neighbours in a batch do.
            done = abs(norm - radius) <= 1e-10 * radius
            if self.settle and bool(np.all(held | done)):
                break
            w = _solve(matrix, shift, y)
            curvature = y[0] * w[0] + y[1] * w[1] + y[2] * w[2] + 1e-300
            step = norm * norm / curvature * (norm - safe_radius) / safe_radius
            moved = xp.where(done, shift, xp.maximum(shift + step, 0.0))
            shift = xp.where(held, 0.0, moved)
            y = _solve(matrix, shift, rhs)
            norm = xp.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2 + 1e-300)
        # The last digits of the radius: an impulse outside would create energy.
        trim = xp.where(held, 1.0, xp.minimum(radius / norm, 1.0))
        return [trim * sum(factor[j][i] * y[j] for j in range(3)) for i in range(3)]


def _axis_factor(contact: Contact) -> Factor:
    """The half axes of the axis-aligned ellipsoid (19)."""
    force, torque = contact.friction, contact.friction * contact.torsion_arm
    return (force, 0.0, 0.0), (0.0, force, 0.0), (0.0, 0.0, torque)


def _scaled_inverse_mass(
    body: Body, factor: Factor, x_r: Value, z_r: Value
) -> tuple[Value, Value, Value, Value, Value, Value]:
    """K = S^T G M^-1 G^T S: entries 11, 22, 33, 12, 13, 23."""
    # Rows of G^T S: the CoM twist, times mass, that one unit of y gives.
    moved = [(f[0], f[1], f[2] + f[0] * z_r - f[1] * x_r) for f in factor]

    def entry(i: int, j: int) -> Value:
        a, b = moved[i], moved[j]
        return (a[0] * b[0] + a[1] * b[1]) / body.mass + a[2] * b[2] / body.inertia

    return entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)


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
