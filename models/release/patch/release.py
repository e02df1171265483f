"""A rigid patch of points with Coulomb friction: the reference for releases.

Backward Euler on velocities, as in time_stepping: per step the contact's slip twist v
minimises the strictly convex

    (v - b)^T K (v - b) / 2 + sum_i mu N_i dt |u_i(v)|,

b its free value, K the inertia seen at the contact, u_i the slip of point i. The corner
of |u| is rounded over a speed `creep`, far below anything that matters. Newton's method
takes the shares y_i = u_i / |u_i| of Coulomb's limit as unknowns of their own (as Chan,
Golub and Mulet do for total variation), which makes it converge from afar in two or
three iterations. A bristle of the LuGre law is one more term in the same equations:
with the bristle's share y_i of the last step they read y (creep + |u|) = u + creep y_i.

LuGre bristles bound the effect of compliant pads. Each point has a bristle z in
the plane (Canudas de Wit et al. 1995, without Stribeck's effect, g(v) = mu, which makes
the law passive for any damping):

    z' = v - sigma_0 |v| z / mu,   f = -(sigma_0 z + sigma_1 z') N(t).

The stiffness falls with the normal force N: with a fixed one the bristles of a resting
bar would never relax. Backward Euler eliminates them: y = sigma_0 z / mu obeys
y (c + |u|) = u + c y_old with c = mu / (sigma_0 dt), a rigid patch with a memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...body import Array, Body, Contact, HandSamples, sticking_state
from ..cases import (
    UNSOLVED,
    BatchRelease,
    Release,
    ReleaseBatch,
    ReleaseCase,
    by_chunks,
    failed,
    onsets,
)
from .points import PointSolver, SlipProblem, disc

#: Speed [m/s] at which a rigid point has half of its friction; it has 99 % at 99 CREEP. Its error
#: of landings is up to 0.03 mm at 1e-9 and below 0.001 mm at 1e-12; 1e-13 takes up to twice the
#: iterations.
CREEP = 1e-12
#: Slip [m/s] above which a patch moves; a sticking one creeps at a few CREEP.
MOVING = 1e-8
#: Throws of a chunk: arrays of points times throws fit the cache, and products are below 64^3,
#: above which BLAS uses threads that wait ten times longer on a busy machine.
PATCH_CHUNK = 112


@dataclass(frozen=True)
class PatchThrows:
    """N releases side by side; every number of body and contact may be an array (N,).

    start (6, N): CoM pose and twist at time 0; hand: samples (3, K, N) at times (K, N);
    forces (K - 1, N): f_N of one pad in the middle of each step [N].
    """

    body: Body
    contact: Contact
    start: Array
    hand: HandSamples
    forces: Array
    gravity: Any = 9.81

    @classmethod
    def of(cls, case: ReleaseCase, steps: int) -> PatchThrows:
        """One case as a batch of one, in even steps."""
        times = np.linspace(0.0, case.grip.opening, steps + 1)
        forces = case.grip.force((times[1:] + times[:-1]) / 2)[:, None]
        hand = case.hand.at(times)
        stacked = (hand.pose[..., None], hand.twist[..., None], hand.acceleration[..., None])
        samples = HandSamples(times[:, None], *stacked)
        return cls(case.body, case.contact, case.start()[:, None], samples, forces, case.gravity)

    @classmethod
    def of_batch(cls, batch: ReleaseBatch, steps: int) -> PatchThrows:
        """A batch, each throw in even steps of its own opening."""
        shares = np.linspace(0.0, 1.0, steps + 1)
        times = shares[:, None] * batch.opening
        samples = [np.array(part) for part in zip(*map(batch.hands.at, times), strict=True)]
        hand = HandSamples(times, *(part.transpose(1, 0, 2) for part in samples))
        shape = batch.grip.force((shares[1:] + shares[:-1]) / 2 * batch.grip.opening)
        forces = (shape / batch.grip.full)[:, None] * batch.force
        pose, twist, offset = hand.pose[:, 0], hand.twist[:, 0], batch.body.com_offset
        start = np.array(sticking_state(pose, twist, batch.grasp_angle, offset))
        return cls(batch.body, batch.contact, start, hand, forces, batch.gravity)


@dataclass(frozen=True)
class PatchRelease:
    """A patch of about `points` points, under 'uniform' or 'hertz' pressure; first order in steps.

    stiffness sigma_0 [1/m]: LuGre bristles on the points, loaded at time 0 so that the body
    rests, with a travel of mu / sigma_0 to full friction; None for rigid points.
    damping_ratio: of the body on the bristles at full grip.
    """

    points: int = 64
    pressure: str = "uniform"
    steps: int = 500
    stiffness: float | None = None
    damping_ratio: float = 1.0

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case; `trouble` says so if a step was not solved.

        Bristles creep: they have no onset of slip; that of rigid points is good to a step.
        """
        march_result = self.march(PatchThrows.of(case, self.steps))
        times = march_result.times[:, 0]
        if not np.isfinite(march_result.com).all():
            return failed(times, UNSOLVED)
        assert march_result.wrench is not None
        com, twist, wrench = (
            v[..., 0] for v in (march_result.com, march_result.com_twist, march_result.wrench)
        )
        return Release(times, com, twist, march_result.pivot, march_result.slide, wrench)

    def throw(self, batch: ReleaseBatch, steps: int) -> BatchRelease:
        """N releases; NaN for a throw with a step that was not solved."""

        def chunk(part: ReleaseBatch) -> BatchRelease:
            detach = self.march(PatchThrows.of_batch(part, steps)).end.T
            return BatchRelease(detach, np.zeros(part.count, bool), UNSOLVED)

        return by_chunks(batch, chunk, PATCH_CHUNK)

    def march(self, throws: PatchThrows) -> Release:
        """N releases side by side: times (K, N), com, com_twist and wrench (3, K, N).

        Throws with a step that was not solved are NaN.
        """
        arm = np.asarray(throws.contact.torsion_arm, float)
        solver = PointSolver(disc(self.pressure, self.points))
        hand, state = throws.hand, throws.start
        dt = np.diff(hand.times, axis=0)
        # The hand's displacement in each step beyond that of its twist at the step's end.
        way = np.diff(hand.pose, axis=1) - dt * hand.twist[:, 1:]
        middle = (hand.pose[:, 1:] + hand.pose[:, :-1]) / 2
        limits = throws.contact.force_limit(throws.forces) * dt
        count = state.shape[1]
        slip, share = np.zeros((3, count)), np.zeros((2, solver.points, count))
        creep, none = np.full(count, CREEP), share
        states, wrenches, unsolved = [state], [], np.zeros(count, bool)
        first: tuple[float | None, float | None] | None = None
        for k in range(len(dt)):
            frame = _Frame.of(throws, state, (middle[:, k], hand.twist[:, k + 1]), arm, dt[k])
            problem = SlipProblem(frame.mass, frame.free, limits[k], creep, none)
            if self.stiffness is not None:
                if k == 0:
                    # The wrench of a rigid patch in the first step is the load at rest.
                    slip, share, _ = solver.solve(problem, slip, share)
                problem = self._bristled(problem, self.stiffness, throws, solver, share, dt[k])
            slip, share, missed = solver.solve(problem, slip, share)
            unsolved |= missed
            if self.stiffness is None and count == 1 and not first and np.abs(slip).max() > MOVING:
                first = onsets(float(hand.times[k, 0]), slip[:, 0], 1.0)
            state, impulse = frame.after(state, slip, way[:, k], dt[k])
            states.append(state)
            wrenches.append(impulse / dt[k])
        track = np.array(states).transpose(1, 0, 2)
        wrench = np.array([wrenches[0], *wrenches]).transpose(1, 0, 2)
        track[:, :, unsolved] = np.nan
        pivot, slide = first or (None, None)
        return Release(hand.times, track[:3], track[3:], pivot, slide, wrench)

    def _bristled(
        self,
        rigid: SlipProblem,
        stiffness: float,
        throws: PatchThrows,
        solver: PointSolver,
        share: Array,
        dt: Array,
    ) -> SlipProblem:
        """The step of a rigid patch with bristles in place of the rigid points.

        With y = sigma_0 z / mu and c = mu / (sigma_0 dt) the bristles read
        y (c + |u|) = u + c share; sigma_1 z' is limit * ratio * (y - share). The full grip
        is that of the first step.
        """
        friction = np.broadcast_to(np.asarray(throws.contact.friction, float), dt.shape)
        grip = throws.contact.faces * throws.forces[0]
        damping = self.damping_ratio * critical_damping(throws.body.mass, grip, stiffness)
        ratio = np.asarray(damping / (stiffness * dt))
        rhs = rigid.momentum(rigid.free) + rigid.limit * ratio * solver.collect(share)
        free = np.asarray(np.linalg.solve(rigid.mass, rhs.T[:, :, None])[:, :, 0].T)
        creep = np.asarray(friction / (stiffness * dt))
        return SlipProblem(rigid.mass, free, rigid.limit * (1.0 + ratio), creep, share)


def critical_damping(mass: Array | float, normal_force: Array | float, stiffness: float) -> Array:
    """sigma_1 [s/m] that just stops a mass [kg] swinging on bristles under a force [N].

    m s'' + N sigma_1 s' + N sigma_0 s = 0 with damping ratio 1.
    """
    held = np.maximum(np.asarray(normal_force, float), 1e-9)
    return np.asarray(2.0 * np.sqrt(stiffness * np.asarray(mass) / held))


@dataclass(frozen=True)
class _Frame:
    """One step seen at the contact, in the hand's frame, spin as a speed (arm times omega).

    mass (N, 3, 3): inertia; free (3, N): slip without friction; lever (2, N), world axes,
    in the middle of the step; hand (3, N): its twist at the end of the step, against which
    slip is measured; turn: cos and sin of its angle.
    """

    mass: Array
    free: Array
    lever: Array
    hand: Array
    turn: tuple[Array, Array]
    arm: Array

    @classmethod
    def of(
        cls, throws: PatchThrows, state: Array, hand: tuple[Array, Array], arm: Array, dt: Array
    ) -> _Frame:
        """hand: its pose in the middle of the step, its twist at the end."""
        body, (middle, twist) = throws.body, hand
        cos, sin = np.cos(middle[2]), np.sin(middle[2])
        x_r, z_r = state[:2] + dt / 2 * state[3:5] - middle[:2]
        b_x = state[3] + state[5] * z_r - twist[0]
        b_z = state[4] - throws.gravity * dt - state[5] * x_r - twist[1]
        free = [cos * b_x + sin * b_z, cos * b_z - sin * b_x, arm * (state[5] - twist[2])]
        x_h, z_h = (cos * x_r + sin * z_r) / arm, (cos * z_r - sin * x_r) / arm
        m, zero = body.mass + 0.0 * x_r, 0.0 * x_r
        spin = m * (x_h * x_h + z_h * z_h) + body.inertia / arm**2
        mass = np.array([[m, zero, -m * z_h], [zero, m, m * x_h], [-m * z_h, m * x_h, spin]])
        lever = np.array([x_r, z_r])
        return cls(mass.transpose(2, 0, 1), np.array(free), lever, twist, (cos, sin), arm)

    def after(self, state: Array, slip: Array, way: Array, dt: Array) -> tuple[Array, Array]:
        """State after the step, and the friction impulse at the contact, for `slip` (3, N).

        As in LimitSurfaceStepping, a sticking body meets the hand's pose exactly.
        """
        cos, sin = self.turn
        v_x = cos * slip[0] - sin * slip[1] + self.hand[0]
        v_z = sin * slip[0] + cos * slip[1] + self.hand[1]
        omega = slip[2] / self.arm + self.hand[2]
        x_r, z_r = self.lever
        twist = np.array([v_x - omega * z_r, v_z + omega * x_r, omega])
        p = np.einsum("nij,jn->in", self.mass, slip - self.free)
        impulse = np.array([cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], self.arm * p[2]])
        carried = np.array([way[0] - way[2] * z_r, way[1] + way[2] * x_r, way[2]])
        return np.concatenate([state[:3] + dt * twist + carried, twist]), impulse
