"""The reduced variables `u` of a throw, and the NLP as a quadratic program in them.

u, about 40 numbers, has the carry's duration, a free start and the controls, jerks. Gaps,
collocation and flight time are equations for all other variables; eliminating these leaves a QP in
u (a null-space method). One solve of it moves a throw to a nearby target inside all limits, with
any change of the active set.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np

from ...core import Structure, array, library, out
from ...models import Array, Flags, Indices, ReadOnly, Trajectory
from .problem import variable_bounds
from .request import BASE, Refinement, Request
from .solver import Solution, Solver
from .stages import JERK_UNIT, Layout

Bounds = tuple[Array, Array]

#: Names of the landing's rows; sensitivities are to these.
LANDING = ("landing x", "landing theta")
#: A moved throw whose u leaves its bounds by up to this share of their range is still sampled.
SLACK = 1.0
#: Rounding [s] of a duration in single precision.
ROUNDING = 1e-6


@dataclass(frozen=True)
class ReducedVariables:
    """The variables `u` of a request's throws, and their motion.

    u (size,): the carry's duration [s], the start (n,) where it is free, the controls (n,) of
    each interval in the units of the decision vector.
    """

    request: Request

    @property
    def size(self) -> int:
        """Length of u."""
        return int(self.core.size)

    @cached_property
    def core(self) -> Structure:
        """Layout and bounds of u for the compiled core, without a sensitivity."""
        manipulator, (low, high) = self.request.manipulator, self._bounds
        carry, opening = self.request.scene.nlp.carry, np.diff(self.request.nodes)
        n, size = manipulator.size, low.size
        core = Structure("move", n=n, carry=carry, size=size, unit=JERK_UNIT)
        core.stages, core.before = carry + opening.size, self.request.nodes[0]
        core.shortest, core.longest = variable_bounds(self.request)["T"]
        rate, acceleration = manipulator.initial_motion
        arrays = {"rate": (rate, n), "acceleration": (acceleration, n)}
        arrays |= {"opening": (opening, opening.size), "low": (low, size), "high": (high, size)}
        if manipulator.start is not None:
            arrays["start"] = manipulator.start, n
        for name, (values, length) in arrays.items():
            core.attach(**{name: array(np.ascontiguousarray(values, float), length)})
        return core

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        """Bounds (size,) of u, widened by SLACK; those of the duration are exact."""
        manipulator, bounds = self.request.manipulator, variable_bounds(self.request)
        stages = self.request.scene.nlp.carry + len(self.request.nodes) - 1
        free, n = manipulator.start is None, manipulator.size
        low, high = (
            np.hstack(
                [
                    bounds["T"][end],
                    bounds["q"][end] if free else [],
                    np.tile(np.broadcast_to(bounds["c"][end], n), stages),
                ]
            )
            for end in (0, 1)
        )
        slack = SLACK * (high - low)
        slack[0] = ROUNDING
        return low - slack, high + slack

    def fits(self, layout: Layout) -> bool:
        """Whether an NLP has these variables."""
        return bool(layout.structure.last == self.core.stages)

    def places(self, layout: Layout) -> list[int]:
        """Indices (size,) of u in the NLP's decision vector."""
        free = self.request.manipulator.start is None
        names = [("T", 0), *([("q", 0)] if free else [])]
        names += [("c", k) for k in range(layout.structure.last)]
        blocks = [layout.places[name, k, 0] for name, k in names]
        return [i for where in blocks for i in range(where.start, where.stop)]

    def motion(self, u: Array) -> tuple[Trajectory, float]:
        """The motion from rest to detach, and the time [s] on it at which the grip force starts to
        fall."""
        n, stages = self.core.n, self.core.stages
        times, cubics = np.empty(stages + 1), np.empty((4, n, stages, 1))
        given = array(np.ascontiguousarray(u, float), self.size)
        arrays = out(times, stages + 1), out(cubics, 4, n, stages)
        library().plan_motion(self.core, given, *arrays)
        return Trajectory(times, cubics, times), self.opening_time(u)

    def opening_time(self, u: Array) -> float:
        """The time [s] at which the grip force starts to fall."""
        return float(u[0] - self.request.nodes[0])

    @property
    def durations(self) -> tuple[float, float]:
        """Shortest and longest carry [s]."""
        return self.core.shortest, self.core.longest

    def within(self, u: Array) -> Array:
        """u with the carry's duration clipped to its bounds."""
        return np.concatenate([[np.clip(u[0], *self.durations)], u[1:]])

    def near_bounds(self, u: Array) -> Flags:
        """Whether each u (N, size) is inside the widened bounds."""
        low, high = self._bounds
        return np.asarray(((u >= low) & (u <= high)).all(axis=1))


@dataclass(frozen=True, eq=False)
class Optimum(ReadOnly):
    """A solved throw and its sensitivity to the target.

    u (size,): see `ReducedVariables`. slope (size, 2; 1 with theta open): du / d(landing x [m],
    theta [rad]), see `CondensedQp.slope`. detach (6,): CoM pose and twist by the deciding model.
    effort: cost of the NLP. smoothing: its landing (x [m], theta [rad]) less the exact landing of
    the planned motion. refinement, nlp_size: of its NLP.
    """

    u: Array
    slope: Array
    detach: Array
    effort: float
    nlp_size: tuple[int, int]
    smoothing: tuple[float, float]
    refinement: Refinement = BASE


@dataclass(frozen=True)
class QpSettings:
    """Tolerances and sizes of the reduced QP.

    min_curvature: smaller or negative curvatures are raised to this share of the largest; in such
    directions an optimum of the NLP moves far at no cost. rank_tolerance: singular values of active
    constraints below this share of the largest count as zero. trust_region: largest change of a
    variable in a step, as a share of its range. miss_price [1/m]: of a landing off the target;
    violation_price: of broken limits, per unit of u.
    reach: the QP starts with the limits within this distance in u. rounds: each adds the limits
    that its step breaks; the last step is accepted with them broken. size_multiple: the number of
    limits is a multiple of it; a solver is made for each number. zero: smaller lengths and
    multipliers in u are zero.
    """

    min_curvature: float = 1e-4
    rank_tolerance: float = 1e-6
    trust_region: float = 0.15
    miss_price: float = 100.0
    violation_price: float = 1e4
    reach: float = 0.5
    rounds: int = 3
    size_multiple: int = 32
    zero: float = 1e-7


QP = QpSettings()
#: CasADi's names of a QP's matrices and bounds.
QP_INPUTS = ("h", "g", "a", "lba", "uba", "lbx", "ubx")
#: DAQP's solvers serve all threads, and `stats` is that of the last call of any thread.
_DAQP_LOCK = Lock()


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the reduced QP.

    du (size,); residual (2,): landing (x [m], theta [rad]) less target, 0 for a free theta; full:
    whether no bound of the step is active.
    """

    du: Array
    residual: Array
    full: bool
    _qp: CondensedQp
    _active: Flags

    @cached_property
    def slope(self) -> Array:
        """Sensitivity (size, L) of u to the landing, at the step's active limits."""
        return self._qp.null_space_step(self._active)


@dataclass(frozen=True, eq=False)
class CondensedQp:
    """An NLP's linearisation in u (size,) about a point.

    point (n,): a solution of the linearised equations; dx_du (n, size): its derivative in u.
    landing (L, size): derivative of the landing (x, theta); target_offset (L,): from the landing to
    the target. rows (m, size), each of length one: limits; lower, upper (m,): distances to them.
    step_bounds (size,): longest step. hessian (size, size): of the Lagrangian; without multipliers
    the squared length in step_bounds. active (m,): limits that bind at the point.
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

    @classmethod
    def about(
        cls, solver: Solver, point: Solution, parameters: Array, bounds: Bounds, indices: list[int]
    ) -> CondensedQp:
        """The linearisation about a point with its multipliers (empty: none).

        bounds: of the decision vector; indices: of u in it. Raises LinAlgError if the equations do
        not determine the other variables.
        """
        nlp = solver.nlp
        g, jacobian = solver.jacobian(point.x, parameters)
        landing = np.isin(nlp.row_names, LANDING)
        equations = (nlp.lbg == nlp.ubg) & ~landing
        dx_du, dx = _eliminate(jacobian[equations], (g - nlp.lbg)[equations], indices)
        x, g = point.x + dx, g + jacobian @ dx
        limits, free = nlp.lbg < nlp.ubg, bounds[0] < bounds[1]
        rows = np.vstack([jacobian[limits] @ dx_du, dx_du[free]])
        values = np.concatenate([g[limits], x[free]])
        lower = np.concatenate([nlp.lbg[limits], bounds[0][free]]) - values
        upper = np.concatenate([nlp.ubg[limits], bounds[1][free]]) - values
        step_bounds = QP.trust_region * (bounds[1] - bounds[0])[indices]
        hessian, multipliers = np.diag(step_bounds**-2), np.zeros(len(rows))
        if point.lam_g.size:
            hessian = dx_du.T @ solver.hessian(point.x, parameters, point.lam_g) @ dx_du
            multipliers = np.abs(np.concatenate([point.lam_g[limits], point.lam_x[free]]))
        length = np.linalg.norm(rows, axis=1)
        some = length > QP.zero
        length = length[some]
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
        )

    @property
    def slope(self) -> Array:
        """Sensitivity (size, L) of an optimum's u to its target (x [m], theta [rad]).

        It is the parametric sensitivity of the NLP's solution at fixed active limits (Fiacco 1983).
        """
        return self.null_space_step(self.active)

    @property
    def with_fixed_duration(self) -> CondensedQp:
        """The QP without the first variable of u, the carry's duration."""
        return replace(
            self,
            dx_du=self.dx_du[:, 1:],
            landing=self.landing[:, 1:],
            rows=self.rows[:, 1:],
            step_bounds=self.step_bounds[1:],
            hessian=self.hessian[1:, 1:],
        )

    def null_space_step(self, active: Flags) -> Array:
        """The cheapest du (size, L) in the null space of the active limits for a unit change of
        each landing component."""
        free = _null_space(self.rows[active])
        landing = self.landing @ free
        if np.linalg.matrix_rank(landing, rtol=QP.rank_tolerance) < len(landing):
            # The active limits leave no freedom for the target.
            free, landing = np.eye(len(self.hessian)), self.landing
        direct = np.linalg.pinv(landing)
        reduced = free.T @ self.hessian @ free
        inner = _null_space(landing)
        inverse = np.linalg.inv(_raise_curvatures(inner.T @ reduced @ inner))
        return np.asarray(free @ (direct - inner @ (inverse @ (inner.T @ reduced @ direct))))

    def step(self, centre: Array, trust: float = 1.0, lever: float = 1.0) -> Step | None:
        """The step nearest to `centre` (size,) that reaches the target inside all limits.

        It may miss the target, at a price: of theta [rad] `lever` times that of x [m]. trust: share
        of the step bounds. None if the QP has no solution.
        """
        longest, misses = trust * self.step_bounds, len(self.landing)
        size, slacks = len(longest), 2 * misses + 1
        # Variables: du, undershoot and overshoot of the landing, violation of limits broken now.
        hessian = np.diag(np.append(np.zeros(size), np.full(slacks, QP.min_curvature)))
        hessian[:size, :size] = self.hessian
        prices = QP.miss_price * np.array([1.0, lever])[:misses]
        gradient = np.concatenate([-self.hessian @ centre, prices, prices, [QP.violation_price]])
        target = np.hstack([self.landing, np.eye(misses), -np.eye(misses), np.zeros((misses, 1))])
        broken_now = np.where(self.lower > QP.zero, 1.0, np.where(self.upper < -QP.zero, -1.0, 0.0))
        bounds = np.append(-longest, np.zeros(slacks)), np.append(longest, [np.inf] * slacks)
        reach = QP.reach + float(np.linalg.norm(centre))
        included = (self.lower > -reach) | (self.upper < reach)
        for _ in range(QP.rounds):
            some = _pad_selection(included, np.minimum(-self.lower, self.upper))
            slack = np.column_stack([np.zeros((some.size, 2 * misses)), broken_now[some]])
            rows = np.vstack([np.hstack([self.rows[some], slack]), target])
            low, high = (np.append(v[some], self.target_offset) for v in (self.lower, self.upper))
            z, multipliers = _solve_qp(hessian, gradient, rows, (low, high), bounds)
            if not np.isfinite(z).all():
                return None
            change = self.rows @ z[:size] + broken_now * z[-1]
            broken = (change < self.lower - QP.zero) | (change > self.upper + QP.zero)
            if not (broken & ~included).any():
                break
            included |= broken
        active = np.zeros(len(self.rows), bool)
        active[some] = np.abs(multipliers[: some.size]) > QP.zero
        du, full = z[:size], bool((np.abs(z[:size]) < longest - QP.zero).all())
        residual = np.zeros(2)
        residual[:misses] = z[size + misses : -1] - z[size : size + misses]
        return Step(du, residual, full, self, active)


def _pad_selection(included: Flags, distance: Array) -> Indices:
    """Indices of the included rows (m,), padded with the nearest others to a multiple of the
    size."""
    count = min(-(-int(included.sum()) // QP.size_multiple) * QP.size_multiple, len(included))
    order = np.argsort(np.where(included, -np.inf, distance), kind="stable")
    return np.asarray(np.sort(order[:count]))


def _eliminate(jacobian: Any, residual: Array, indices: list[int]) -> tuple[Array, Array]:
    """Eliminates equations (E, n): derivative (n, size) of all variables in u, and the step (n,) to
    a solution of the equations."""
    from scipy.sparse.linalg import splu

    others = np.delete(np.arange(jacobian.shape[1]), indices)
    right_side = np.column_stack([jacobian[:, indices].toarray(), residual])
    derivative = np.zeros((jacobian.shape[1], len(indices) + 1))
    derivative[indices, np.arange(len(indices))] = 1.0
    try:
        derivative[others] = splu(jacobian[:, others]).solve(-right_side)
    except RuntimeError as error:
        raise np.linalg.LinAlgError(str(error)) from None
    return derivative[:, :-1], derivative[:, -1]


def _solve_qp(
    hessian: Array, gradient: Array, rows: Array, between: Bounds, bounds: Bounds
) -> tuple[Array, Array]:
    """Minimum of a QP and the multipliers of its rows, by DAQP; NaN without a solution."""
    solver = _daqp_solver(*rows.shape)
    values = hessian, gradient, rows, *between, *bounds
    with _DAQP_LOCK:
        result = solver(**dict(zip(QP_INPUTS, values, strict=True)))
        success = solver.stats()["success"]
    z, multipliers = (np.array(result[name]).ravel() for name in ("x", "lam_a"))
    return z if success else z * np.nan, multipliers


@lru_cache(maxsize=64)
def _daqp_solver(rows: int, columns: int) -> Any:
    sizes = {"h": ca.Sparsity.dense(columns, columns), "a": ca.Sparsity.dense(rows, columns)}
    return ca.conic("step", "daqp", sizes, {"error_on_fail": False})


def _raise_curvatures(matrix: Array) -> Array:
    """The symmetric matrix with small and negative eigenvalues raised to `min_curvature`."""
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    values = np.maximum(values, QP.min_curvature * max(np.abs(values).max(initial=0.0), 1e-9))
    return np.asarray((vectors * values) @ vectors.T)


def _null_space(rows: Array) -> Array:
    """Orthonormal basis (n, k) of the null space of rows (m, n)."""
    if not len(rows):
        return np.eye(rows.shape[1])
    scale = np.linalg.norm(rows, axis=1, keepdims=True)
    _, sizes, basis = np.linalg.svd(rows / np.maximum(scale, 1e-300))
    rank = int((sizes > QP.rank_tolerance * sizes[0]).sum())
    return np.asarray(basis[rank:].T)
