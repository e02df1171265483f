"""Whether a plan bears its scene's uncertainty: a small sweep of what is sent."""

from __future__ import annotations

import numpy as np

from .plan import Plan

#: Throws of the small sweep.
SAMPLES = 256


def spread(plan: Plan) -> float:
    """95 % quantile [m] of the scaled error about the plan's own landing."""
    from .sweep import sweep

    return float(np.quantile(sweep(plan, samples=SAMPLES).errors["scaled"], 0.95))


def quiet_enough(plan: Plan) -> bool:
    """Whether that is inside the scene's tolerance, position and angle taken together."""
    scene = plan.scene
    allowed = scene.tolerance.position + scene.tolerance.angle * scene.object.length / 2
    return spread(plan) <= allowed
