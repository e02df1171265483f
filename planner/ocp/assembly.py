"""Stages put together in FATROP's order: the NLP, its layout and its derivatives.

    x = [X_0, U_0, X_1, U_1, ..., X_N, U_N]
    g = [gap_0, rows_0, gap_1, rows_1, ..., rows_N],  gap_k = X_{k+1} - F_k(X_k, U_k)

FATROP requires the coefficient +1 on X_{k+1}, and rows of stage k in X_k and U_k only; the last
stage may have controls too. With o_k = (-F_k, rows_k) this is g = [o_0, ..., o_N] + E x with a
constant E, so the Jacobian is E plus a block of each stage, and the Hessian of the Lagrangian is
block diagonal. Stages of one kind share symbols, functions and compiled code.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array
from .stage_functions import Shared, StageFunctions, substitute_lifted
from .stages import Block, Layout, NlpStructure, Parameters, Stage

#: Largest multiplier in the Lagrangian's Hessian; those of solutions are far below. From larger
#: ones FATROP 1.1 finds no regularisation at which a factorisation succeeds, and never returns.
MOST_MULTIPLIER = 1e8


@dataclass(frozen=True)
class Link:
    """One stage in the chain: its functions, data and places.

    v: slice of x; gap, rows: slices of g; data, parameters: indices of p.
    """

    functions: StageFunctions
    stage: Stage
    v: slice
    gap: slice
    rows: slice
    data: list[int]
    parameters: list[int]

    def arguments(self, x: ca.MX, p: ca.MX) -> list[ca.MX]:
        """(v, d, p) of its functions."""
        return [x[self.v], p[self.data], p[self.parameters]]


@dataclass(frozen=True)
class StagedNlp(Layout):
    """An assembled NLP.

    x, p: symbols of variables and parameters; row_names, lbg, ubg: one entry per row of g; landing:
    function (x, p) -> landing pose (x, z, theta).
    """

    x: ca.MX
    p: ca.MX
    parameters: Parameters
    links: list[Link]
    row_names: list[str]
    lbg: Array
    ubg: Array
    landing: ca.Function

    @property
    def sizes(self) -> tuple[list[int], list[int], list[int]]:
        """Numbers of states, controls and rows of each stage."""
        states, controls, rows = zip(*(link.stage.sizes for link in self.links), strict=True)
        return list(states), list(controls), list(rows)

    @property
    def kinds(self) -> list[StageFunctions]:
        """The functions of its stages, each once, those of most stages first."""
        counted = Counter(link.functions for link in self.links)
        return [functions for functions, _ in counted.most_common()]

    @property
    def problem(self) -> dict[str, ca.MX]:
        """x, p, f, g for `casadi.nlpsol`, of the stages' functions as they are now."""
        values = [
            link.functions.code["value"](*link.arguments(self.x, self.p)) for link in self.links
        ]
        costs, outputs = zip(*values, strict=True)
        g = _ahead(self.links) @ self.x + ca.vertcat(*outputs)
        return {"x": self.x, "p": self.p, "f": sum(costs[1:], costs[0]), "g": g}

    @property
    def layout(self) -> Layout:
        """The layout alone."""
        return Layout(self.structure, self.blocks, self.size)


def assemble(
    structure: NlpStructure,
    stages: list[Stage],
    parameters: Parameters,
    landing: ca.SX,
    shared: Shared,
) -> StagedNlp:
    """The NLP of a chain of stages, in block order.

    Stages may share a kind. landing: expression in the variables of the stage at detach. shared:
    functions of other NLPs, to which those of this one are added.
    """
    symbol, at = parameters.symbol, structure.detach
    kinds: dict[int, tuple[StageFunctions, list[int]]] = {}
    links: list[Link] = []
    blocks: list[tuple[Block, int, slice]] = []
    rows: list[tuple[str, float, float]] = []
    end = 0
    for k, stage in enumerate(stages):
        if id(stage) not in kinds:
            functions = StageFunctions(stage, symbol, shared)
            # Another NLP has the same parameters at other places.
            kinds[id(stage)] = shared.setdefault(functions.key, functions), functions.parameters
        begin, gap = end, len(rows)
        for block, value in [*stage.states.items(), *stage.controls.items()]:
            blocks.append((block, k, slice(end, end + value.numel())))
            end += value.numel()
        for value in stage.following.values():
            rows += [(f"gap {k}", 0.0, 0.0)] * value.numel()
        first = len(rows)
        for row in stage.all_rows:
            rows += [(row.name, row.low, row.high)] * row.value.numel()
        data: list[int] = []
        for name, (value, since) in stage.data.items():
            start = parameters.start(name) + (k - since) * value.numel()
            data += range(start, start + value.numel())
        parts = slice(begin, end), slice(gap, first), slice(first, len(rows))
        functions, used = kinds[id(stage)]
        links.append(Link(functions, stage, *parts, data, used))
    x, p = ca.MX.sym("x", end), ca.MX.sym("p", symbol.numel())
    expanded = substitute_lifted([landing], stages[at].lifted)
    pose = ca.Function("pose", [stages[at].variables, symbol], expanded)
    landed = ca.Function("landing", [x, p], [pose(x[links[at].v], p)])
    names, low, high = zip(*rows, strict=True)
    bounds = np.array(low), np.array(high)
    size = end, len(rows)
    return StagedNlp(structure, blocks, size, x, p, parameters, links, list(names), *bounds, landed)


def _ahead(links: list[Link]) -> ca.DM:
    """E: +1 in each gap, at its state of the next stage."""
    rows = [i for link in links for i in range(link.gap.start, link.gap.stop)]
    columns = [link.v.stop + i for link in links for i in range(link.gap.stop - link.gap.start)]
    last = links[-1]
    return ca.DM.triplet(rows, columns, ca.DM.ones(len(rows)), last.rows.stop, last.v.stop)


def nlp_functions(nlp: StagedNlp, solver: str) -> dict[str, ca.Function]:
    """The functions of a solver plug-in, by its names; they replace those it derives itself."""
    x, p, ahead = nlp.x, nlp.p, _ahead(nlp.links)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", nlp.size[1])
    bounded = ca.fmin(ca.fmax(lam_g, -MOST_MULTIPLIER), MOST_MULTIPLIER)
    costs, jacobians, lagrangians = list[ca.MX](), list[Any](), list[Any]()
    for link in nlp.links:
        arguments = link.arguments(x, p)
        multipliers = ca.vertcat(lam_f, bounded[link.gap.start : link.rows.stop])
        code = link.functions.code
        costs.append(code["cost_gradient"](*arguments))
        jacobians.append(code["jacobian"](*arguments))
        lagrangians.append(code["hessian"](*arguments, multipliers))
    outputs, slopes = zip(*jacobians, strict=True)
    gradients, hessians = zip(*lagrangians, strict=True)
    hessian = ca.diagcat(*hessians)
    values = {
        **nlp.problem,
        "lam_f": lam_f,
        "lam_g": lam_g,
        "grad_f_x": ca.densify(ca.vertcat(*costs)),
        "jac_g_x": ca.diagcat(*slopes) + ahead,
        "grad_gamma_x": ca.densify(ca.vertcat(*gradients) + ahead.T @ lam_g),
        "grad_gamma_p": ca.MX.zeros(p.numel()),
        "hess_gamma_x_x": hessian,
        "triu_hess_gamma_x_x": ca.triu(hessian),
    }
    at, lagrangian, ipopt = ["x", "p"], ["x", "p", "lam_f", "lam_g"], solver == "ipopt"
    bend = ["triu_hess_gamma_x_x"] if ipopt else ["grad_gamma_x", "hess_gamma_x_x"]
    names = {
        "nlp_f": (at, ["f"]),
        "nlp_g": (at, ["g"]),
        "nlp_grad_f": (at, ["f", "grad_f_x"] if ipopt else ["grad_f_x"]),
        "nlp_hess_l": (lagrangian, bend),
        "nlp_grad": (lagrangian, ["f", "g", "grad_gamma_x", "grad_gamma_p"]),
        "nlp_jac_g": (at, ["g", "jac_g_x"]),
    }
    functions = {}
    for name, (inputs, results) in names.items():
        if name == "nlp_jac_g":
            # The calls of the stages' Jacobians give g too.
            values["g"] = ca.vertcat(*outputs) + ahead @ x
        used = {key: values[key] for key in (*inputs, *results)}
        functions[name] = ca.Function(name, used, inputs, results)
    return functions
