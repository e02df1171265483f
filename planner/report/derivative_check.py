"""The derivatives of a scene's NLPs against differences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems import Scene, load_scene
from ..check import Guard, make_mover
from ..ocp import (
    ThrowNlp,
    bounds,
    build_nlp,
    nlp_functions,
    parameter_values,
    structure_of,
    window_of,
)
from .page import Effort, Part, Table

Array = npt.NDArray[np.float64]
#: Steps of differences along a random direction of length one per variable.
NEAR, FAR = 2e-7, 4e-7
SEED = 3
GUARDS: frozenset[Guard] = frozenset({"carry", "flight", "passing"})


def structures(scene: Scene, everything: bool) -> Iterator[tuple[str, ThrowNlp, Array]]:
    """(what, NLP, parameters) of a scene: usual; also guarded, quiet and with scenarios."""
    mover, target = make_mover(scene), scene.target
    assert target is not None
    kinds: list[tuple[str, frozenset[Guard], str]] = [("usual", frozenset(), "")]
    if everything:
        kinds += [("guarded", GUARDS, ""), ("quiet", frozenset(), "quiet")]
        kinds += [("guarded, scenarios", GUARDS, "scenarios")]
    for words, guards, robust in kinds:
        window = window_of(scene) if robust else None
        angle = target.theta is not None
        structure = structure_of(scene, mover, angle, guards=guards, robust=robust, window=window)
        nlp = build_nlp(structure, mover)
        yield words, nlp, nlp.parameters.vector(parameter_values(scene, mover, target, window))


def derivative_errors(
    nlp: ThrowNlp, numbers: Array, limits: tuple[Array, Array], points: int, seed: int
) -> tuple[float, float]:
    """Largest relative error of first and of second derivatives at random points.

    Along random directions, against central differences of fourth order; relative to the
    largest component. The points are anywhere in the middle half of the bounds.
    """
    functions = nlp_functions(nlp, "fatrop")
    rng = np.random.default_rng(seed)
    low, high = (np.clip(side, -1.0, 1.0) for side in limits)
    worst = [0.0, 0.0]
    for _ in range(points):
        x = low + (high - low) * rng.uniform(0.25, 0.75, low.size)
        multipliers = rng.standard_normal(nlp.size[1])
        way = rng.standard_normal(x.size)
        slope = functions["nlp_jac_g"](x, numbers)[1].full() @ way
        cost = functions["nlp_grad_f"](x, numbers).full().ravel() @ way
        curvature = functions["nlp_hess_l"](x, numbers, 1.0, multipliers)[1].full() @ way

        def values(at: Array) -> Array:
            g = functions["nlp_g"](at, numbers)
            return np.append(np.array(g), float(functions["nlp_f"](at, numbers)))

        def gradient(at: Array, multipliers: Array = multipliers) -> Array:
            return np.array(functions["nlp_grad"](at, numbers, 1.0, multipliers)[2]).ravel()

        for i, (function, exact) in enumerate(
            ((values, np.append(slope, cost)), (gradient, curvature))
        ):
            near, far = (
                (function(x + step * way) - function(x - step * way)) / (2 * step)
                for step in (NEAR, FAR)
            )
            error = np.abs((4 * near - far) / 3 - exact).max() / np.abs(exact).max()
            worst[i] = max(worst[i], float(error))
    return worst[0], worst[1]


def derivative_rows(name: str, effort: Effort) -> list[list[Any]]:
    """One row per structure of a scene."""
    scene, rows = load_scene(name), []
    mover = make_mover(scene)
    for words, nlp, numbers in structures(scene, not effort.quick):
        window = window_of(scene) if nlp.structure.robust else None
        limits = bounds(nlp, scene, mover, window)
        errors = derivative_errors(nlp, numbers, limits, effort.of(2, 5), SEED)
        rows.append([name, words, *nlp.size, *errors])
    return rows


def derivative_parts(rows: list[list[Any]]) -> list[Part]:
    """The derivatives' errors, worst first in words."""
    worst = [max(row[i] for row in rows) for i in (4, 5)]
    words = (
        "Derivatives, put together stage by stage, against central differences of fourth order "
        f"along random directions at random points (seed {SEED}): the largest relative "
        f"difference is {worst[0]:.1e} for first and {worst[1]:.1e} for second derivatives."
    )
    columns = ["scene", "NLP", "variables", "constraints", "first", "second"]
    return [words, Table("stability_derivatives", "Relative differences", columns, rows)]
