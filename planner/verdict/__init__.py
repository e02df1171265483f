"""Verdicts: which limits a throw breaks, whether it is solved, whether it succeeds.

This package alone decides on landing, grip, cup and clearances.
"""

from .batch import Judge, Verdicts, verdicts
from .findings import JOINT_LIMITS, Code, Finding, Verdict
from .landing import lands_well
from .reserves import landing_spread, warnings
from .single import FLYING, collision, held_verdict, outside_tolerance, verdict
from .uncertainty import Sampler, quantile, sampler_of, unit_of, words_of
