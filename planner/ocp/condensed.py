"""An NLP about one of its points, condensed to the few free numbers `u` of a throw (`Controls`).

Gaps, collocation and flight time are equations for all other variables. What is left of the NLP's
linearisation is a quadratic program in about 40 variables. One solve of it moves a throw to a
target nearby inside all limits, whichever of them become active on the way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array, Flags, Indices
from .nlp import MISS_PRICE, ThrowNlp
from .solver import Solution, Solver

Bounds = tuple[Array, Array]

#: Rows that say where the object lands: the sensitivity is with respect to them.
LANDING = ("landing x", "landing theta")
#: Curvature below this share of the largest, or negative, is raised to it: along such directions
#: an optimum of the NLP may move a long way for nothing.
FLATTEST = 1e-4
#: Singular values of the active constraints below this share of the largest count as none.
DEPENDENT = 1e-6
#: A step changes no free number by more than this share of its range.
TRUST = 0.15
#: Price of a step that goes beyond a limit, per unit of u.
BREAKING = 1e4
#: Limits at which a step of this length in u may arrive are given to the QP; then those that its
#: step breaks, so often.
AHEAD, ROUNDS = 0.5, 3
#: Rows of the QP are so many or a multiple.
ROWS = 32
#: What counts as nothing, in u.
NOTHING = 1e-7


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the QP.

    du (size,); short (L,): by how much its landing (x [m], theta [rad]) misses; held: multipliers
    of the NLP's rows (m,) and bounds (n,). whole: whether it is as long as it wants to be.
    """

    du: Array
    short: Array
    held: tuple[Array, Array]
    whole: bool
    _about: Condensed
    _active: Flags

    @cached_property
    def slope(self) -> Array:
        """How u moves with the landing (size, L) while the limits that are active now stay so."""
        return self._about.along(self._active)


@dataclass(frozen=True, eq=False)
class Condensed:
    """An NLP's linearisation in u (size,) about a point.

    point (n,): moved to where the equations hold; whole (n, size): how it follows u. landing
    (L, size): derivative of the landing (x, theta); wanted (L,): from there to the target. rows
    (m, size), each of length one: limits, and how far (m,) it is to them, down and up. most
    (size,): longest step. hessian (size, size): of the Lagrangian, and active (m,): limits that
    hold the point, where multipliers are known; else of a step's length in `most`, and none.
    places: of the limits among the NLP's rows, and then bounds; the number of its rows.
    """

    point: Array
    whole: Array
    landing: Array
    wanted: Array
    rows: Array
    down: Array
    up: Array
    most: Array
    hessian: Array
    active: Flags
    places: tuple[Indices, int]

    @classmethod
    def about(
        cls,
        nlp: ThrowNlp,
        solver: Solver,
        point: Solution,
        numbers: Array,
        limits: Bounds,
        places: list[int],
    ) -> Condensed:
        """About a point with its multipliers (empty: none).

        numbers: the NLP's parameters; limits: bounds of the decision vector; places: of u in it.
        Raises LinAlgError where the equations do not give the other variables.
        """
        x, size = point.x, len(places)
        multipliers = point.lam_g if point.lam_g.size else np.zeros(nlp.size[1])
        bounds = point.lam_x if point.lam_x.size else np.zeros(x.size)
        g, slopes = solver.slopes(x, numbers)
        landing = np.isin(nlp.row_names, LANDING)
        equal = np.flatnonzero((nlp.lbg == nlp.ubg) & ~landing)
        rest = np.delete(np.arange(x.size), places)
        residual = (g - nlp.lbg)[equal]
        given = _eliminated(slopes[equal], places, rest, residual)
        # All variables per u, and moved to where the equations hold.
        whole, moved = np.zeros((x.size, size)), np.zeros(x.size)
        whole[places, np.arange(size)] = 1.0
        whole[rest], moved[rest] = given[:, :size], given[:, size]
        at = g + slopes @ moved
        free, some = limits[0] < limits[1], nlp.lbg < nlp.ubg
        rows = np.vstack([slopes[some] @ whole, whole[free]])
        here = np.concatenate([at[some], (x + moved)[free]])
        low, high = (
            np.concatenate([of_rows[some], of_x[free]])
            for of_rows, of_x in zip((nlp.lbg, nlp.ubg), limits, strict=True)
        )
        held = np.abs(np.concatenate([multipliers[some], bounds[free]]))
        most = TRUST * (limits[1] - limits[0])[places]
        hessian = np.diag(most**-2)
        if point.lam_g.size:
            hessian = whole.T @ solver.curvature(x, numbers, multipliers) @ whole
        length = np.linalg.norm(rows, axis=1)
        seen = length > NOTHING
        rows, length = rows[seen], length[seen]
        down, up = ((end - here)[seen] / length for end in (low, high))
        return cls(
            x + moved,
            whole,
            slopes[landing] @ whole,
            (nlp.lbg - at)[landing],
            rows / length[:, None],
            down,
            up,
            most,
            hessian,
            (np.minimum(here - low, high - here) < held)[seen],
            (np.concatenate([np.flatnonzero(some), g.size + np.flatnonzero(free)])[seen], g.size),
        )

    @property
    def slope(self) -> Array:
        """How u moves where the target of an optimum does (size, L).

        du / d(x [m], theta [rad]) of the landing: the parametric sensitivity of the NLP's
        solution while the active limits stay active (Fiacco 1983).
        """
        return self.along(self.active)

    @property
    def timed(self) -> Condensed:
        """The same with the opening at its time: without the first number of u."""
        return replace(
            self,
            whole=self.whole[:, 1:],
            landing=self.landing[:, 1:],
            rows=self.rows[:, 1:],
            most=self.most[1:],
            hessian=self.hessian[1:, 1:],
        )

    def along(self, active: Flags) -> Array:
        """The cheapest du (size, L) that moves the landing by one each, limits active left so."""
        free = _null_space(self.rows[active])
        reach = self.landing @ free
        if np.linalg.matrix_rank(reach, rtol=DEPENDENT) < len(reach):
            # So many limits are active that the target cannot move along them.
            free, reach = np.eye(len(self.hessian)), self.landing
        direct = np.linalg.pinv(reach)
        inner = free.T @ self.hessian @ free
        around = _null_space(reach)
        inverse = np.linalg.inv(_definite(around.T @ inner @ around))
        return np.asarray(free @ (direct - around @ (inverse @ (around.T @ inner @ direct))))

    def step(self, around: Array, trust: float = 1.0) -> Step | None:
        """The step to the target that keeps all limits, the nearest to `around` (size,).

        trust: share of the longest step. It may fall short of the target, at a price. None where
        the QP has no answer.
        """
        wanted, longest = self.wanted, trust * self.most
        size, misses = len(longest), len(self.landing)
        count = size + 2 * misses + 1
        hessian = np.zeros((count, count))
        hessian[:size, :size] = self.hessian
        hessian[size:, size:] = FLATTEST * np.eye(count - size)
        gradient = np.full(count, MISS_PRICE)
        gradient[:size], gradient[-1] = -self.hessian @ around, BREAKING
        lands = np.hstack([self.landing, np.eye(misses), -np.eye(misses), np.zeros((misses, 1))])
        outside = np.where(self.down > NOTHING, 1.0, np.where(self.up < -NOTHING, -1.0, 0.0))
        most = np.concatenate([longest, np.full(count - size, np.inf)])
        least = np.concatenate([-longest, np.zeros(count - size)])
        ahead = AHEAD + float(np.linalg.norm(around))
        given = (self.down > -ahead) | (self.up < ahead)
        for _ in range(ROUNDS):
            some = _enough(given, np.minimum(-self.down, self.up))
            slack = np.column_stack([np.zeros((some.size, 2 * misses)), outside[some]])
            rows = np.vstack([np.hstack([self.rows[some], slack]), lands])
            low, high = (np.append(ends[some], wanted) for ends in (self.down, self.up))
            z, held = _solved(hessian, gradient, rows, (low, high), (least, most))
            if not np.isfinite(z).all():
                return None
            moved = self.rows @ z[:size] + outside * z[-1]
            broken = (moved < self.down - NOTHING) | (moved > self.up + NOTHING)
            if not (broken & ~given).any():
                break
            given |= broken
        active = np.zeros(len(self.rows), bool)
        active[some] = np.abs(held[: some.size]) > NOTHING
        short = z[size : size + misses] - z[size + misses : -1]
        multipliers, (at, count) = np.zeros(self.places[1] + len(self.point)), self.places
        multipliers[at[some]] = held[: some.size]
        du, whole = z[:size], bool((np.abs(z[:size]) < longest - NOTHING).all())
        rows_and_bounds = multipliers[:count], multipliers[count:]
        return Step(du, short, rows_and_bounds, whole, self, active)


def _enough(given: Flags, away: Array) -> Indices:
    """Of the rows (m,) those that are given and some of the nearest others, so that their number
    is one of few: a solver is made for each."""
    count = min(-(-int(given.sum()) // ROWS) * ROWS, len(given))
    order = np.argsort(np.where(given, -np.inf, away), kind="stable")
    return np.asarray(np.sort(order[:count]))


def _eliminated(slopes: Any, places: list[int], rest: Any, residual: Array) -> Array:
    """The other variables of equations (E, n): their derivative in u, and in the last column
    their step to where the equations hold; (E, size + 1)."""
    from scipy.sparse.linalg import splu

    known = np.column_stack([slopes[:, places].toarray(), residual])
    try:
        return np.asarray(splu(slopes[:, rest]).solve(-known))
    except RuntimeError as error:
        raise np.linalg.LinAlgError(str(error)) from None


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
    values = np.maximum(values, FLATTEST * max(float(np.abs(values).max(initial=0.0)), 1e-9))
    return np.asarray((vectors * values) @ vectors.T)


def _null_space(rows: Array) -> Array:
    """Orthonormal basis (n, k) of what the rows (m, n) do not see."""
    if not len(rows):
        return np.eye(rows.shape[1])
    scale = np.linalg.norm(rows, axis=1, keepdims=True)
    _, sizes, basis = np.linalg.svd(rows / np.maximum(scale, 1e-300))
    rank = int((sizes > DEPENDENT * sizes[0]).sum())
    return np.asarray(basis[rank:].T)
