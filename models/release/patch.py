"""Pads as a grid of points with Coulomb friction, the reference for model errors.

A disc under 'uniform' or 'hertz' pressure gets rings of points; its radius is chosen so that pure
torsion is c r_p mu f_N, the limit of the ellipsoid in (19) of Liu and Billard. Backward Euler on
velocities, by `LimitSurfaceStepping`: per step the contact's slip twist v minimises the strictly
convex

    (v - b)^T K (v - b) / 2 + sum_i mu N_i dt |u_i(v)|,

b its free value, K the inertia seen at the contact, u_i the slip of point i. The corner of |u| is
rounded over a speed `CREEP`. Newton's method takes the shares y_i = u_i / |u_i| of Coulomb's limit
as unknowns of their own (as Chan, Golub and Mulet do for total variation), which makes it converge
from afar in two or three iterations; with v alone it would crawl along the corner.

LuGre bristles bound the effect of compliant pads. Each point has a bristle z in the plane (Canudas
de Wit et al. 1995, without Stribeck's effect, g(v) = mu, which makes the law passive for any
damping):

    z' = v - sigma_0 |v| z / mu,   f = -(sigma_0 z + sigma_1 z') N(t).

The stiffness falls with the normal force N: with a fixed one the bristles of a resting bar would
never relax. Backward Euler eliminates them: y = sigma_0 z / mu obeys y (c + |u|) = u + c y_old with
c = mu / (sigma_0 dt), a rigid patch with a memory.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..body import Array, Body, Flags, HandSamples, PinchContact, sticking_state
from .cases import BatchRelease, Release, ReleaseBatch, ReleaseCase, by_chunks, failed, onsets
from .limit_surface import LimitSurfaceStepping, step_wrenches

#: Speed [m/s] at which a rigid point has half of its friction; it has 99 % at 99 CREEP. Its error
#: of landings is up to 0.03 mm at 1e-9 and below 0.001 mm at 1e-12; 1e-13 takes up to twice the
#: iterations.
CREEP = 1e-12
UNSOLVED = "a step of the patch was not solved"
#: Throws of a chunk: arrays of points times throws fit the cache, and products are below 64^3,
#: above which BLAS uses threads that wait ten times longer on a busy machine.
PATCH_CHUNK = 112
#: The entries of `ImpulseProblem.matrix`, row by row.
ROWS = [0, 3, 4, 3, 1, 5, 4, 5, 2]
#: Disc radius over its torsion arm, the mean of |rho| weighted by pressure.
RADIUS_PER_ARM = {"uniform": 1.5, "hertz": 16.0 / (3.0 * math.pi)}


@dataclass(frozen=True)
class Patch:
    """Points x, z (P,) [m] from the hand's point, and weights (P,) that sum to 1.

    In the hand's frame, whose x axis is along the hand's angle. The weights are shares of the
    normal force.
    """

    x: Array
    z: Array
    weights: Array


def pad(pressure: str, points: int) -> Patch:
    """A pad of torsion arm 1: a `disc`, or by 'two-points' one point before and one behind."""
    two = Patch(np.array([-1.0, 1.0]), np.zeros(2), np.full(2, 0.5))
    return two if pressure == "two-points" else disc(pressure, points)


def disc(pressure: str = "uniform", points: int = 64, torsion_arm: float = 1.0) -> Patch:
    """About `points` points on a disc whose pure torsion is torsion_arm [m] times mu f_N.

    Gauss points along the radius (exact for the torsion integral) on half as many rings
    as a square would have rows, evenly around; no point lies on the hand's own axis,
    about which most releases are symmetric. Raises ValueError for an unknown pressure
    or fewer than 8 points.
    """
    if pressure not in RADIUS_PER_ARM:
        raise ValueError(f"pressure: {pressure!r} is not one of {', '.join(RADIUS_PER_ARM)}")
    if points < 8:
        raise ValueError(f"points: needs at least 8, got {points}")
    rings = math.isqrt(points) // 2
    sectors = points // rings
    # With r = sin(phi), r dr times the pressure is a power of cos(phi): smooth for both.
    nodes, weights = np.polynomial.legendre.leggauss(40)
    phi = (nodes + 1.0) * math.pi / 4.0
    density = weights * np.sin(phi) * np.cos(phi) ** (1 if pressure == "uniform" else 2)
    radius, share = _gauss(np.sin(phi), density / density.sum(), rings)
    angle = (np.arange(sectors) + 0.5) * (2.0 * math.pi / sectors)
    r = radius * RADIUS_PER_ARM[pressure] * torsion_arm
    x, z = np.outer(r, np.cos(angle)).ravel(), np.outer(r, np.sin(angle)).ravel()
    return Patch(x, z, np.repeat(share / sectors, sectors))


def _gauss(nodes: Array, weights: Array, count: int) -> tuple[Array, Array]:
    """Gauss rule of `count` points for the measure of many weighted nodes, by Lanczos."""
    basis = [np.sqrt(weights)]
    diagonal, coupling = [], []
    for _ in range(count):
        image = nodes * basis[-1]
        diagonal.append(image @ basis[-1])
        for vector in basis:
            image = image - (image @ vector) * vector
        coupling.append(float(np.linalg.norm(image)))
        basis.append(image / coupling[-1])
    matrix = np.diag(diagonal) + np.diag(coupling[:-1], 1) + np.diag(coupling[:-1], -1)
    values, vectors = np.linalg.eigh(matrix)
    return values, vectors[0] ** 2


@dataclass(frozen=True)
class SlipProblem:
    """One implicit step of N throws on a patch of torsion arm 1, for the slip v (3, N).

    K (v - b) + limit * sum_i w_i B_i^T y_i = 0,   u_i = B_i v,
    y_i (creep + |u_i|) = u_i + creep * memory_i.

    mass K (N, 3, 3); free b (3, N); limit (N,) [N s]; creep (N,) [m/s]; memory (2, P, N).
    The third slip is spin as a speed. The equations are strongly monotone for |memory_i| <= 1, so
    there is one solution.
    """

    mass: Array
    free: Array
    limit: Array
    creep: Array
    memory: Array

    def part(self, throws: Flags) -> SlipProblem:
        """The problem of the given throws."""
        limit, creep = self.limit[throws], self.creep[throws]
        return SlipProblem(
            self.mass[throws], self.free[:, throws], limit, creep, self.memory[..., throws]
        )

    def momentum(self, slip: Array) -> Array:
        """K v (3, N) [N s]."""
        return np.asarray(np.einsum("nij,jn->in", self.mass, slip))


class PointSolver:
    """Newton's method for the slip of a patch of torsion arm 1."""

    def __init__(self, patch: Patch) -> None:
        one, zero = np.ones(len(patch.x)), np.zeros(len(patch.x))
        at = np.array([[one, zero, -patch.z], [zero, one, patch.x]])  # B: (2, 3, P)
        self.points = len(patch.x)
        self._weights = patch.weights
        self._slip = at.transpose(0, 2, 1).reshape(-1, 3)
        self._collect = (at * patch.weights).transpose(1, 0, 2).reshape(3, -1)
        products = np.einsum("ajp,p,bkp->jkabp", at, patch.weights, at)
        self._products = products.reshape(9, -1)

    def slips(self, slip: Array) -> Array:
        """u (2, P, N) of the points for the slip (3, N) of the patch."""
        return np.asarray((self._slip @ slip).reshape(2, self.points, -1))

    def collect(self, share: Array) -> Array:
        """sum of w B^T y: force and torque (3, N) of shares (2, P, N)."""
        return np.asarray(self._collect @ share.reshape(2 * self.points, -1))

    def solve(self, problem: SlipProblem, slip: Array, share: Array) -> tuple[Array, Array, Flags]:
        """Slip (3, N) and shares (2, P, N), and which throws (N,) were not solved.

        slip, share: where to start.
        """
        load = problem.limit + np.abs(problem.momentum(problem.free)).max(axis=0)
        # Without a load there is no slip; from elsewhere rounding would not let it come to zero.
        slip = np.where(load > 0.0, slip, 0.0)
        slips_found, shares = slip.copy(), share.copy()
        unsolved = np.arange(slip.shape[1])
        # Usual are two or three iterations, 18 the most in trials. The residual allowed rises
        # tenfold every `patience` of them.
        floor, patience = 1e-12 * load, 12
        for i in range(5 * patience):
            u = self.slips(slip)
            speed = np.sqrt(u[0] ** 2 + u[1] ** 2)
            steep = 1.0 / (problem.creep + speed)
            exact = (u + problem.creep * problem.memory) * steep
            rest = problem.momentum(slip - problem.free) + problem.limit * self.collect(exact)
            allowed = floor[unsolved] * 10.0 ** (i // patience)
            if i >= patience:
                # Rounding of u; points that all but stick decide it.
                rounding = np.finfo(float).eps * problem.limit * (self._weights @ steep)
                allowed = np.maximum(allowed, rounding * np.abs(slip).max(axis=0))
            done = np.abs(rest).max(axis=0) <= allowed
            if done.any():
                slips_found[:, unsolved[done]] = slip[:, done]
                shares[:, :, unsolved[done]] = exact[:, :, done]
                go = ~done
                unsolved, problem = unsolved[go], problem.part(go)
                slip, share, rest, exact = slip[:, go], share[..., go], rest[:, go], exact[..., go]
                u, speed, steep = u[..., go], speed[:, go], steep[:, go]
            if unsolved.size == 0:
                break
            # Derivative of the shares by the slips of their points (2, 2, P, N).
            slope = -share[:, None] * (u / np.maximum(speed, 1e-300)) * steep
            slope[0, 0] += steep
            slope[1, 1] += steep
            matrix = (self._products @ slope.reshape(4 * self.points, -1)).T.reshape(-1, 3, 3)
            matrix = problem.mass + problem.limit[:, None, None] * matrix
            step = -np.linalg.solve(matrix, rest.T[:, :, None])[:, :, 0].T
            point_steps = self.slips(step)
            share = exact + slope[:, 0] * point_steps[0] + slope[:, 1] * point_steps[1]
            share /= np.maximum(np.sqrt(share[0] ** 2 + share[1] ** 2), 1.0)
            slip = slip + step
        return slips_found, shares, np.isin(np.arange(len(floor)), unsolved)


@dataclass(frozen=True)
class PatchThrows:
    """N releases side by side; every number of body and contact may be an array (N,).

    start (6, N): CoM pose and twist at time 0; hand: samples (3, K, N) at times (K, N);
    forces (K - 1, N): f_N of one pad in the middle of each step [N].
    """

    body: Body
    contact: PinchContact
    start: Array
    hand: HandSamples
    forces: Array
    gravity: Any = 9.81

    @classmethod
    def of(cls, case: ReleaseCase, steps: int) -> PatchThrows:
        """One case as a batch of one, in even steps."""
        times = np.linspace(0.0, case.grip.opening, steps + 1)
        forces = case.grip.force((times[1:] + times[:-1]) / 2)[:, None]
        samples = HandSamples(times[:, None], *(rows[..., None] for rows in case.hand.at(times)))
        return cls(case.body, case.contact, case.start()[:, None], samples, forces, case.gravity)

    @classmethod
    def of_batch(cls, batch: ReleaseBatch, steps: int) -> PatchThrows:
        """A batch, each throw in even steps of its own opening."""
        shares = np.linspace(0.0, 1.0, steps + 1)
        times = shares[:, None] * batch.opening
        samples = [np.array(part) for part in zip(*map(batch.hands.at, times), strict=True)]
        hand = HandSamples(times, *(part.transpose(1, 0, 2) for part in samples))
        forces = np.array(batch.forces((shares[1:] + shares[:-1]) / 2))
        pose, twist, offset = hand.pose[:, 0], hand.twist[:, 0], batch.body.com_offset
        start = np.array(sticking_state(pose, twist, batch.grasp_angle, offset))
        return cls(batch.body, batch.contact, start, hand, forces, batch.gravity)


@dataclass(frozen=True)
class PatchRelease:
    """About `points` points, 'uniform', 'hertz' or 'two-points'; first order in steps.

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
        run = self.march(PatchThrows.of(case, self.steps))
        times = run.times[:, 0]
        if not np.isfinite(run.com).all():
            return failed(times, UNSOLVED)
        release = Release(times, run.com[..., 0], run.com_twist[..., 0], run.pivot, run.slide)
        return replace(release, wrench=step_wrenches(case, release))

    def throw(self, batch: ReleaseBatch, steps: int) -> BatchRelease:
        """N releases; NaN for a throw with a step that was not solved."""

        def chunk(part: ReleaseBatch) -> BatchRelease:
            detach = self.march(PatchThrows.of_batch(part, steps)).end.T
            return BatchRelease(detach, np.zeros(part.count, bool), UNSOLVED)

        return by_chunks(batch, chunk, PATCH_CHUNK)

    def march(self, throws: PatchThrows) -> Release:
        """N releases side by side: times (K, N), com and com_twist (3, K, N), no wrench.

        Throws with a step that was not solved are NaN.
        """
        solver = PointSolver(pad(self.pressure, self.points))
        hand, state, friction = throws.hand, throws.start, throws.contact.friction
        law = LimitSurfaceStepping(throws.body, throws.contact, throws.gravity, turned=True)
        dt = np.diff(hand.times, axis=0)
        limits = throws.contact.force_limit(throws.forces) * dt
        count = state.shape[1]
        slip, share = np.zeros((3, count)), np.zeros((2, solver.points, count))
        creep, none = np.full(count, CREEP), share
        states, unsolved = [state], np.zeros(count, bool)
        first: tuple[float | None, float | None] | None = None
        for k in range(len(dt)):
            ends = [HandSamples(hand.times[i], *(v[:, i] for v in hand)) for i in (k, k + 1)]
            lever = law.lever(state, ends, dt[k])
            # The law's impulse y is in units of the friction, its torque over the torsion arm.
            step = law.problem(state, ends, lever, 1.0, dt[k])
            inverse = (np.array(step.matrix)[ROWS] / friction**2).T.reshape(-1, 3, 3)
            free = -np.array(step.rhs) / friction
            rigid = SlipProblem(np.linalg.inv(inverse), free, limits[k], creep, none)
            problem = rigid
            if self.stiffness is not None:
                if k == 0:
                    # The wrench of a rigid patch in the first step is the load at rest.
                    slip, share, _ = solver.solve(rigid, slip, share)
                problem = self._bristled(rigid, self.stiffness, throws, solver, share, dt[k])
            slip, share, missed = solver.solve(problem, slip, share)
            unsolved |= missed
            # A sticking patch creeps at a few CREEP.
            if self.stiffness is None and count == 1 and not first and np.abs(slip).max() > 1e-8:
                first = onsets(float(hand.times[k, 0]), slip[:, 0], 1.0)
            y = rigid.momentum(slip - free) / friction
            state = np.array(law.after(state, ends, lever, y, dt[k]))
            states.append(state)
        track = np.array(states).transpose(1, 0, 2)
        track[:, :, unsolved] = np.nan
        pivot, slide = first or (None, None)
        return Release(hand.times, track[:3], track[3:], pivot, slide)

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

        sigma_1 z' is limit * ratio * (y - share). The full grip is that of the first step.
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
