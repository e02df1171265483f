"""Numerical settings of the NLP."""

from __future__ import annotations

import dataclasses

from .section import Section, quantity


@dataclasses.dataclass(frozen=True)
class Mesh(Section):
    """Numerical settings of the NLP.

    carry and opening: shooting intervals of the phases; grading: above 1 the opening's
    intervals shrink towards its end, where the object slides; integrator of the opening:
    'gauss' (two-point collocation) or 'rk4' with `substeps` steps per interval;
    epsilon: relative rounding width of the friction laws;
    sticking_margin: share of the full grip's friction limit kept free while carrying;
    carry_max [s]: longest carry.
    """

    carry: int = quantity(least=3, most=60, default=6)
    opening: int = quantity(least=2, most=60, default=6)
    grading: float = quantity(least=1, most=4, default=2.0)
    integrator: str = quantity(choices=("gauss", "rk4"), default="gauss")
    substeps: int = quantity(least=1, most=20, default=2)
    epsilon: float = quantity(above=0, most=1, default=0.02)
    sticking_margin: float = quantity(least=0, below=1, default=0.05)
    carry_max: float = quantity(above=0, default=2.0)
