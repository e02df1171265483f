"""Parts of a staged NLP: parameters, kinds of stages, and their assembly in FATROP's order.

    x = [X_0, U_0, X_1, U_1, ..., X_N, U_N]
    g = [gap_0, rows_0, gap_1, rows_1, ..., rows_N],  gap_k = X_{k+1} - F_k(X_k, U_k)

FATROP needs the coefficient +1 on X_{k+1} and rows of stage k that depend on X_k and
U_k only; the last stage may have controls too. Stages of one kind share their symbols,
functions and compiled code.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from .lifting import Derivatives, differentiate, values

Array = npt.NDArray[np.float64]


@dataclass
class Parameters:
    """Named blocks of the NLP's parameter vector, in the order they are asked for."""

    blocks: dict[str, ca.SX] = field(default_factory=dict)

    def __call__(self, name: str, size: int = 1) -> ca.SX:
        """The block's symbol (size, 1); added when first asked for."""
        if name not in self.blocks:
            self.blocks[name] = ca.SX.sym(name, size)
        return self.blocks[name]

    @property
    def symbol(self) -> ca.SX:
        """The whole vector."""
        return ca.vertcat(*self.blocks.values())

    def vector(self, values: dict[str, Any]) -> Array:
        """Numbers for all blocks, in order."""
        return np.concatenate([np.atleast_1d(values[name]) for name in self.blocks])

    def where(self, name: str) -> slice:
        """The block's place in the vector."""
        sizes = [symbol.numel() for symbol in self.blocks.values()]
        at = sum(sizes[: list(self.blocks).index(name)])
        return slice(at, at + self.blocks[name].numel())


@dataclass
class Stage:
    """One kind of stage: named state and control symbols, intermediates, rows and cost.

    data: symbols that have other numbers at each stage of the kind, by the name of their
    parameter block, which holds them stage after stage, from the stage given with it on.
    following: the states at the next stage, F_k; empty at the last.
    """

    states: dict[str, ca.SX]
    controls: dict[str, ca.SX]
    data: dict[str, tuple[ca.SX, int]] = field(default_factory=dict)
    lifted: list[tuple[ca.SX, ca.SX]] = field(default_factory=list)
    rows: list[tuple[str, ca.SX, float, float]] = field(default_factory=list)
    following: dict[str, ca.SX] = field(default_factory=dict)
    cost: ca.SX = dataclasses.field(default_factory=lambda: ca.SX(0))

    def control(self, name: str, size: int = 1) -> ca.SX:
        """A new control."""
        self.controls[name] = ca.SX.sym(name, size)
        return self.controls[name]

    def row(self, name: str, value: ca.SX, low: float, high: float) -> None:
        """Add the constraint low <= value <= high, for each component."""
        self.rows.append((name, value, low, high))

    def lift(self, *values: ca.SX) -> list[ca.SX]:
        """Scalar symbols that stand for `values` until derivatives have been taken."""
        definition = ca.vertcat(*values)
        symbol = ca.SX.sym(f"y{len(self.lifted)}", definition.numel())
        self.lifted.append((symbol, definition))
        return list(ca.vertsplit(symbol))

    @property
    def variables(self) -> ca.SX:
        """States, then controls."""
        return ca.vertcat(*self.states.values(), *self.controls.values())

    @property
    def outputs(self) -> ca.SX:
        """F_k, then the rows."""
        return ca.vertcat(*self.following.values(), *[value for _, value, _, _ in self.rows])

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of states, controls and rows."""
        states = sum(symbol.numel() for symbol in self.states.values())
        rows = sum(value.numel() for _, value, _, _ in self.rows)
        return states, self.variables.numel() - states, rows


class StageFunctions:
    """CasADi functions of (v, d, p): a kind's variables, its stage's data, all parameters."""

    def __init__(self, stage: Stage, parameters: ca.SX, name: str) -> None:
        self._stage, self._name = stage, name
        data = ca.vertcat(*[symbol for symbol, _ in stage.data.values()])
        self._inputs = [stage.variables, data, parameters]
        found = values([stage.outputs, stage.cost], stage.lifted)
        self.value = ca.Function(f"{name}_value", self._inputs, found, {"cse": True})

    @cached_property
    def _derivatives(self) -> tuple[Derivatives, ca.SX, ca.SX]:
        multipliers, sigma = ca.SX.sym("l", self._stage.outputs.numel()), ca.SX.sym("sigma")
        stage = self._stage
        found = differentiate(
            stage.variables, stage.lifted, stage.outputs, stage.cost, multipliers, sigma
        )
        return found, multipliers, sigma

    @cached_property
    def jacobian(self) -> ca.Function:
        """(v, d, p) -> outputs, their Jacobian."""
        found = self._derivatives[0]
        outputs = values([self._stage.outputs], self._stage.lifted)
        name = f"{self._name}_jacobian"
        return ca.Function(name, self._inputs, [*outputs, found.jacobian], {"cse": True})

    @cached_property
    def cost_gradient(self) -> ca.Function:
        """(v, d, p) -> gradient of the cost, dense."""
        found = self._derivatives[0]
        gradient = ca.densify(found.cost_gradient)
        return ca.Function(f"{self._name}_cost", self._inputs, [gradient], {"cse": True})

    @cached_property
    def gradient(self) -> ca.Function:
        """(v, d, p, multipliers, sigma) -> gradient of the Lagrangian, dense."""
        found, multipliers, sigma = self._derivatives
        inputs = [*self._inputs, multipliers, sigma]
        gradient = ca.densify(found.gradient)
        return ca.Function(f"{self._name}_gradient", inputs, [gradient], {"cse": True})

    @cached_property
    def hessian(self) -> ca.Function:
        """(v, d, p, multipliers, sigma) -> gradient (dense) and Hessian of the Lagrangian."""
        found, multipliers, sigma = self._derivatives
        inputs = [*self._inputs, multipliers, sigma]
        outputs = [ca.densify(found.gradient), found.hessian]
        return ca.Function(f"{self._name}_hessian", inputs, outputs, {"cse": True})


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
    row_names, lbg, ubg: one entry per row of g; nx, nu, ng: sizes per stage;
    landing: function (x, p) -> landing pose (x, z, theta).
    """

    problem: dict[str, ca.MX]
    parameters: Parameters
    links: list[Link]
    layout: list[tuple[str, int, slice]]
    row_names: list[str]
    lbg: Array
    ubg: Array
    nx: list[int]
    nu: list[int]
    ng: list[int]
    landing: ca.Function

    @cached_property
    def places(self) -> dict[tuple[str, int], slice]:
        """Slice of x of each (block, stage)."""
        return {(name, k): where for name, k, where in self.layout}

    @property
    def size(self) -> tuple[int, int]:
        """(variables, constraints)."""
        return self.problem["x"].numel(), self.problem["g"].numel()

    def fill(self, value: Callable[[str, int], Any]) -> Array:
        """Decision vector from `value(block, stage)`, an array or number for each block."""
        x = np.zeros(self.size[0])
        for name, stage, where in self.layout:
            x[where] = value(name, stage)
        return x

    def block(self, x: Array, name: str, stage: int) -> Array | None:
        """Values of block `name` at `stage`, None where it is no variable."""
        where = self.places.get((name, stage))
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
    for link in links:
        outputs, price = link.functions.value(x[link.v], p[link.data], p)
        ahead = link.gap.stop - link.gap.start
        g += [x[link.ahead] - outputs[:ahead], outputs[ahead:]]
        cost.append(price)
    stage = stages[at]
    pose = ca.Function("pose", [stage.variables, symbol], values([landing], stage.lifted))
    every = [(name, value.numel(), low, high) for name, value, low, high in _rows(stages)]
    sizes = [size for _, size, _, _ in every]
    return Nlp(
        {"x": x, "p": p, "f": sum(cost[1:], cost[0]), "g": ca.vertcat(*g)},
        parameters,
        links,
        layout,
        [name for name, size, _, _ in every for _ in range(size)],
        np.repeat([low for *_, low, _ in every], sizes),
        np.repeat([high for *_, high in every], sizes),
        [stage.sizes[0] for stage in stages],
        [stage.sizes[1] for stage in stages],
        [stage.sizes[2] for stage in stages],
        ca.Function("landing", [x, p], [pose(x[links[at].v], p)]),
    )


def _chain(
    stages: list[Stage], kinds: dict[int, StageFunctions], parameters: Parameters
) -> tuple[list[Link], list[tuple[str, int, slice]]]:
    """Places of all stages in x, g and p, and the layout of x."""
    links: list[Link] = []
    layout: list[tuple[str, int, slice]] = []
    at = row = 0
    for k, stage in enumerate(stages):
        first = at
        for name, symbol in [*stage.states.items(), *stage.controls.items()]:
            layout.append((name, k, slice(at, at + symbol.numel())))
            at += symbol.numel()
        gap = sum(symbol.numel() for symbol in stage.following.values())
        rows = stage.sizes[2]
        data: list[int] = []
        for name, (symbol, begin) in stage.data.items():
            start = parameters.where(name).start + (k - begin) * symbol.numel()
            data += range(start, start + symbol.numel())
        links.append(
            Link(
                kinds[id(stage)],
                stage,
                slice(first, at),
                slice(row, row + gap),
                slice(row + gap, row + gap + rows),
                slice(at, at + gap),
                data,
            )
        )
        row += gap + rows
    return links, layout


def _rows(stages: list[Stage]) -> list[tuple[str, ca.SX, float, float]]:
    """All rows of g in order: name, expression, bounds."""
    rows: list[tuple[str, ca.SX, float, float]] = []
    for k, stage in enumerate(stages):
        if stage.following:
            rows.append((f"gap {k}", ca.vertcat(*stage.following.values()), 0.0, 0.0))
        rows += stage.rows
    return rows
