"""CasADi functions of stages, and their derivatives.

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

Each kind of stage becomes machine code for itself. Refinements of an NLP, and scenes with the same
arm, gripper and object, have most kinds in common: of six only the last one, with the flight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ...cache import digest
from .machine_code import Made, compiled, compiled_later
from .stages import Instants, Stage

Lifted = list[tuple[ca.SX, ca.SX]]


#: Names of the functions of a kind of stages.
NAMES = ("value", "jacobian", "cost_gradient", "hessian")
#: Processor time [s] of solves after which a kind is compiled, while further ones go on: about what
#: that takes, so that a program that ends then has lost no more. Machine code of all kinds halves
#: or thirds the time of an iteration.
WORTH = 2.0

#: Functions that NLPs share, by the digest of what they are derived from.
Shared = dict[str, Any]


def _dependencies(expression: ca.SX, symbols: ca.SX) -> list[int]:
    """Indices of the symbols that an expression depends on."""
    return np.flatnonzero(ca.which_depends(expression, symbols, 1, False)).tolist()


@dataclass(frozen=True)
class _InstantFunctions:
    """CasADi functions of (z, p, at) of one instant; z, p: the arguments of its constraints.

    value: the constraints. jacobian: their derivatives in z, one column a constraint. lagrangian
    (z, p, at, multipliers): gradient and Hessian of the sum of all constraints times multipliers.
    """

    value: ca.Function
    jacobian: ca.Function
    lagrangian: ca.Function

    @classmethod
    def of(cls, value: ca.Function, group: Instants, z: ca.SX, p: ca.SX) -> _InstantFunctions:
        """The functions of a group whose `value` is given."""
        rows = ca.vertcat(*[row.value for row in group.rows])
        multipliers = ca.SX.sym("l", rows.numel())
        jacobian, gradient, hessian = differentiate(z, group.lifted, rows, multipliers)
        inputs = [z, p, group.at]
        slopes = ca.Function("slopes", inputs, [jacobian.T])
        sums = [ca.densify(gradient), hessian]
        return cls(value, slopes, ca.Function("curvature", [*inputs, multipliers], sums))


class _GroupFunctions:
    """CasADi functions of (z, p), mapped over a group's instants.

    indices (len(z),): of z among the stage's variables and intermediates; parameters (len(p),): of
    p among all parameters. The outputs are those of `_InstantFunctions`, one column an instant;
    those of `lagrangian` are summed.
    """

    def __init__(
        self, group: Instants, everything: ca.SX, parameters: ca.SX, shared: Shared
    ) -> None:
        rows = ca.vertcat(*[row.value for row in group.rows])
        expanded = substitute_lifted([rows], group.lifted)
        self.shape, self.data = (rows.numel(), group.data.shape[1]), group.data.tolist()
        self.indices = _dependencies(expanded[0], everything)
        self.parameters = _dependencies(expanded[0], parameters)
        z, p = everything[self.indices], parameters[self.parameters]
        value = ca.Function("value", [z, p, group.at], expanded)
        self.key = digest(value.serialize())
        if self.key not in shared:
            shared[self.key] = _InstantFunctions.of(value, group, z, p)
        self._one: _InstantFunctions = shared[self.key]
        self.gradient = ca.SX.sym("gradient", z.numel())
        self.hessian = ca.SX.sym("hessian", self._one.lagrangian.sparsity_out(1))

    def value(self, z: ca.MX, p: ca.MX) -> ca.MX:
        """The constraints."""
        return self._mapped(self._one.value, [])(z, p, ca.DM(self.data))

    def jacobian(self, z: ca.MX, p: ca.MX) -> ca.MX:
        """Their derivatives in z."""
        return self._mapped(self._one.jacobian, [])(z, p, ca.DM(self.data))

    def lagrangian(self, z: ca.MX, p: ca.MX, multipliers: ca.MX) -> list[ca.MX]:
        """Gradient and Hessian of their sum with multipliers, in z."""
        return self._mapped(self._one.lagrangian, [0, 1]).call(
            [z, p, ca.DM(self.data), multipliers]
        )

    def _mapped(self, one: ca.Function, summed: list[int]) -> ca.Function:
        return one.map(f"{one.name()}s", "serial", self.shape[1], [0, 1], summed)


class StageFunctions:
    """CasADi functions of (v, d, p): a kind's variables, its stage's data, parameters.

    parameters (len(p),): indices of p among those of the NLP that they were made for.
    """

    def __init__(self, stage: Stage, parameters: ca.SX, shared: Shared) -> None:
        self._stage = stage
        rows = [row.value for row in stage.rows]
        outputs = ca.vertcat(*[-state for state in stage.following.values()], *rows)
        self._outputs = ca.vertcat(stage.cost, outputs)
        everything = ca.vertcat(stage.variables, *[symbol for symbol, _ in stage.lifted])
        self._groups = [
            _GroupFunctions(group, everything, parameters, shared) for group in stage.instants
        ]
        data = ca.vertcat(*[symbol for symbol, _ in stage.data.values()])
        self._multipliers = ca.SX.sym("l", self._outputs.numel())
        arguments = [everything[group.indices] for group in self._groups]
        once = substitute_lifted([stage.cost, outputs, *arguments], stage.lifted)
        used = set(_dependencies(ca.vertcat(*once), parameters))
        self.parameters = sorted(used.union(*[group.parameters for group in self._groups]))
        self._places = [
            np.searchsorted(self.parameters, group.parameters).tolist() for group in self._groups
        ]
        self._inputs = [stage.variables, data, parameters[self.parameters]]
        self._once = ca.Function("once", self._inputs, once)
        groups_key = repr([(group.key, group.indices, group.data) for group in self._groups])
        #: Digest of all that the functions depend on.
        self.key = digest(self._once.serialize(), groups_key, repr(self._places))
        self._spent = 0.0
        self._later: Made | None = None

    @cached_property
    def code(self) -> dict[str, ca.Function]:
        """The functions, by `NAMES`; machine code if the cache has it.

        value (v, d, p) -> cost, outputs: -F_k and the constraints, those of groups last. jacobian
        (v, d, p) -> outputs, their Jacobian. cost_gradient (v, d, p), dense. hessian (v, d, p,
        multipliers of cost and outputs) -> gradient (dense) and Hessian of the Lagrangian.
        """
        return self._compiled(make=False)

    def compile(self) -> None:
        """Compiles the functions, in some seconds; nothing without a compiler, or if compiled."""
        self.code = self._compiled(make=True)

    def spend(self, seconds: float) -> None:
        """Counts processor time [s] of solves.

        Once they have taken as long as it takes to compile the functions, this is done beside them,
        and what was compiled is used from then on.
        """
        self._spent += seconds
        if self._spent < WORTH or self.is_compiled:
            return
        if self._later is None:
            self._later = compiled_later(self._code_key, self.code)
        elif self._later():
            self.code = self._compiled(make=False)

    @property
    def is_compiled(self) -> bool:
        """Whether the functions are machine code."""
        return str(self.code["value"].class_name()) == "External"

    @cached_property
    def _code_key(self) -> str:
        return digest(self.key, Path(__file__).read_bytes())

    def _compiled(self, make: bool) -> dict[str, ca.Function]:
        return compiled(self._code_key, NAMES, lambda: self._interpreted, make=make)

    @cached_property
    def _interpreted(self) -> dict[str, ca.Function]:
        """The functions as CasADi evaluates them."""
        functions = self._value(), self._jacobian(), self._cost_gradient(), self._hessian()
        return dict(zip(NAMES, functions, strict=True))

    def _function(self, name: str, more: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
        """A derivative, a function of (v, d, p, more), written in SX."""
        return ca.Function(name, [*self._inputs, *more], outputs)

    def _joined(
        self, name: str, outputs: Callable[..., list[ca.MX]], more: Sequence[ca.MX] = ()
    ) -> ca.Function:
        """A function of (v, d, p, more), made of calls of others by outputs(v, d, p, *more)."""
        inputs = [*[ca.MX.sym("x", symbol.numel()) for symbol in self._inputs], *more]
        return ca.Function(name, inputs, outputs(*inputs))

    @cached_property
    def _derivatives(self) -> list[ca.SX]:
        stage, groups = self._stage, [(g.indices, g.gradient, g.hessian) for g in self._groups]
        return differentiate(
            stage.variables, stage.lifted, self._outputs, self._multipliers, groups
        )

    def _value(self) -> ca.Function:
        return self._joined("value", lambda v, d, p: self._values(v, d, p)[:2])

    def _values(self, v: ca.MX, d: ca.MX, p: ca.MX) -> list[ca.MX]:
        """Cost, outputs, and the arguments of each group."""
        cost, once, *arguments = self._once.call([v, d, p])
        triples = zip(self._groups, arguments, self._places, strict=True)
        of_groups = [ca.vec(group.value(z, p[at])) for group, z, at in triples]
        return [cost, ca.vertcat(once, *of_groups), *arguments]

    def _jacobian(self) -> ca.Function:
        counts = [1, self._outputs.numel() - 1, *(len(group.indices) for group in self._groups)]
        parts = ca.vertsplit(self._derivatives[0], [0, *np.cumsum(counts).tolist()])
        chain = self._function("chain", [], parts[1:])

        def outputs(v: ca.MX, d: ca.MX, p: ca.MX) -> list[ca.MX]:
            _, values, *arguments = self._values(v, d, p)
            first, *dz_dv = chain.call([v, d, p])
            each = zip(self._groups, arguments, self._places, dz_dv, strict=True)
            blocks = [group.jacobian(z, p[at]).T @ slope for group, z, at, slope in each]
            return [values, ca.vertcat(first, *blocks)]

        return self._joined("jacobian", outputs)

    def _cost_gradient(self) -> ca.Function:
        return self._function("cost_gradient", [], [ca.densify(self._derivatives[0][0, :].T)])

    def _hessian(self) -> ca.Function:
        _, gradient, hessian = self._derivatives
        sums = [symbol for group in self._groups for symbol in (group.gradient, group.hessian)]
        whole = self._function("whole", [self._multipliers, *sums], [ca.densify(gradient), hessian])
        counts = [self._outputs.numel(), *(math.prod(group.shape) for group in self._groups)]

        def outputs(v: ca.MX, d: ca.MX, p: ca.MX, multipliers: ca.MX) -> list[ca.MX]:
            first, *parts = ca.vertsplit(multipliers, np.cumsum([0, *counts]).tolist())
            inputs, arguments = [v, d, p, first], self._once.call([v, d, p])[2:]
            each = zip(self._groups, arguments, self._places, parts, strict=True)
            for group, z, at, part in each:
                inputs += group.lagrangian(z, p[at], ca.reshape(part, group.shape))
            return list(whole.call(inputs))

        return self._joined("hessian", outputs, [ca.MX.sym("l", sum(counts))])


def substitute_lifted(expressions: list[ca.SX], lifted: Lifted) -> list[ca.SX]:
    """The expressions with all intermediates substituted."""
    if not lifted:
        return expressions
    symbols, definitions = zip(*lifted, strict=True)
    return list(ca.substitute_inplace(list(symbols), list(definitions), expressions)[1])


def differentiate(
    variables: ca.SX,
    lifted: Lifted,
    outputs: ca.SX,
    multipliers: ca.SX,
    groups: Sequence[tuple[list[int], ca.SX, ca.SX]] = (),
) -> list[ca.SX]:
    """Derivatives through the intermediates, as expressions of the variables (n,).

    Jacobian (m, n) of the outputs; gradient (n,) and Hessian (n, n), both triangles, of
    `multipliers' outputs`. groups: further summands, as indices of their variables and
    intermediates, gradient and Hessian in them; the rows of their derivatives follow those of the
    outputs.
    """
    everything = ca.vertcat(variables, *[symbol for symbol, _ in lifted])
    hessian, gradient = ca.hessian(ca.dot(multipliers, outputs), everything)
    jacobian = ca.jacobian(outputs, everything)
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
        jacobian = jacobian[:, :start] + jacobian[:, start:] @ slope
    derivatives = substitute_lifted([jacobian, gradient, hessian], lifted + adjoints)
    return [ca.sparsify(entry) for entry in derivatives]
