"""The condition of a throw's KKT matrix at its solution."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..ocp import bounds, nlp_functions, parameter_values, window_of
from ..result import PlannedThrow

Array = npt.NDArray[np.float64]
#: Multipliers and distances from bounds are taken to be at least this.
LEAST = 1e-9
#: Rounds of scaling rows and columns to a largest entry of one.
ROUNDS = 12


def kkt_matrix(thrown: PlannedThrow) -> Array:
    """The interior-point KKT matrix at the throw's solution, symmetric, dense.

    [W + D, A'; A, -E]: W the Lagrangian's Hessian, A the constraints' Jacobian, D the bounds'
    and E the inequality rows' multiplier over distance, and the inverse of that.
    """
    scene, mover, nlp, at = thrown.scene, thrown.mover, thrown.nlp, thrown.solution
    target = scene.target
    assert target is not None
    window = window_of(scene) if nlp.structure.robust else None
    goal = target.in_plane(target.plane_x + thrown.aim[0], target.turned(thrown.aim[1]).theta)
    numbers = nlp.parameters.vector(
        parameter_values(scene, mover, goal, window, thrown.asked.margins)
    )
    functions = nlp_functions(nlp, "fatrop")
    hessian = functions["nlp_hess_l"](at.x, numbers, 1.0, at.lam_g)[1].full()
    g, jacobian = (part.full() for part in functions["nlp_jac_g"](at.x, numbers))
    low, high = bounds(nlp, scene, mover, window)
    near = np.minimum(at.x - low, high - at.x)
    pull = np.where(np.isfinite(near), _floor(at.lam_x) / _floor(near), 0.0)
    values = g.ravel()
    slack = np.minimum(values - nlp.lbg, nlp.ubg - values)
    equal = nlp.lbg == nlp.ubg
    give = np.where(equal, 0.0, _floor(slack) / _floor(at.lam_g))
    return np.block([[hessian + np.diag(pull), jacobian.T], [jacobian, -np.diag(give)]])


def _floor(values: Array) -> Array:
    return np.maximum(np.abs(values), LEAST)


def condition(matrix: Array) -> tuple[float, float]:
    """Condition (1-norm) of a symmetric matrix: as it is, and with rows and columns scaled."""
    scaled = matrix.copy()
    for _ in range(ROUNDS):
        size = np.sqrt(np.maximum(np.abs(scaled).max(axis=0), 1e-300))
        scaled /= size[:, None] * size[None, :]
    raw, better = (float(np.linalg.cond(m, 1)) for m in (matrix, scaled))
    return raw, better
