"""A plan under uncertainty: sweeps of throws with sampled parameters, and robust plans.

An executor may spread chunks of throws over processes and machines without any change of the
result.
"""

from .choice import choose
from .rest_plans import check_rest, resting
from .results import SWEEP_FILES, Sweep
from .robust_plans import ROBUST_NLP, Hardening, hardened, robust_scene
from .running import check_sweep, sweep
from .statistics import OUTER, delay_band, quantiles, tornado, variance_shares
from .summary import unit_of
