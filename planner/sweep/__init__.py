"""Many throws of one plan under uncertainty: samples, statistics, sensitivities.

Chunks of them may be spread over processes and machines; the result is the same to the bit.
"""

from .running import SWEEP_FILES, Sweep, check_sweep, sweep, sweep_until_stopped
from .statistics import scaled_error
from .workers import executor_of
