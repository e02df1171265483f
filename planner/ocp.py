"""Parts of a staged NLP: parameters, stages, and their assembly in FATROP's block order.

    x = [X_0, U_0, X_1, U_1, ..., X_N, U_N]
    g = [gap_0, rows_0, gap_1, rows_1, ..., rows_N],  gap_k = X_{k+1} - F_k(X_k, U_k)

FATROP needs the coefficient +1 on X_{k+1} and rows of stage k that depend on X_k and
U_k only; the last stage may have controls too.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

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


@dataclass
class Stage:
    """One stage: named state and control symbols, its rows and its cost.

    gap: X_{k+1} - F_k(X_k, U_k), None at the last stage.
    """

    states: dict[str, ca.SX]
    controls: dict[str, ca.SX]
    rows: list[tuple[str, ca.SX, float, float]] = field(default_factory=list)
    gap: ca.SX | None = None
    cost: ca.SX = dataclasses.field(default_factory=lambda: ca.SX(0))

    def control(self, name: str) -> ca.SX:
        """A new scalar control."""
        self.controls[name] = ca.SX.sym(name)
        return self.controls[name]

    def row(self, name: str, value: ca.SX, low: float, high: float) -> None:
        """Add the constraint low <= value <= high, for each component."""
        self.rows.append((name, value, low, high))


@dataclass(frozen=True)
class Nlp:
    """An assembled NLP.

    problem: x, p, f, g for `casadi.nlpsol`; layout: (block, stage, slice of x);
    row_names, lbg, ubg: one entry per row of g; nx, nu, ng: sizes per stage;
    landing: function (x, p) -> landing pose (x, z, theta).
    """

    problem: dict[str, ca.SX]
    parameters: Parameters
    layout: list[tuple[str, int, slice]]
    row_names: list[str]
    lbg: Array
    ubg: Array
    nx: list[int]
    nu: list[int]
    ng: list[int]
    landing: ca.Function

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
        for block, k, where in self.layout:
            if block == name and k == stage:
                return x[where]
        return None


def assemble(stages: list[Stage], parameters: Parameters, landing: ca.SX) -> Nlp:
    """The NLP of the stages, in block order."""
    variables: list[ca.SX] = []
    layout: list[tuple[str, int, slice]] = []
    rows: list[tuple[str, ca.SX, float, float]] = []
    at = 0
    for k, stage in enumerate(stages):
        for name, symbol in [*stage.states.items(), *stage.controls.items()]:
            layout.append((name, k, slice(at, at + symbol.numel())))
            variables.append(symbol)
            at += symbol.numel()
        if stage.gap is not None:
            rows.append((f"gap {k}", stage.gap, 0.0, 0.0))
        rows += stage.rows
    sizes = [value.numel() for _, value, _, _ in rows]
    problem = {
        "x": ca.vertcat(*variables),
        "p": parameters.symbol,
        "f": sum((stage.cost for stage in stages), ca.SX(0)),
        "g": ca.vertcat(*[value for _, value, _, _ in rows]),
    }
    return Nlp(
        problem,
        parameters,
        layout,
        [name for (name, *_), size in zip(rows, sizes, strict=True) for _ in range(size)],
        np.repeat([low for *_, low, _ in rows], sizes),
        np.repeat([high for *_, high in rows], sizes),
        [sum(s.numel() for s in stage.states.values()) for stage in stages],
        [sum(s.numel() for s in stage.controls.values()) for stage in stages],
        [sum(value.numel() for _, value, _, _ in stage.rows) for stage in stages],
        ca.Function("landing", [problem["x"], problem["p"]], [landing]),
    )
