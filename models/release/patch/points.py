"""The pad patch as points: their pressure, and their total friction.

A disc under 'uniform' or 'hertz' pressure gets rings of points; its radius is chosen so
that pure torsion is c r_p mu f_N, the limit of the ellipsoid in (19) of Liu and Billard.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...body import Array, Flags

#: Largest number of Newton iterations of a step; usual are two or three, 18 the most in trials.
ITERATIONS = 60
#: Residual over the friction limit at which they end. It rises tenfold every PATIENCE iterations,
#: and after the first of these to the rounding of u / creep at an almost sticking point.
TOLERANCE = 1e-12
PATIENCE = 12

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
    r = np.repeat(radius, sectors) * RADIUS_PER_ARM[pressure] * torsion_arm
    angles_tiled = np.tile(angle, rings)
    return Patch(
        r * np.cos(angles_tiled), r * np.sin(angles_tiled), np.repeat(share / sectors, sectors)
    )


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
    The third slip is spin as a speed. The equations are strongly monotone for
    |memory_i| <= 1, so there is one solution. Without memory they are the gradient of a
    convex function, friction's work with |u| rounded over `creep`.
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
    """Newton's method for the slip of a patch of torsion arm 1.

    The shares y_i of the limit are unknowns of their own, as Chan, Golub and Mulet do for
    total variation; with v alone it would crawl along the corner of |u|.
    """

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
        slips_found, shares = slip.copy(), share.copy()
        unsolved = np.arange(slip.shape[1])
        floor = TOLERANCE * (problem.limit + np.abs(problem.momentum(problem.free)).max(axis=0))
        for i in range(ITERATIONS):
            u = self.slips(slip)
            speed = np.sqrt(u[0] ** 2 + u[1] ** 2)
            steep = 1.0 / (problem.creep + speed)
            exact = (u + problem.creep * problem.memory) * steep
            rest = problem.momentum(slip - problem.free) + problem.limit * self.collect(exact)
            allowed = floor[unsolved] * 10.0 ** (i // PATIENCE)
            if i >= PATIENCE:
                allowed = np.maximum(allowed, self._rounding(problem, slip, steep))
            done = np.abs(rest).max(axis=0) <= allowed
            if done.any():
                slips_found[:, unsolved[done]], shares[:, :, unsolved[done]] = (
                    slip[:, done],
                    exact[:, :, done],
                )
                go = ~done
                unsolved, problem = unsolved[go], problem.part(go)
                slip, share, rest, exact = slip[:, go], share[..., go], rest[:, go], exact[..., go]
                directions, steep = u[..., go] / np.maximum(speed[:, go], 1e-300), steep[:, go]
            else:
                directions = u / np.maximum(speed, 1e-300)
            if unsolved.size == 0:
                break
            # Derivative of the shares by the slips of their points (2, 2, P, N).
            slope = -share[:, None] * directions * steep
            slope[0, 0] += steep
            slope[1, 1] += steep
            step = self._newton_step(problem, rest, slope)
            point_steps = self.slips(step)
            share = exact + slope[:, 0] * point_steps[0] + slope[:, 1] * point_steps[1]
            share /= np.maximum(np.sqrt(share[0] ** 2 + share[1] ** 2), 1.0)
            slip = slip + step
        return slips_found, shares, np.isin(np.arange(len(floor)), unsolved)

    def _rounding(self, problem: SlipProblem, slip: Array, steep: Array) -> Array:
        """Bound of the residual (N,) by rounding of u; points that all but stick decide it."""
        weighted = problem.limit * (self._weights @ steep)
        return np.asarray(np.finfo(float).eps * weighted * np.abs(slip).max(axis=0))

    def _newton_step(self, problem: SlipProblem, rest: Array, slope: Array) -> Array:
        matrix = (self._products @ slope.reshape(4 * self.points, -1)).T.reshape(-1, 3, 3)
        matrix = problem.mass + problem.limit[:, None, None] * matrix
        return np.asarray(-np.linalg.solve(matrix, rest.T[:, :, None])[:, :, 0].T)
