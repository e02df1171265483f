"""One stage of a multiple-shooting NLP: symbols, constraints and cost, functions and derivatives.

A stage's constraints are short expressions of a few intermediate values, such as the hand's motion
at an instant or the seven arguments of the sliding pivot. Intermediates are short expressions of
earlier ones, down to the variables. Differentiating the composition in every variable repeats work;
here each level is differentiated in its own few arguments, and the chain rule joins the levels,

    H <- H_00 + H_0y D + D' H_y0 + D' H_yy D + sum_i a_i (second derivative of y_i),

with y the last intermediate, D its Jacobian in what comes before, a the gradient with
respect to y. On a Panda's opening interval this takes a sixth of the operations.

Constraints at many instants (of the carry, of the flight) are differentiated once, and CasADi's map
goes through the instants: an NLP with 200 constraints on the hand is derived in 0.5 s instead
of 5, and its C code is a sixth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import Array
from .variables import Block

#: Largest number of intermediates in a stage with shared common expressions. Beyond it (scenarios)
#: sharing costs more than half of the build and saves a fifth of the evaluation.
MAX_SHARED = 20

Lifted = list[tuple[ca.SX, ca.SX]]


@dataclass
class Parameters:
    """Named blocks of the NLP's parameter vector, in the order of their first use."""

    blocks: dict[str, ca.SX] = field(default_factory=dict)

    def __call__(self, name: str, size: int = 1) -> ca.SX:
        """The block's symbol (size, 1); the first call adds it."""
        if name not in self.blocks:
            self.blocks[name] = ca.SX.sym(name, size)
        return self.blocks[name]

    @property
    def symbol(self) -> ca.SX:
        """The parameter vector."""
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


@dataclass(kw_only=True)
class Constraints:
    """Constraints and their intermediate values."""

    lifted: Lifted = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)

    def subject_to(
        self, name: str, value: ca.SX, low: float = -np.inf, high: float = np.inf
    ) -> None:
        """Add the constraint low <= value <= high, for each component."""
        self.rows.append(Row(name, value, low, high))

    def lift(self, *values: ca.SX) -> list[ca.SX]:
        """Scalar symbols in place of `values`, which differentiation substitutes."""
        definition = ca.vertcat(*values)
        symbol = ca.SX.sym(f"y{len(self.lifted)}", definition.numel())
        self.lifted.append((symbol, definition))
        return list(ca.vertsplit(symbol))


@dataclass
class Instants(Constraints):
    """Constraints of a stage at N instants, written and differentiated once.

    They depend on the stage's symbols and on `at` (k, 1); column i of `data` (k, N) has the values
    of `at` at instant i.
    """

    at: ca.SX
    data: Array


@dataclass
class Stage(Constraints):
    """One kind of stage: state and control symbols, intermediates, constraints and cost.

    data: symbols with other values at each stage of the kind, by the name of their parameter block,
    and the first stage with values in it. following: the states F_k at the next stage; empty at the
    last.
    """

    states: dict[Block, ca.SX] = field(default_factory=dict)
    controls: dict[Block, ca.SX] = field(default_factory=dict)
    data: dict[str, tuple[ca.SX, int]] = field(default_factory=dict)
    instants: list[Instants] = field(default_factory=list)
    following: dict[Block, ca.SX] = field(default_factory=dict)
    cost: ca.SX = field(default_factory=lambda: ca.SX(0))

    def state(self, block: Block, size: int = 1) -> ca.SX:
        """A new state."""
        self.states[block] = ca.SX.sym(block.name, size)
        return self.states[block]

    def control(self, block: Block, size: int = 1) -> ca.SX:
        """A new control."""
        self.controls[block] = ca.SX.sym(f"{block.name}_{block.index}", size)
        return self.controls[block]

    def at_instants(self, *data: npt.ArrayLike) -> tuple[Instants, list[ca.SX]]:
        """A group of constraints at N instants, and symbols for the `data` (N,) of each."""
        at = ca.SX.sym("at", len(data))
        self.instants.append(Instants(at, np.array(data, float)))
        return self.instants[-1], list(ca.vertsplit(at))

    @property
    def variables(self) -> ca.SX:
        """States, then controls."""
        return ca.vertcat(*self.states.values(), *self.controls.values())

    @property
    def outputs(self) -> ca.SX:
        """F_k, then the constraints outside of groups."""
        return ca.vertcat(*self.following.values(), *[row.value for row in self.rows])

    @property
    def all_rows(self) -> list[Row]:
        """The constraints outside of groups, then those of each instant."""
        repeated = (group.rows * group.data.shape[1] for group in self.instants)
        return sum(repeated, self.rows)

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of states, controls and constraints."""
        states, controls = (
            sum(symbol.numel() for symbol in some.values()) for some in (self.states, self.controls)
        )
        return states, controls, sum(row.value.numel() for row in self.all_rows)


@dataclass(frozen=True)
class Composition:
    """Outputs and a cost, written in variables and intermediate values."""

    variables: ca.SX
    outputs: ca.SX
    cost: ca.SX
    lifted: Lifted


class _GroupFunctions:
    """CasADi functions of (z, p), mapped over a group's instants; z: the arguments of its
    constraints.

    indices (len(z),): of z among the stage's variables and intermediates. value: the constraints,
    one column an instant. jacobian: their derivatives in z, one column a constraint. lagrangian (z,
    p, multipliers): gradient and Hessian of the sum of all constraints times multipliers.
    """

    def __init__(self, group: Instants, everything: ca.SX, parameters: ca.SX, name: str) -> None:
        rows = ca.vertcat(*[row.value for row in group.rows])
        expanded = substitute_lifted([rows], group.lifted)
        self.shape = rows.numel(), group.data.shape[1]
        depends = ca.which_depends(expanded[0], everything, 1, False)
        self.indices = np.flatnonzero(depends).tolist()
        z, multipliers = everything[self.indices], ca.SX.sym("l", rows.numel())
        written = Composition(z, rows, ca.SX(0), group.lifted)
        jacobian, _, gradient, hessian = differentiate(written, multipliers, ca.SX(0))

        def mapped(
            kind: str, more: list[ca.SX], outputs: list[ca.SX], summed: list[int]
        ) -> Callable[..., Any]:
            inputs = [z, parameters, group.at, *more]
            f = ca.Function(f"{name}_{kind}", inputs, outputs, {"cse": True})
            through = f.map(f"{name}_{kind}s", "serial", self.shape[1], [0, 1], summed)
            return lambda z, p, *more: through(z, p, ca.DM(group.data), *more)

        sums = [ca.densify(gradient), hessian]
        self.value = mapped("value", [], expanded, [])
        self.jacobian = mapped("slopes", [], [jacobian.T], [])
        self.lagrangian = mapped("curvature", [multipliers], sums, [0, 1])
        self.hessian = hessian.sparsity()


class StageFunctions:
    """CasADi functions of (v, d, p): a kind's variables, its stage's data, all parameters.

    Functions of the Lagrangian also take the multipliers of the outputs and the factor of the cost.
    """

    def __init__(self, stage: Stage, parameters: ca.SX, name: str) -> None:
        self._name, self._count = name, stage.outputs.numel()
        self._options = {"cse": len(stage.lifted) <= MAX_SHARED}
        self._stage = Composition(stage.variables, stage.outputs, stage.cost, stage.lifted)
        everything = ca.vertcat(stage.variables, *[symbol for symbol, _ in stage.lifted])
        self._groups = [
            _GroupFunctions(group, everything, parameters, f"{name}_{i}")
            for i, group in enumerate(stage.instants)
        ]
        data = ca.vertcat(*[symbol for symbol, _ in stage.data.values()])
        self._inputs = [stage.variables, data, parameters]
        self._lagrangian = [ca.SX.sym("l", self._count), ca.SX.sym("sigma")]
        for group in self._groups:
            self._lagrangian += [
                ca.SX.sym("gradient", len(group.indices)),
                ca.SX.sym("hessian", group.hessian),
            ]
        values = [everything[group.indices] for group in self._groups]
        once = substitute_lifted([stage.outputs, stage.cost, *values], stage.lifted)
        self._once = self._function("once", [], once)

    def _function(self, name: str, more: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
        inputs = [*self._inputs, *more]
        return ca.Function(f"{self._name}_{name}", inputs, outputs, self._options)

    @cached_property
    def _derivatives(self) -> list[ca.SX]:
        multipliers, sigma, *sums = self._lagrangian
        indices = [group.indices for group in self._groups]
        groups = list(zip(indices, sums[::2], sums[1::2], strict=True))
        return differentiate(self._stage, multipliers, sigma, groups)

    def _joined(
        self, name: str, more: list[ca.MX], outputs: Callable[..., list[ca.MX]]
    ) -> ca.Function:
        """A function of (v, d, p, more), made by outputs(v, d, p, *more)."""
        inputs = [ca.MX.sym("x", symbol.numel()) for symbol in self._inputs] + more
        return ca.Function(f"{self._name}_{name}", inputs, outputs(*inputs))

    @cached_property
    def value(self) -> ca.Function:
        """(v, d, p) -> outputs, cost."""

        def outputs(v: ca.MX, d: ca.MX, p: ca.MX) -> list[ca.MX]:
            once, cost, *values = self._once(v, d, p)
            return [self._all_outputs(once, values, p), cost]

        return self._joined("value", [], outputs)

    def _all_outputs(self, once: ca.MX, values: Sequence[ca.MX], p: ca.MX) -> ca.MX:
        pairs = zip(self._groups, values, strict=True)
        return ca.vertcat(once, *[ca.vec(group.value(z, p)) for group, z in pairs])

    @cached_property
    def jacobian(self) -> ca.Function:
        """(v, d, p) -> outputs, their Jacobian."""
        counts = [self._count, *(len(group.indices) for group in self._groups)]
        parts = ca.vertsplit(self._derivatives[0], np.cumsum([0, *counts]).tolist())
        chain = self._function("chain", [], parts)

        def outputs(v: ca.MX, d: ca.MX, p: ca.MX) -> list[ca.MX]:
            once, _, *values = self._once(v, d, p)
            first, *inner = chain.call([v, d, p])
            blocks = [first]
            for group, z, dz_dv in zip(self._groups, values, inner, strict=True):
                blocks.append(group.jacobian(z, p).T @ dz_dv)
            return [self._all_outputs(once, values, p), ca.vertcat(*blocks)]

        return self._joined("jacobian", [], outputs)

    @cached_property
    def cost_gradient(self) -> ca.Function:
        """(v, d, p) -> gradient of the cost, dense."""
        return self._function("cost", [], [ca.densify(self._derivatives[1])])

    @cached_property
    def hessian(self) -> ca.Function:
        """(v, d, p, multipliers, sigma) -> gradient (dense) and Hessian of the Lagrangian."""
        _, _, gradient, hessian = self._derivatives
        joined = self._function("whole", self._lagrangian, [ca.densify(gradient), hessian])

        def outputs(v: ca.MX, d: ca.MX, p: ca.MX, multipliers: ca.MX, sigma: ca.MX) -> list[ca.MX]:
            values = self._once(v, d, p)[2:]
            first, sums = self._count, []
            for group, z in zip(self._groups, values, strict=True):
                end = first + math.prod(group.shape)
                sums += group.lagrangian(z, p, ca.reshape(multipliers[first:end], group.shape))
                first = end
            return list(joined(v, d, p, multipliers[: self._count], sigma, *sums))

        count = self._count + sum(math.prod(group.shape) for group in self._groups)
        return self._joined("hessian", [ca.MX.sym("l", count), ca.MX.sym("sigma")], outputs)


def substitute_lifted(expressions: list[ca.SX], lifted: Lifted) -> list[ca.SX]:
    """The expressions with all intermediates substituted."""
    if not lifted:
        return expressions
    symbols, definitions = zip(*lifted, strict=True)
    return list(ca.substitute_inplace(list(symbols), list(definitions), expressions)[1])


def differentiate(
    written: Composition,
    multipliers: ca.SX,
    sigma: ca.SX,
    groups: Sequence[tuple[list[int], ca.SX, ca.SX]] = (),
) -> list[ca.SX]:
    """Derivatives through the intermediates, as expressions of the variables (n,).

    Jacobian (m, n) of the outputs; gradient (n,) of the cost; gradient (n,) and Hessian (n, n),
    both triangles, of `sigma * cost + multipliers' outputs`. groups: further summands, as indices
    of their variables and intermediates, gradient and Hessian in them; the rows of their
    derivatives follow those of the outputs.
    """
    outputs, cost, lifted = written.outputs, written.cost, written.lifted
    everything = ca.vertcat(written.variables, *[symbol for symbol, _ in lifted])
    total = sigma * cost + ca.dot(multipliers, outputs)
    hessian, gradient = ca.hessian(total, everything)
    jacobian, of_cost = ca.jacobian(outputs, everything), ca.gradient(cost, everything)
    for indices, of_group, curvature in groups:
        picked = ca.DM.eye(everything.numel())[indices, :]
        jacobian = ca.vertcat(jacobian, picked)
        gradient += picked.T @ of_group
        hessian += picked.T @ curvature @ picked
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
    derivatives = substitute_lifted([jacobian, of_cost, gradient, hessian], lifted + adjoints)
    return [ca.sparsify(entry) for entry in derivatives]
