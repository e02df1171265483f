"""Limit surface (LS) release by time stepping: no smoothing and no stiffness.

The ellipsoidal limit surface H(f) = f^T A f <= f_N^2, (19) of Liu and Billard, is a
maximum-dissipation law. Moreau-Jean stepping applies it to the impulse p of one step:
with the free contact velocity b and the contact's inverse mass W = G M^-1 G^T, sticking is
p = -W^-1 b if that lies inside the surface, else (W + s A) p = -b and H(p) = R^2 for the
one scalar s > 0. This is the limit of the viscous-smoothed law (ILS) as its half-band goes
to zero.

With p = S y, S S^T = A^-1, the surface is a sphere |y| <= R and K = S^T W S the inverse
mass: a trust-region problem, solved by Newton's method on 1/|y(s)|. Its parts are separate
functions, which core/surface.h runs in a loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..backend import Value, backend, components
from ..body import Array, Body, HandSamples, PinchContact, com_wrench, contact_twist
from .cases import BatchRelease, Release, ReleaseBatch, ReleaseCase
from .integrators import by_levels, compiled_batch, surface_steps

#: Newton iterations on 1/|y(s)|; they converge monotonically, mostly in 2 to 4. Of 400,000 extreme
#: random steps a few needed more than 8, none more than 16.
ITERATIONS = 12
#: Relative distance of |y| from the radius at which the iterations end.
TOLERANCE = 1e-10

#: CoM seen from the hand: x_r, z_r [m].
Lever = tuple[Value, Value]


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

    def sticking(self) -> Iterate:
        """The impulse that leaves no slip; it is the answer where |y| <= R."""
        shift = 0.0 * self.radius
        y = solve_symmetric(self.matrix, shift, self.rhs)
        return Iterate(shift, y, _size(y))

    def moving(self, iterate: Iterate, sticks: Value) -> Value:
        """Which entries still have to be refined: neither sticking nor converged."""
        off = abs(iterate.norm - self.radius) > TOLERANCE * self.radius
        return backend(off, sticks).where(sticks, False, off)

    def refined(self, iterate: Iterate, moving: Value) -> Iterate:
        """One Newton iteration of the entries that are `moving`; the others stay."""
        y, norm, shift = iterate.y, iterate.norm, iterate.shift
        xp = backend(*self.matrix, *self.rhs, self.radius)
        w = solve_symmetric(self.matrix, shift, y)
        curvature = y[0] * w[0] + y[1] * w[1] + y[2] * w[2] + 1e-300
        radius = xp.maximum(self.radius, 1e-300)
        step = norm * norm / curvature * (norm - radius) / radius
        shift = xp.where(moving, xp.maximum(shift + step, 0.0), shift)
        y = solve_symmetric(self.matrix, shift, self.rhs)
        return Iterate(shift, y, _size(y))

    def trimmed(self, iterate: Iterate, sticks: Value) -> list[Value]:
        """y without the last digits beyond the radius: outside it would create energy."""
        xp = backend(*self.matrix, *self.rhs, self.radius)
        trim = xp.where(sticks, 1.0, xp.minimum(self.radius / iterate.norm, 1.0))
        return [trim * value for value in iterate.y]


def _size(y: Sequence[Value]) -> Value:
    return backend(*y).sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2 + 1e-300)


def solve_symmetric(matrix: Sequence[Value], shift: Value, rhs: Sequence[Value]) -> list[Value]:
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


@dataclass(frozen=True)
class LimitSurfaceStepping:
    """Moreau-Jean stepping of a body held by an ellipsoidal limit surface.

    The state is the CoM's pose and twist in the world: x, z, theta, v_x, v_z, omega. The grip
    force is that in the middle of a step. Slip is measured against the hand at its end, where the
    new velocity is. The lever is taken at its middle, which keeps a sticking body on a turning hand
    to second order. turned: whether y is in the hand's axes, in the middle of the step, as surfaces
    of other shapes and patches need it; the plain ellipsoid is round in the plane.
    """

    body: Body
    contact: PinchContact
    gravity: Value = 9.81
    turned: bool = False

    def _half_axes(self, hands: Sequence[HandSamples]) -> Sequence[Sequence[Value]]:
        """Half axes of the ellipsoid (19) per newton, in the world: the columns of S."""
        force = self.contact.friction
        torque = force * self.contact.torsion_arm
        if not self.turned:
            return (force, 0.0, 0.0), (0.0, force, 0.0), (0.0, 0.0, torque)
        angle = 0.5 * (hands[0].pose[2] + hands[-1].pose[2])
        xp = backend(angle)
        cos, sin = force * xp.cos(angle), force * xp.sin(angle)
        return (cos, sin, 0.0), (-sin, cos, 0.0), (0.0, 0.0, torque)

    def lever(self, state: Value, hands: Sequence[HandSamples], dt: Value) -> Lever:
        """CoM seen from the hand in the middle of the step, x_r and z_r [m]."""
        x, z, _, v_x, v_z, _ = components(state)
        start, end = hands[0], hands[-1]
        half = 0.5 * dt
        return (
            x + half * v_x - 0.5 * (start.pose[0] + end.pose[0]),
            z + half * v_z - 0.5 * (start.pose[1] + end.pose[1]),
        )

    def problem(
        self,
        state: Value,
        hands: Sequence[HandSamples],
        lever: Lever,
        normal_force: Value,
        dt: Value,
    ) -> ImpulseProblem:
        """The problem whose solution is the contact impulse of one step."""
        _, _, _, v_x, v_z, omega = components(state)
        hand_x, hand_z, hand_omega = components(hands[-1].twist)
        body, axes = self.body, self._half_axes(hands)
        slip_x, slip_z, slip = contact_twist(v_x, v_z - dt * self.gravity, omega, *lever)
        b = (slip_x - hand_x, slip_z - hand_z, slip - hand_omega)
        # Rows of G^T S: the CoM twist, times mass, that one unit of y gives.
        moved = [com_wrench(f[0], f[1], f[2], *lever) for f in axes]

        def entry(i: int, j: int) -> Value:
            one, two = moved[i], moved[j]
            return (one[0] * two[0] + one[1] * two[1]) / body.mass + one[2] * two[2] / body.inertia

        pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        return ImpulseProblem(
            [entry(i, j) for i, j in pairs],
            [-a[0] * b[0] - a[1] * b[1] - a[2] * b[2] for a in axes],
            self.contact.faces * normal_force * dt,
        )

    def after(
        self,
        state: Value,
        hands: Sequence[HandSamples],
        lever: Lever,
        y: Sequence[Value],
        dt: Value,
    ) -> list[Value]:
        """State after a step whose impulse is S y."""
        x, z, theta, v_x, v_z, omega = components(state)
        hand_start, hand_end = components(hands[0].pose), components(hands[-1].pose)
        rates = components(hands[-1].twist)
        one, two, three = self._half_axes(hands)
        p_x, p_z, p_t = (one[i] * y[0] + two[i] * y[1] + three[i] * y[2] for i in range(3))
        v_x = v_x + p_x / self.body.mass
        v_z = v_z - dt * self.gravity + p_z / self.body.mass
        omega = omega + com_wrench(p_x, p_z, p_t, *lever)[2] / self.body.inertia
        # The hand's displacement plus the slip: a sticking body keeps the hand's pose exactly,
        # though its velocity is that at the end of the step.
        turn = hand_end[2] - hand_start[2] - dt * rates[2]
        return [
            x + hand_end[0] - hand_start[0] + dt * (v_x - rates[0]) - turn * lever[1],
            z + hand_end[1] - hand_start[1] + dt * (v_z - rates[1]) + turn * lever[0],
            theta + dt * omega + turn,
            v_x,
            v_z,
            omega,
        ]


@dataclass(frozen=True)
class SteppedRelease:
    """Moreau-Jean steps on a limit surface; `steps` over the opening, first order."""

    steps: int = 1000

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case."""
        release = surface_steps(case, self.steps)
        pivot, slide = case.slip_onset()
        return replace(release, pivot=pivot, slide=slide, wrench=step_wrenches(case, release))

    def throw(self, batch: ReleaseBatch, steps: int) -> BatchRelease:
        """N releases on the contact's own limit surface.

        `steps` and twice as many steps, extrapolated: the stepping is first order, so this
        takes away the leading error at three times the cost of the shorter run.
        """

        def stepped(part: ReleaseBatch, count: int) -> BatchRelease:
            return compiled_batch("limit_surface", part, np.linspace(0.0, 1.0, 2 * count + 1))

        def extrapolated(part: ReleaseBatch, factor: int) -> BatchRelease:
            coarse, fine = stepped(part, steps * factor), stepped(part, 2 * steps * factor)
            detach = 2 * fine.detach - coarse.detach
            return BatchRelease(detach, fine.lost)

        return by_levels(batch, extrapolated)


def step_wrenches(case: ReleaseCase, release: Release) -> Array:
    """Contact wrench (3, K) of each step, from the change of momentum in it."""
    change = np.diff(release.com_twist, axis=1) / np.diff(release.times)
    f_x, f_z = case.body.mass * change[0], case.body.mass * (change[1] + case.gravity)
    lever = release.com[:2] - case.hand.at(release.times).pose[:2]
    middle = (lever[:, :-1] + lever[:, 1:]) / 2
    torque = case.body.inertia * change[2] - f_x * middle[1] + f_z * middle[0]
    wrench = np.vstack([f_x, f_z, torque])
    return np.column_stack([wrench[:, :1], wrench])
