"""Limit-surface release on other shapes than the plain ellipsoid, see `models/surface.py`.

Each step is `ImpulseProblem` of limit_surface.py in the hand's axes, with slip K w - rhs for an
impulse w of gauge(w) <= R. Sticking, K w = rhs, is the answer if that is inside. Otherwise:

*A quartic.* Its gauge h is homogeneous: the ellipsoid w^T Q w = R^2, Q the Hessian of h^2 / 2,
touches the surface along the ray through w, with its normal and its curvature. The impulse of
largest dissipation on that ellipsoid, `ImpulseProblem` again, is the next w: a Newton iteration. In
the first iterations a share of the plane across w is added to Q, which keeps the normal: it bounds
the ellipsoid where the surface is flat, and makes the iterations converge from afar.

*Two points* are the patch of patch.py with two points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..body import Array, HandSamples
from ..surface import SurfaceShape
from .cases import Release, ReleaseCase
from .limit_surface import ITERATIONS, ImpulseProblem, LimitSurfaceStepping, step_wrenches
from .patch import ROWS, PatchRelease

#: Newton iterations on a quartic; of 1500 random steps on random quartics one needs more.
QUARTIC_ITERATIONS = 30
#: Share of the plane across w in the first iteration's Q, what is left of it in the next one, and
#: the least.
FIRST_SHARE, LEFT, LEAST = 1.0, 0.3, 1e-7
#: Change of w, as a share of R, at which the iterations end.
SETTLED = 1e-11
#: Places of the entries of `ImpulseProblem.matrix`: rows and columns.
PLACES = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]


@dataclass(frozen=True)
class ShapedRelease:
    """Moreau-Jean steps on a limit surface of a shape; `steps` over the opening, first order."""

    shape: SurfaceShape
    steps: int = 1000

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case."""
        pivot, slide = case.slip_onset(self.shape)
        if self.shape.quartic is None:
            release = PatchRelease(pressure="two-points", steps=self.steps).release(case)
            return replace(release, pivot=pivot, slide=slide)
        release = Release.from_nodes(self._nodes(case))
        wrench = step_wrenches(case, release)
        return replace(release, pivot=pivot, slide=slide, wrench=wrench)

    def _nodes(self, case: ReleaseCase) -> Array:
        """Time [s], CoM pose and twist (steps + 1, 7) after each step."""
        times = np.linspace(0.0, case.grip.opening, self.steps + 1)
        law = LimitSurfaceStepping(case.body, case.contact, case.gravity, turned=True)
        forces = case.grip.force((times[1:] + times[:-1]) / 2).tolist()
        rows = np.array([*case.hand.at(times)]).transpose(2, 0, 1).tolist()
        hands = [HandSamples(time, *row) for time, row in zip(times, rows, strict=True)]
        dt, states = case.grip.opening / self.steps, [case.start().tolist()]
        for k, force in enumerate(forces):
            state, ends = states[-1], hands[k : k + 2]
            lever = law.lever(state, ends, dt)
            w = self._impulse(law.problem(state, ends, lever, force, dt))
            states.append(law.after(state, ends, lever, w, dt))
        return np.column_stack([times, states])

    def _impulse(self, step: ImpulseProblem) -> list[float]:
        """The impulse w of largest dissipation."""
        matrix, rhs, radius = np.array(step.matrix)[ROWS].reshape(3, 3), step.rhs, step.radius
        w = np.linalg.solve(matrix, rhs) if radius > 0.0 else np.zeros(3)
        if self.shape.gauge(w) > radius:
            share, way = FIRST_SHARE, np.inf
            for _ in range(QUARTIC_ITERATIONS):
                if not way > SETTLED * radius:
                    break
                # Q = L L^T, w = T y with T = L^-T.
                factor = np.linalg.inv(np.linalg.cholesky(self._tangent(w, share))).T
                seen = (factor.T @ matrix @ factor)[PLACES].tolist()
                y = _solved(ImpulseProblem(seen, (factor.T @ rhs).tolist(), radius))
                found = factor @ y
                found *= radius / self.shape.gauge(found)
                way, w = np.abs(found - w).max(), found
                share = max(share * LEFT, LEAST)
        return w.tolist()

    def _tangent(self, w: Array, share: float) -> Array:
        """Q (3, 3) at w: the Hessian of sqrt(H) / 2, and the share of the plane across w."""
        u = w / np.linalg.norm(w)
        paired = self.shape.paired(u)
        half = paired @ u
        root = np.sqrt(half @ u)
        bend = 3.0 * paired / root - 2.0 * np.outer(half, half) / root**3
        return np.asarray(bend + share * root * (np.eye(3) - np.outer(u, u)))


def _solved(problem: ImpulseProblem) -> list[float]:
    """y of largest dissipation on the sphere |y| <= R."""
    iterate = problem.sticking()
    sticks = iterate.norm <= problem.radius
    for _ in range(ITERATIONS):
        if not problem.moving(iterate, sticks):
            break
        iterate = problem.refined(iterate, True)
    return problem.trimmed(iterate, sticks)
