"""First and second derivatives of a stage through its intermediate values.

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

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Derivatives:
    """Of outputs (m,) and cost in the variables (n,), as expressions of variables only.

    jacobian (m, n) of the outputs; cost_gradient (n,); gradient (n,) and hessian (n, n),
    both triangles, of `sigma * cost + multipliers' outputs`.
    """

    jacobian: ca.SX
    cost_gradient: ca.SX
    gradient: ca.SX
    hessian: ca.SX


def values(expression: list[ca.SX], lifted: list[tuple[ca.SX, ca.SX]]) -> list[ca.SX]:
    """The expressions with all intermediates put in."""
    symbols = [symbol for symbol, _ in lifted]
    definitions = [definition for _, definition in lifted]
    if not symbols:
        return expression
    return list(ca.substitute_inplace(symbols, definitions, expression)[1])


def differentiate(
    variables: ca.SX,
    lifted: list[tuple[ca.SX, ca.SX]],
    outputs: ca.SX,
    cost: ca.SX,
    multipliers: ca.SX,
    sigma: ca.SX,
) -> Derivatives:
    """Derivatives through the intermediates `lifted`: (symbol, definition) in order."""
    everything = ca.vertcat(variables, *[symbol for symbol, _ in lifted])
    total = sigma * cost + ca.dot(multipliers, outputs)
    hessian, gradient = ca.hessian(total, everything)
    jacobian, of_cost = ca.jacobian(outputs, everything), ca.gradient(cost, everything)
    adjoints: list[tuple[ca.SX, ca.SX]] = []
    for symbol, definition in reversed(lifted):
        start = jacobian.shape[1] - symbol.numel()
        before = everything[:start]
        slope = ca.jacobian(definition, before)
        adjoint = ca.SX.sym("a", symbol.numel())
        adjoints.append((adjoint, gradient[start:]))
        curvature = ca.hessian(ca.dot(adjoint, definition), before)[0]
        cross = hessian[:start, start:] @ slope
        within = slope.T @ hessian[start:, start:] @ slope
        hessian = _mirrored(hessian[:start, :start] + cross + cross.T + within + curvature)
        gradient = gradient[:start] + slope.T @ adjoint
        of_cost = of_cost[:start] + slope.T @ of_cost[start:]
        jacobian = jacobian[:, :start] + jacobian[:, start:] @ slope
    found = values([jacobian, of_cost, gradient, hessian], lifted + adjoints)
    return Derivatives(*(ca.sparsify(entry) for entry in found))


def _mirrored(matrix: ca.SX) -> ca.SX:
    """The symmetric matrix of the upper triangle: each entry computed once."""
    return ca.triu2symm(ca.triu(matrix))
