"""Stages put together in FATROP's order: the NLP, its layout and its derivatives.

    x = [X_0, U_0, X_1, U_1, ..., X_N, U_N]
    g = [gap_0, rows_0, gap_1, rows_1, ..., rows_N],  gap_k = X_{k+1} - F_k(X_k, U_k)

FATROP requires the coefficient +1 on X_{k+1}, and rows of stage k in X_k and U_k only; the last
stage may have controls too. Stages of one kind share symbols, functions and compiled code. This
module places the non-zeros of their derivatives in the sparse Jacobian and Hessian of the NLP.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ...core.compile import digest, source_of
from ...models import Array, Indices
from .stages import Parameters, Stage, StageFunctions, differentiate, substitute_lifted
from .variables import Block


@dataclass(frozen=True)
class Link:
    """One stage in the chain: its functions, data and places.

    v: slice of x; gap, rows: slices of g; data: indices of p; ahead: slice of x with the
    next stage's states.
    """

    functions: StageFunctions
    stage: Stage
    v: slice
    gap: slice
    rows: slice
    ahead: slice
    data: list[int]


@dataclass(frozen=True)
class Nlp:
    """An assembled NLP.

    problem: x, p, f, g (MX) for `casadi.nlpsol`; layout: (block, stage, slice of x);
    row_names, lbg, ubg: one entry per row of g; landing: function (x, p) -> landing pose
    (x, z, theta).
    """

    problem: dict[str, ca.MX]
    parameters: Parameters
    links: list[Link]
    layout: list[tuple[Block, int, slice]]
    row_names: list[str]
    lbg: Array
    ubg: Array
    landing: ca.Function

    @property
    def sizes(self) -> tuple[list[int], list[int], list[int]]:
        """Numbers of states, controls and rows of each stage."""
        states, controls, rows = zip(*(link.stage.sizes for link in self.links), strict=True)
        return list(states), list(controls), list(rows)

    @cached_property
    def _places(self) -> dict[tuple[str, int, int], slice]:
        return {(block.name, block.index, k): where for block, k, where in self.layout}

    @property
    def size(self) -> tuple[int, int]:
        """(variables, constraints)."""
        return self.problem["x"].numel(), self.problem["g"].numel()

    def count(self, name: str) -> int:
        """Number of blocks of a name, by their indices."""
        return len({block.index for block, _, _ in self.layout if block.name == name})

    def fill(self, value: Callable[[Block, int], Any]) -> Array:
        """Decision vector from `value(block, stage)`, an array or number for each block."""
        x = np.zeros(self.size[0])
        for block, stage, where in self.layout:
            x[where] = value(block, stage)
        return x

    def place(self, name: str, stage: int, index: int = 0) -> slice | None:
        """Slice of x with a block, None if it is no variable."""
        return self._places.get((name, index, stage))

    def block(self, x: Array, name: str, stage: int, index: int = 0) -> Array | None:
        """Values of a block at `stage`, None if it is no variable."""
        where = self.place(name, stage, index)
        return None if where is None else x[where]


def assemble(stages: list[Stage], parameters: Parameters, landing: ca.SX, at: int) -> Nlp:
    """The NLP of a chain of stages, in block order.

    Stages may share a kind. landing: expression in the variables of stage `at`.
    """
    symbol = parameters.symbol
    kinds: dict[int, StageFunctions] = {}
    for stage in stages:
        if id(stage) not in kinds:
            kinds[id(stage)] = StageFunctions(stage, symbol, f"stage{len(kinds)}")
    links, layout = _chain(stages, kinds, parameters)
    x = ca.MX.sym("x", links[-1].v.stop)
    p = ca.MX.sym("p", symbol.numel())
    g: list[ca.MX] = []
    cost: list[ca.MX] = []
    names: list[str] = []
    low, high = [], []
    for k, link in enumerate(links):
        outputs, price = link.functions.value(x[link.v], p[link.data], p)
        gap = _length(link.gap)
        g += [x[link.ahead] - outputs[:gap], outputs[gap:]]
        cost.append(price)
        rows = [(row.name, row.value.numel(), row.low, row.high) for row in link.stage.all_rows]
        for name, size, lower, upper in [(f"gap {k}", gap, 0.0, 0.0), *rows]:
            names += [name] * size
            low += [lower] * size
            high += [upper] * size
    stage = stages[at]
    pose = ca.Function(
        "pose", [stage.variables, symbol], substitute_lifted([landing], stage.lifted)
    )
    return Nlp(
        {"x": x, "p": p, "f": sum(cost[1:], cost[0]), "g": ca.vertcat(*g)},
        parameters,
        links,
        layout,
        names,
        np.array(low),
        np.array(high),
        ca.Function("landing", [x, p], [pose(x[links[at].v], p)]),
    )


def _length(part: slice) -> int:
    return int(part.stop - part.start)


def _chain(
    stages: list[Stage], kinds: dict[int, StageFunctions], parameters: Parameters
) -> tuple[list[Link], list[tuple[Block, int, slice]]]:
    """Places of all stages in x, g and p, and the layout of x."""
    links: list[Link] = []
    layout: list[tuple[Block, int, slice]] = []
    at = row = 0
    for k, stage in enumerate(stages):
        first = at
        for block, symbol in [*stage.states.items(), *stage.controls.items()]:
            layout.append((block, k, slice(at, at + symbol.numel())))
            at += symbol.numel()
        gap = row + sum(symbol.numel() for symbol in stage.following.values())
        rows = gap + stage.sizes[2]
        data: list[int] = []
        for name, (symbol, begin) in stage.data.items():
            start = parameters.start(name) + (k - begin) * symbol.numel()
            data += range(start, start + symbol.numel())
        parts = slice(first, at), slice(row, gap), slice(gap, rows), slice(at, at + gap - row)
        links.append(Link(kinds[id(stage)], stage, *parts, data))
        row = rows
    return links, layout


def nlp_key(nlp: Nlp, solver: str) -> str:
    """Cache key of `nlp_functions`: a text of all that it depends on."""
    kinds = {link.functions: link.functions.value.serialize() for link in nlp.links}
    chain = [(link.v, link.gap, link.rows, link.ahead, link.data) for link in nlp.links]
    source = digest(source_of(differentiate, nlp_functions))
    order = [list(kinds).index(link.functions) for link in nlp.links]
    return repr((solver, source, list(kinds.values()), order, chain))


def nlp_functions(nlp: Nlp, solver: str) -> dict[str, ca.Function]:
    """The functions of a solver plug-in, by its names; they replace those it derives itself."""
    x, p, f, g = (nlp.problem[key] for key in ("x", "p", "f", "g"))
    gradient = ca.densify(
        ca.vertcat(*[link.functions.cost_gradient(*called) for link, called in _calls(nlp)])
    )
    with_cost = solver == "ipopt"
    return {
        "nlp_f": ca.Function("nlp_f", [x, p], [f], ["x", "p"], ["f"]),
        "nlp_g": ca.Function("nlp_g", [x, p], [g], ["x", "p"], ["g"]),
        "nlp_jac_g": _jacobian(nlp),
        "nlp_hess_l": _hessian(nlp, solver),
        "nlp_grad": _lagrangian_gradient(nlp),
        "nlp_grad_f": ca.Function(
            "nlp_grad_f",
            [x, p],
            [f, gradient] if with_cost else [gradient],
            ["x", "p"],
            ["f", "grad_f_x"] if with_cost else ["grad_f_x"],
        ),
    }


def _calls(nlp: Nlp) -> Iterator[tuple[Link, list[ca.MX]]]:
    """Each stage with the arguments (v, d, p) of its functions."""
    x, p = nlp.problem["x"], nlp.problem["p"]
    for link in nlp.links:
        yield link, [x[link.v], p[link.data], p]


def _lagrangian(nlp: Nlp, lam_f: ca.MX, lam_g: ca.MX) -> tuple[ca.MX, list[ca.MX]]:
    """The Lagrangian's gradient (dense), and each stage's Hessian."""
    gradients: list[ca.MX] = []
    hessians: list[ca.MX] = []
    before = None
    for link, called in _calls(nlp):
        # The gap has -F.
        multipliers = ca.vertcat(-lam_g[link.gap], lam_g[link.rows])
        gradient, hessian = link.functions.hessian(*called, multipliers, lam_f)
        if before is not None:
            # The +1 of the gap before.
            states = _length(before)
            gradient = ca.vertcat(gradient[:states] + lam_g[before], gradient[states:])
        gradients.append(gradient)
        hessians.append(hessian)
        before = link.gap
    return ca.densify(ca.vertcat(*gradients)), hessians


def _lagrangian_gradient(nlp: Nlp) -> ca.Function:
    """(x, p, lam_f, lam_g) -> f, g, and the Lagrangian's gradient in x (0 in p: not used)."""
    x, p, f, g = (nlp.problem[key] for key in ("x", "p", "f", "g"))
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", nlp.size[1])
    gradient, _ = _lagrangian(nlp, lam_f, lam_g)
    return ca.Function(
        "nlp_grad",
        [x, p, lam_f, lam_g],
        [f, g, gradient, ca.MX.zeros(p.numel())],
        ["x", "p", "lam_f", "lam_g"],
        ["f", "g", "grad_gamma_x", "grad_gamma_p"],
    )


def _jacobian(nlp: Nlp) -> ca.Function:
    """(x, p) -> g and its Jacobian: in each gap -dF at its own stage and +1 at the next."""
    x, p = nlp.problem["x"], nlp.problem["p"]
    g: list[ca.MX] = []
    parts = []
    for link, called in _calls(nlp):
        outputs, slope = link.functions.jacobian(*called)
        gap = _length(link.gap)
        g += [x[link.ahead] - outputs[:gap], outputs[gap:]]
        rows, columns = _places(slope)
        sign = ca.DM(np.where(rows < gap, -1.0, 1.0))
        parts.append((sign * slope.nz[:], link.gap.start + rows, link.v.start + columns))
        step = np.arange(gap)
        parts.append((ca.MX(ca.DM.ones(gap)), link.gap.start + step, link.ahead.start + step))
    matrix = _sparse_matrix(nlp.size[1], nlp.size[0], parts)
    return ca.Function("nlp_jac_g", [x, p], [ca.vertcat(*g), matrix], ["x", "p"], ["g", "jac_g_x"])


def _hessian(nlp: Nlp, solver: str) -> ca.Function:
    """(x, p, lam_f, lam_g) -> Hessian of the Lagrangian, for FATROP with its gradient."""
    x, p = nlp.problem["x"], nlp.problem["p"]
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", nlp.size[1])
    gradient, hessians = _lagrangian(nlp, lam_f, lam_g)
    parts = []
    for link, hessian in zip(nlp.links, hessians, strict=True):
        curvature = ca.triu(hessian) if solver == "ipopt" else hessian
        rows, columns = _places(curvature)
        parts.append((curvature.nz[:], link.v.start + rows, link.v.start + columns))
    matrix = _sparse_matrix(nlp.size[0], nlp.size[0], parts)
    inputs, names = [x, p, lam_f, lam_g], ["x", "p", "lam_f", "lam_g"]
    if solver == "ipopt":
        return ca.Function("nlp_hess_l", inputs, [matrix], names, ["triu_hess_gamma_x_x"])
    outputs = ["grad_gamma_x", "hess_gamma_x_x"]
    return ca.Function("nlp_hess_l", inputs, [gradient, matrix], names, outputs)


def _places(matrix: ca.MX) -> tuple[Indices, Indices]:
    """Rows and columns (nnz,) of the non-zeros, column by column."""
    rows, columns = matrix.sparsity().get_triplet()
    return np.array(rows, int), np.array(columns, int)


def _sparse_matrix(height: int, width: int, parts: list[tuple[ca.MX, Indices, Indices]]) -> ca.MX:
    """Sparse matrix from parts (entries, rows, columns) without overlap."""
    entries, of_rows, of_columns = zip(*parts, strict=True)
    rows, columns = np.concatenate(of_rows), np.concatenate(of_columns)
    order = np.lexsort((rows, columns))
    pattern = ca.Sparsity.triplet(height, width, rows.tolist(), columns.tolist())
    return ca.MX(pattern, ca.vertcat(*entries)[order.tolist()])
