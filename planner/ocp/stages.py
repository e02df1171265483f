"""One stage of a multiple-shooting NLP: its symbols, rows and cost, functions and derivatives.

A stage's rows are short expressions of a few intermediate values (the hand's motion at
an instant, the seven numbers that the sliding pivot depends on), which are short
expressions of others, and so on down to the variables. Differentiating the whole
composition in every variable repeats the same work for each; here each level is
differentiated in its own few arguments and the levels are joined by the chain rule,

    H <- H_00 + H_0y D + D' H_y0 + D' H_yy D + sum_i a_i (second derivative of y_i),

with y the last intermediate, D its Jacobian in what comes before, a the gradient with
respect to y. On a Panda's opening interval this takes a sixth of the operations.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from .layout import Block

Array = npt.NDArray[np.float64]
Lifted = list[tuple[ca.SX, ca.SX]]


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

    def start(self, name: str) -> int:
        """Index of the block's first number in the vector."""
        names = list(self.blocks)
        return sum(self.blocks[before].numel() for before in names[: names.index(name)])


@dataclass(frozen=True)
class Row:
    """The constraint low <= value <= high, for each component."""

    name: str
    value: ca.SX
    low: float
    high: float


@dataclass
class Stage:
    """One kind of stage: state and control symbols, intermediates, rows and cost.

    data: symbols that have other numbers at each stage of the kind, by the name of their
    parameter block, which holds them stage after stage, from the stage given with it on.
    following: the states at the next stage, F_k; empty at the last.
    """

    states: dict[Block, ca.SX]
    controls: dict[Block, ca.SX]
    data: dict[str, tuple[ca.SX, int]] = field(default_factory=dict)
    lifted: Lifted = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    following: dict[Block, ca.SX] = field(default_factory=dict)
    cost: ca.SX = field(default_factory=lambda: ca.SX(0))

    def control(self, block: Block, size: int = 1) -> ca.SX:
        """A new control."""
        self.controls[block] = ca.SX.sym(f"{block.name}_{block.index}", size)
        return self.controls[block]

    def row(self, name: str, value: ca.SX, low: float, high: float) -> None:
        """Add the constraint low <= value <= high, for each component."""
        self.rows.append(Row(name, value, low, high))

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
        return ca.vertcat(*self.following.values(), *[row.value for row in self.rows])

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of states, controls and rows."""
        states, controls = (
            sum(symbol.numel() for symbol in some.values()) for some in (self.states, self.controls)
        )
        return states, controls, sum(row.value.numel() for row in self.rows)


class StageFunctions:
    """CasADi functions of (v, d, p): a kind's variables, its stage's data, all parameters.

    Those of the Lagrangian also take the multipliers of the outputs and the cost's factor.
    """

    def __init__(self, stage: Stage, parameters: ca.SX, name: str) -> None:
        self._stage, self._name = stage, name
        data = ca.vertcat(*[symbol for symbol, _ in stage.data.values()])
        self._inputs = [stage.variables, data, parameters]
        self._lagrangian = [ca.SX.sym("l", stage.outputs.numel()), ca.SX.sym("sigma")]
        self.value = self._function("value", [], self._inserted([stage.outputs, stage.cost]))

    def _inserted(self, expressions: list[ca.SX]) -> list[ca.SX]:
        return inserted(expressions, self._stage.lifted)

    def _function(self, name: str, more: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
        inputs = [*self._inputs, *more]
        return ca.Function(f"{self._name}_{name}", inputs, outputs, {"cse": True})

    @cached_property
    def _derivatives(self) -> list[ca.SX]:
        return differentiate(self._stage, *self._lagrangian)

    @cached_property
    def jacobian(self) -> ca.Function:
        """(v, d, p) -> outputs, their Jacobian."""
        outputs = self._inserted([self._stage.outputs])
        return self._function("jacobian", [], [*outputs, self._derivatives[0]])

    @cached_property
    def cost_gradient(self) -> ca.Function:
        """(v, d, p) -> gradient of the cost, dense."""
        return self._function("cost", [], [ca.densify(self._derivatives[1])])

    @cached_property
    def hessian(self) -> ca.Function:
        """(v, d, p, multipliers, sigma) -> gradient (dense) and Hessian of the Lagrangian."""
        _, _, gradient, hessian = self._derivatives
        return self._function("hessian", self._lagrangian, [ca.densify(gradient), hessian])


def inserted(expressions: list[ca.SX], lifted: Lifted) -> list[ca.SX]:
    """The expressions with all intermediates put in."""
    if not lifted:
        return expressions
    symbols, definitions = zip(*lifted, strict=True)
    return list(ca.substitute_inplace(list(symbols), list(definitions), expressions)[1])


def differentiate(stage: Stage, multipliers: ca.SX, sigma: ca.SX) -> list[ca.SX]:
    """Derivatives of a stage through its intermediates, as expressions of its variables (n,).

    Jacobian (m, n) of the outputs; gradient (n,) of the cost; gradient (n,) and Hessian (n, n),
    both triangles, of `sigma * cost + multipliers' outputs`.
    """
    outputs, cost, lifted = stage.outputs, stage.cost, stage.lifted
    everything = ca.vertcat(stage.variables, *[symbol for symbol, _ in lifted])
    total = sigma * cost + ca.dot(multipliers, outputs)
    hessian, gradient = ca.hessian(total, everything)
    jacobian, of_cost = ca.jacobian(outputs, everything), ca.gradient(cost, everything)
    adjoints: Lifted = []
    for symbol, definition in reversed(lifted):
        start = jacobian.shape[1] - symbol.numel()
        before = everything[:start]
        slope = ca.jacobian(definition, before)
        adjoint = ca.SX.sym("a", symbol.numel())
        adjoints.append((adjoint, gradient[start:]))
        curvature = ca.hessian(ca.dot(adjoint, definition), before)[0]
        cross = hessian[:start, start:] @ slope
        within = slope.T @ hessian[start:, start:] @ slope
        hessian = hessian[:start, :start] + cross + cross.T + within + curvature
        # Each entry is computed once: the upper triangle mirrored.
        hessian = ca.triu2symm(ca.triu(hessian))
        gradient = gradient[:start] + slope.T @ adjoint
        of_cost = of_cost[:start] + slope.T @ of_cost[start:]
        jacobian = jacobian[:, :start] + jacobian[:, start:] @ slope
    found = inserted([jacobian, of_cost, gradient, hessian], lifted + adjoints)
    return [ca.sparsify(entry) for entry in found]
