"""What the planner's settings are compared by: solving time, error, and effort of the throw."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .pareto import pareto
from .planner_runs import Measured

Array = npt.NDArray[np.float64]

#: By how much solving time, error and effort must differ to decide. Times differ by chance:
#: the default, measured twice, shows how much. Errors of coarse meshes cancel by chance. The
#: effort does not, but half a percent of it is not worth a tenth of the time.
MARGINS = (0.1, 0.1, 5e-3)


def scaled(errors: Array, scene_length: float = 0.26) -> Array:
    """Scaled errors (N,) [m] of (N, 2) [m, rad]; the built-in scenes' bar is 0.26 m long."""
    return np.asarray(np.abs(errors) @ [1.0, scene_length / 2])


def points(found: list[Measured]) -> Array:
    """(N, 3): solving time [ms], exact error [mm], effort over the first one's.

    Each is the first one's median times the median of the ratios to it for the same target:
    targets differ far more than settings do. A time is compared with that of the first one's
    solve just before it: machines change their speed. The effort is the NLP's cost at its
    answer. Infinite where fewer than nine of ten solves converge.
    """
    made = np.full((len(found), 3), np.inf)
    first = found[0]
    usual = 1e3 * np.median(first.solve), 1e3 * np.nanmedian(scaled(first.exact)), 1.0
    for row, one in zip(made, found, strict=True):
        if one.solved >= 0.9 * len(one.solve):
            ratios = (
                one.solve / (first.solve if one is first or one.beside is None else one.beside),
                scaled(one.exact) / scaled(first.exact),
                one.cost / first.cost,
            )
            row[:] = np.multiply(usual, [np.nanmedian(ratio) for ratio in ratios])
    return made


def best_of(figures: Array) -> list[bool]:
    """Which of (N, 3) are on the Pareto set."""
    kept = np.flatnonzero(np.isfinite(figures).all(axis=1))
    best = {int(kept[k]) for k in pareto(*figures[kept].T, margins=MARGINS)}
    return [k in best for k in range(len(figures))]


def beats(one: Array, other: Array) -> bool:
    """Whether a point (3,) leaves another out of the Pareto set."""
    both = np.array([one, other])
    return bool((one != other).any()) and pareto(*both.T, margins=MARGINS) == [0]
