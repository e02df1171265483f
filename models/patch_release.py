"""A rigid patch of points with Coulomb friction each: the honest reference for a release.

Backward Euler on velocities, as in time_stepping: per step the contact's slip twist v
minimises the strictly convex

    (v - b)^T K (v - b) / 2 + sum_i mu N_i dt |u_i(v)|,

b its free value, K the inertia seen at the contact, u_i the slip of point i. The corner
of |u| is rounded over a speed `creep`, far below anything that matters. Newton's method
takes the shares y_i = u_i / |u_i| of Coulomb's limit as unknowns of their own (as Chan,
Golub and Mulet do for total variation), which makes it converge from afar in two or
three iterations. A bristle of the LuGre law is one more term in the same equations:
with the bristle's share y_i of the last step they read y (creep + |u|) = u + creep y_i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .contact import Body, Contact
from .grip_force import LinearRelease
from .patch import PointSolver, Pressure, scaled_patch
from .release import HandSamples, Release, ReleaseCase

Array = npt.NDArray[np.float64]

#: Speed [m/s] over which a rigid point's friction builds up: 0.05 nm in an opening.
CREEP = 1e-9


@dataclass(frozen=True)
class Throws:
    """N releases side by side; every number of body and contact may be an array (N,).

    start (6, N): CoM pose and twist at time 0; hand: samples (3, K, N) at times (K, N);
    forces (K - 1, N): f_N of one pad in the middle of each step [N].
    """

    body: Body
    contact: Contact
    start: Array
    hand: HandSamples
    forces: Array
    gravity: float = 9.81

    @classmethod
    def of(cls, case: ReleaseCase, steps: int) -> Throws:
        """One case as a batch of one."""
        times = np.linspace(0.0, case.grip.opening, steps + 1)
        forces = case.grip.force((times[1:] + times[:-1]) / 2)[:, None]
        hand = case.hand.at(times)
        stacked = (hand.pose[..., None], hand.twist[..., None], hand.acceleration[..., None])
        samples = HandSamples(times[:, None], *stacked)
        return cls(case.body, case.contact, case.start()[:, None], samples, forces, case.gravity)

    @classmethod
    def constant(
        cls,
        body: Body,
        contact: Contact,
        hand: tuple[Array, Array, Array],
        grip: tuple[Array, Array],
        steps: int,
        gravity: float = 9.81,
        grasp_angle: npt.ArrayLike = 0.0,
    ) -> Throws:
        """Hands with constant acceleration and grips that fall linearly.

        hand: pose, twist, acceleration at time 0, each (3, N); grip: full force of one pad
        (N,) [N] and opening (N,) [s]; the body starts sticking at grasp_angle (N,) [rad].
        """
        pose, twist, acceleration = (np.asarray(value, float)[:, None] for value in hand)
        full, opening = (np.asarray(value, float) for value in grip)
        t = np.linspace(0.0, 1.0, steps + 1)[:, None] * opening
        place = pose + twist * t + acceleration * t * t / 2
        samples = HandSamples(
            t, place, twist + acceleration * t, np.broadcast_to(acceleration, place.shape)
        )
        forces = LinearRelease(1.0, 0.0, 1.0).force((np.arange(steps)[:, None] + 0.5) / steps)
        angle = pose[2, 0] + grasp_angle
        x_r, z_r = body.com_offset * np.cos(angle), body.com_offset * np.sin(angle)
        v_x, v_z, omega = twist[:, 0]
        com = [pose[0, 0] + x_r, pose[1, 0] + z_r, angle]
        start = np.array([*com, v_x - omega * z_r, v_z + omega * x_r, omega])
        return cls(body, contact, start, samples, full * forces, gravity)


@dataclass(frozen=True)
class Bristles:
    """LuGre bristles: stiffness sigma_0 [1/m], damping sigma_1, viscous sigma_2 [s/m]."""

    stiffness: float
    damping: Array | float
    viscous: float = 0.0


@dataclass(frozen=True)
class PatchRelease:
    """Rigid patch of about `points` points; first order in 1 / steps."""

    points: int = 64
    pressure: Pressure = "uniform"
    steps: int = 500

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case; `trouble` says so if a step was not solved."""
        return single(patch_batch(Throws.of(case, self.steps), self.points, self.pressure))


def single(batch: Release) -> Release:
    """The only release of a batch of one."""
    wrench = None if batch.wrench is None else batch.wrench[..., 0]
    parts = batch.times[:, 0], batch.com[..., 0], batch.com_twist[..., 0]
    return Release(*parts, wrench=wrench, trouble=batch.trouble)


def patch_batch(
    throws: Throws,
    points: int = 64,
    pressure: Pressure = "uniform",
    bristles: Bristles | None = None,
) -> Release:
    """N releases in one run: times (K, N), com, com_twist and wrench (3, K, N).

    bristles: LuGre's law in place of Coulomb's, loaded at time 0 so that the body rests
    in the hand. `trouble` counts the throws with a step that Newton did not solve.
    """
    patch, arm = scaled_patch(throws.contact, pressure, points)
    solver = PointSolver(patch)
    hand, state = throws.hand, throws.start
    dt = np.diff(hand.times, axis=0)
    moved, middle = np.diff(hand.pose, axis=1) / dt, (hand.pose[:, 1:] + hand.pose[:, :-1]) / 2
    limits = throws.contact.force_limit(throws.forces) * dt
    slip, share = np.zeros(state[:3].shape), np.zeros((2, len(patch.x), state.shape[1]))
    states, wrenches, unsolved = [state], [], np.zeros(state.shape[1], bool)
    for k in range(len(dt)):
        frame = _Frame.of(throws, state, middle[:, k], moved[:, k], arm, dt[k])
        creep: Array | float = CREEP
        if bristles and k == 0:
            # What a rigid patch gives in the first step is the load at rest.
            _, share, _ = solver.solve(frame.mass, frame.free, limits[0], CREEP, 0.0, slip, share)
        if bristles is None:
            step = frame.mass, frame.free, limits[k], creep, 0.0
        else:
            step = _bristled(throws, bristles, solver, frame, (limits[k], dt[k]), share)
        slip, share, open_ = solver.solve(*step, slip, share)
        unsolved |= open_
        state, impulse = frame.after(throws, state, slip, dt[k])
        states.append(state)
        wrenches.append(impulse / dt[k])
    track = np.array(states).transpose(1, 0, 2)
    wrench = np.array([wrenches[0], *wrenches]).transpose(1, 0, 2)
    bad = unsolved | ~np.isfinite(track).all(axis=(0, 1))
    trouble = f"{bad.sum()} of {bad.size} throws have a step that was not solved" * bool(bad.any())
    return Release(hand.times, track[:3], track[3:], wrench=wrench, trouble=trouble)


def _bristled(
    throws: Throws,
    bristles: Bristles,
    solver: PointSolver,
    frame: _Frame,
    load: tuple[Array, Array],
    share: Array,
) -> tuple[Array, Array, Array, Array | float, Array]:
    """The step's equations with bristles eliminated: mass, free slip, limit, creep, memory.

    load: mu times the normal force of all faces times dt, and dt.
    """
    limit, dt = load
    friction = np.asarray(throws.contact.friction, float)
    # sigma_1 z' weighs the change of share in the step: limit * ratio * (y - share).
    ratio = np.asarray(bristles.damping / (bristles.stiffness * dt))
    damped = limit * ratio * (solver.collect @ share.reshape(-1, share.shape[2]))
    mass = frame.mass
    if bristles.viscous:
        mass = mass + (limit / friction * bristles.viscous)[:, None, None] * solver.spread
    rhs = np.einsum("nij,jn->in", frame.mass, frame.free) + damped
    free = np.linalg.solve(mass, rhs.T[:, :, None])[:, :, 0].T
    creep = friction / (bristles.stiffness * dt)
    return mass, free, limit * (1.0 + ratio), creep, share


@dataclass(frozen=True)
class _Frame:
    """One step seen at the contact, in the hand's frame, spin as a speed (arm times omega).

    mass (N, 3, 3): inertia; free (3, N): slip without friction; lever (2, N), world axes,
    in the middle of the step; hand (3, N): mean twist; turn: cos and sin of its angle.
    """

    mass: Array
    free: Array
    lever: Array
    hand: Array
    turn: tuple[Array, Array]
    arm: Array

    @classmethod
    def of(
        cls, throws: Throws, state: Array, middle: Array, moved: Array, arm: Array, dt: Array
    ) -> _Frame:
        body = throws.body
        cos, sin = np.cos(middle[2]), np.sin(middle[2])
        x_r, z_r = state[:2] + dt / 2 * state[3:5] - middle[:2]
        b_x = state[3] + state[5] * z_r - moved[0]
        b_z = state[4] - throws.gravity * dt - state[5] * x_r - moved[1]
        free = [cos * b_x + sin * b_z, cos * b_z - sin * b_x, arm * (state[5] - moved[2])]
        x_h, z_h = (cos * x_r + sin * z_r) / arm, (cos * z_r - sin * x_r) / arm
        m, zero = body.mass + 0.0 * x_r, 0.0 * x_r
        spin = m * (x_h * x_h + z_h * z_h) + body.inertia / arm**2
        mass = np.array([[m, zero, -m * z_h], [zero, m, m * x_h], [-m * z_h, m * x_h, spin]])
        lever = np.array([x_r, z_r])
        return cls(mass.transpose(2, 0, 1), np.array(free), lever, moved, (cos, sin), arm)

    def after(self, throws: Throws, state: Array, slip: Array, dt: Array) -> tuple[Array, Array]:
        """State after the step, and the friction impulse at the contact, for `slip` (3, N)."""
        cos, sin = self.turn
        v_x = cos * slip[0] - sin * slip[1] + self.hand[0]
        v_z = sin * slip[0] + cos * slip[1] + self.hand[1]
        omega = slip[2] / self.arm + self.hand[2]
        x_r, z_r = self.lever
        twist = np.array([v_x - omega * z_r, v_z + omega * x_r, omega])
        p = np.einsum("nij,jn->in", self.mass, slip - self.free)
        impulse = np.array([cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], self.arm * p[2]])
        return np.concatenate([state[:3] + dt * twist, twist]), impulse
