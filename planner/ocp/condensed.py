"""The reduced QP: an NLP's linearisation in the `ReducedVariables` `u` of a throw.

Gaps, collocation and flight time are equations for all other variables (a null-space method). What
is left of the linearisation is a quadratic program in about 40 variables. One solve of it moves a
throw to a target nearby inside all limits, whichever of them become active on the way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array, Flags, Indices
from .nlp import MISS_PRICE
from .solver import Solution, Solver

Bounds = tuple[Array, Array]

#: Rows that fix the landing: the sensitivity is with respect to them.
LANDING = ("landing x", "landing theta")
#: Curvature below this share of the largest, or negative, is raised to it: along such directions
#: an optimum of the NLP may move far at no cost.
MIN_CURVATURE = 1e-4
#: Singular values of the active constraints below this share of the largest count as zero.
RANK_TOLERANCE = 1e-6
#: A step changes a variable of u by at most this share of the range of its bounds.
TRUST_REGION = 0.15
#: Price of a step that breaks a limit, per unit of u.
BREAKING_PRICE = 1e4
#: The QP starts with the limits that a step of this length in u may reach.
REACH = 0.5
#: Each round adds the limits that the QP's step breaks; the last step is taken as it is.
ROUNDS = 3
#: The number of limits in the QP is a multiple of this: a solver is made for each size.
SIZE_STEP = 32
#: Lengths and multipliers below this are zero, in u.
ZERO = 1e-7


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the reduced QP.

    du (size,); residual (L,): landing (x [m], theta [rad]) less target; multipliers of the NLP's
    rows (m,) and bounds (n,); full: whether no bound of the step is active.
    """

    du: Array
    residual: Array
    multipliers: tuple[Array, Array]
    full: bool
    _qp: CondensedQp
    _active: Flags

    @cached_property
    def slope(self) -> Array:
        """How u moves with the landing (size, L) while the limits that are active now stay so."""
        return self._qp.null_space_step(self._active)


@dataclass(frozen=True, eq=False)
class CondensedQp:
    """An NLP's linearisation in u (size,) about a point.

    point (n,): moved to where the equations hold; dx_du (n, size): how it follows u. landing
    (L, size): derivative of the landing (x, theta); target_offset (L,): from there to the target.
    rows (m, size), each of length one: limits; lower, upper (m,): distance to them. step_bounds
    (size,): longest step. hessian (size, size): of the Lagrangian, and active (m,): limits that
    bind at the point, where multipliers are known; without them the step's length in `step_bounds`.
    row_indices: of the limits among the NLP's rows, followed by its bounds; number of its rows.
    """

    point: Array
    dx_du: Array
    landing: Array
    target_offset: Array
    rows: Array
    lower: Array
    upper: Array
    step_bounds: Array
    hessian: Array
    active: Flags
    row_indices: tuple[Indices, int]

    @classmethod
    def about(
        cls, solver: Solver, point: Solution, parameters: Array, bounds: Bounds, indices: list[int]
    ) -> CondensedQp:
        """About a point with its multipliers (empty: none).

        bounds: of the decision vector; indices: of u in it. Raises LinAlgError where the equations
        do not determine the other variables.
        """
        nlp = solver.nlp
        g, jacobian = solver.jacobian(point.x, parameters)
        landing = np.isin(nlp.row_names, LANDING)
        equations = (nlp.lbg == nlp.ubg) & ~landing
        dx_du, dx = _eliminated(jacobian[equations], (g - nlp.lbg)[equations], indices)
        x, g = point.x + dx, g + jacobian @ dx
        limits, free = nlp.lbg < nlp.ubg, bounds[0] < bounds[1]
        rows = np.vstack([jacobian[limits] @ dx_du, dx_du[free]])
        values = np.concatenate([g[limits], x[free]])
        lower = np.concatenate([nlp.lbg[limits], bounds[0][free]]) - values
        upper = np.concatenate([nlp.ubg[limits], bounds[1][free]]) - values
        step_bounds = TRUST_REGION * (bounds[1] - bounds[0])[indices]
        hessian, multipliers = np.diag(step_bounds**-2), np.zeros(len(rows))
        if point.lam_g.size:
            hessian = dx_du.T @ solver.hessian(point.x, parameters, point.lam_g) @ dx_du
            multipliers = np.abs(np.concatenate([point.lam_g[limits], point.lam_x[free]]))
        length = np.linalg.norm(rows, axis=1)
        some = length > ZERO
        length = length[some]
        places = np.append(np.flatnonzero(limits), g.size + np.flatnonzero(free))
        return cls(
            x,
            dx_du,
            jacobian[landing] @ dx_du,
            (nlp.lbg - g)[landing],
            rows[some] / length[:, None],
            lower[some] / length,
            upper[some] / length,
            step_bounds,
            hessian,
            (np.minimum(-lower, upper) < multipliers)[some],
            (places[some], g.size),
        )

    @property
    def slope(self) -> Array:
        """How u moves where the target of an optimum does (size, L).

        du / d(x [m], theta [rad]) of the landing: the parametric sensitivity of the NLP's
        solution while the active limits stay active (Fiacco 1983).
        """
        return self.null_space_step(self.active)

    @property
    def with_fixed_duration(self) -> CondensedQp:
        """This without the first number of u, the carry's duration."""
        return replace(
            self,
            dx_du=self.dx_du[:, 1:],
            landing=self.landing[:, 1:],
            rows=self.rows[:, 1:],
            step_bounds=self.step_bounds[1:],
            hessian=self.hessian[1:, 1:],
        )

    def null_space_step(self, active: Flags) -> Array:
        """The cheapest du (size, L) that moves the landing by one each in the null space of the
        active limits."""
        free = _null_space(self.rows[active])
        landing = self.landing @ free
        if np.linalg.matrix_rank(landing, rtol=RANK_TOLERANCE) < len(landing):
            # The active limits leave no freedom for the target.
            free, landing = np.eye(len(self.hessian)), self.landing
        direct = np.linalg.pinv(landing)
        reduced = free.T @ self.hessian @ free
        inner = _null_space(landing)
        inverse = np.linalg.inv(_definite(inner.T @ reduced @ inner))
        return np.asarray(free @ (direct - inner @ (inverse @ (inner.T @ reduced @ direct))))

    def step(self, centre: Array, trust: float = 1.0) -> Step | None:
        """The step to the target inside all limits that is nearest to `centre` (size,).

        trust: share of the step bounds. It may miss the target, at a price. None where the QP has
        no solution.
        """
        longest, misses = trust * self.step_bounds, len(self.landing)
        size, slacks = len(longest), 2 * misses + 1
        # Variables: du, by how much the landing falls short and goes too far, broken limits.
        hessian = np.diag(np.append(np.zeros(size), np.full(slacks, MIN_CURVATURE)))
        hessian[:size, :size] = self.hessian
        gradient = np.append(-self.hessian @ centre, np.full(slacks, MISS_PRICE))
        gradient[-1] = BREAKING_PRICE
        target = np.hstack([self.landing, np.eye(misses), -np.eye(misses), np.zeros((misses, 1))])
        broken_now = np.where(self.lower > ZERO, 1.0, np.where(self.upper < -ZERO, -1.0, 0.0))
        bounds = (
            np.append(-longest, np.zeros(slacks)),
            np.append(longest, np.full(slacks, np.inf)),
        )
        reach = REACH + float(np.linalg.norm(centre))
        given = (self.lower > -reach) | (self.upper < reach)
        for _ in range(ROUNDS):
            some = _padded(given, np.minimum(-self.lower, self.upper))
            slack = np.column_stack([np.zeros((some.size, 2 * misses)), broken_now[some]])
            rows = np.vstack([np.hstack([self.rows[some], slack]), target])
            low, high = (np.append(v[some], self.target_offset) for v in (self.lower, self.upper))
            z, multipliers = _solved(hessian, gradient, rows, (low, high), bounds)
            if not np.isfinite(z).all():
                return None
            moved = self.rows @ z[:size] + broken_now * z[-1]
            broken = (moved < self.lower - ZERO) | (moved > self.upper + ZERO)
            if not (broken & ~given).any():
                break
            given |= broken
        active = np.zeros(len(self.rows), bool)
        active[some] = np.abs(multipliers[: some.size]) > ZERO
        places, count = self.row_indices
        of_nlp = np.zeros(count + len(self.point))
        of_nlp[places[some]] = multipliers[: some.size]
        du, full = z[:size], bool((np.abs(z[:size]) < longest - ZERO).all())
        residual = z[size + misses : -1] - z[size : size + misses]
        return Step(du, residual, (of_nlp[:count], of_nlp[count:]), full, self, active)


def _padded(given: Flags, distance: Array) -> Indices:
    """Indices of the given rows (m,) and of the nearest others, up to a multiple of SIZE_STEP."""
    count = min(-(-int(given.sum()) // SIZE_STEP) * SIZE_STEP, len(given))
    order = np.argsort(np.where(given, -np.inf, distance), kind="stable")
    return np.asarray(np.sort(order[:count]))


def _eliminated(jacobian: Any, residual: Array, indices: list[int]) -> tuple[Array, Array]:
    """What equations (E, n) say of all variables: their derivative in u (n, size), and their step
    (n,) to where the equations hold."""
    from scipy.sparse.linalg import splu

    others = np.delete(np.arange(jacobian.shape[1]), indices)
    known = np.column_stack([jacobian[:, indices].toarray(), residual])
    found = np.zeros((jacobian.shape[1], len(indices) + 1))
    found[indices, np.arange(len(indices))] = 1.0
    try:
        found[others] = splu(jacobian[:, others]).solve(-known)
    except RuntimeError as error:
        raise np.linalg.LinAlgError(str(error)) from None
    return found[:, :-1], found[:, -1]


def _solved(
    hessian: Array, gradient: Array, rows: Array, between: Bounds, bounds: Bounds
) -> tuple[Array, Array]:
    """Minimum of a QP and the multipliers of its rows, by DAQP; NaN where it finds none."""
    solver = _daqp(*rows.shape)
    found = solver(
        **{"h": hessian, "g": gradient, "a": rows, "lba": between[0], "uba": between[1]},
        **{"lbx": bounds[0], "ubx": bounds[1]},
    )
    z = np.array(found["x"]).ravel()
    return z if solver.stats()["success"] else z * np.nan, np.array(found["lam_a"]).ravel()


@lru_cache(maxsize=64)
def _daqp(rows: int, columns: int) -> Any:
    sizes = {"h": ca.Sparsity.dense(columns, columns), "a": ca.Sparsity.dense(rows, columns)}
    return ca.conic("step", "daqp", sizes, {"error_on_fail": False})


def _definite(matrix: Array) -> Array:
    """The symmetric matrix with its low and negative curvatures raised."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    largest = float(np.abs(values).max(initial=0.0))
    values = np.maximum(values, MIN_CURVATURE * max(largest, 1e-9))
    return np.asarray((vectors * values) @ vectors.T)


def _null_space(rows: Array) -> Array:
    """Orthonormal basis (n, k) of the null space of rows (m, n)."""
    if not len(rows):
        return np.eye(rows.shape[1])
    scale = np.linalg.norm(rows, axis=1, keepdims=True)
    _, sizes, basis = np.linalg.svd(rows / np.maximum(scale, 1e-300))
    rank = int((sizes > RANK_TOLERANCE * sizes[0]).sum())
    return np.asarray(basis[rank:].T)
