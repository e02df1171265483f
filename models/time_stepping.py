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

from dataclasses import dataclass

from .backend import Value, components
from .contact import Body, Contact
from .impulse import ITERATIONS, Factor, ImpulseProblem, axis_factor, scaled_inverse_mass


@dataclass(frozen=True)
class HandState:
    """Pose (x, z, theta) and twist (v_x, v_z, omega) of the hand at one instant."""

    x: Value
    z: Value
    theta: Value
    v_x: Value
    v_z: Value
    omega: Value


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

        Slip is measured against the hand at the end of the step, where the new velocity
        is. The lever is taken at its middle, which keeps a sticking body on a turning
        hand to second order.
        """
        lever = self.lever(state, start, end, dt)
        problem = self.problem(state, end, lever, normal_force, dt)
        y = problem.solve(self.iterations, self.settle)
        return self.after(state, start, end, lever, y, dt)

    def lever(
        self, state: Value, start: HandState, end: HandState, dt: Value
    ) -> tuple[Value, Value]:
        """CoM seen from the hand in the middle of the step, x_r and z_r [m]."""
        x, z, _, v_x, v_z, _ = components(state)
        half = 0.5 * dt
        return x + half * v_x - 0.5 * (start.x + end.x), z + half * v_z - 0.5 * (start.z + end.z)

    def problem(
        self,
        state: Value,
        end: HandState,
        lever: tuple[Value, Value],
        normal_force: Value,
        dt: Value,
    ) -> ImpulseProblem:
        """What the contact impulse of one step has to solve."""
        _, _, _, v_x, v_z, omega = components(state)
        x_r, z_r = lever
        b = (
            v_x + omega * z_r - end.v_x,
            v_z - dt * self.gravity - omega * x_r - end.v_z,
            omega - end.omega,
        )
        factor = self.factor or axis_factor(self.contact)
        return ImpulseProblem(
            scaled_inverse_mass(self.body, factor, x_r, z_r),
            [-(f[0] * b[0] + f[1] * b[1] + f[2] * b[2]) for f in factor],
            self.contact.faces * normal_force * dt,
        )

    def after(
        self,
        state: Value,
        start: HandState,
        end: HandState,
        lever: tuple[Value, Value],
        y: list[Value],
        dt: Value,
    ) -> list[Value]:
        """State after a step whose impulse is S y."""
        x, z, theta, v_x, v_z, omega = components(state)
        x_r, z_r = lever
        factor = self.factor or axis_factor(self.contact)
        p_x, p_z, p_t = (sum(factor[j][i] * y[j] for j in range(3)) for i in range(3))
        v_x = v_x + p_x / self.body.mass
        v_z = v_z - dt * self.gravity + p_z / self.body.mass
        omega = omega + (p_t + p_x * z_r - p_z * x_r) / self.body.inertia
        # The hand's own way and the slip: a sticking body meets the hand's pose exactly,
        # though its velocity is that of the step's end.
        turn = end.theta - start.theta - dt * end.omega
        return [
            x + end.x - start.x + dt * (v_x - end.v_x) - turn * z_r,
            z + end.z - start.z + dt * (v_z - end.v_z) + turn * x_r,
            theta + dt * omega + turn,
            v_x,
            v_z,
            omega,
        ]
