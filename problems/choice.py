"""Which of several throws to one target is taken."""

from __future__ import annotations

import dataclasses

from .section import Section, quantity


@dataclasses.dataclass(frozen=True)
class Choice(Section):
    """Selection among throws that differ; without it the first one found is taken.

    by: what the chosen throw has least of: 'effort' (the NLP's cost: acceleration squared
    over time, and carry time), 'time' (from rest to landing) or 'robustness' (how far an
    opening that is early or late moves the landing). among: how many distinct
    throws to look for.
    """

    by: str = quantity(choices=("effort", "time", "robustness"), default="effort")
    among: int = quantity(least=1, most=20, default=4)
