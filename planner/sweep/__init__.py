"""Many throws of one plan under uncertainty: samples, statistics, sensitivities."""

from .sweep import Sweep, check_sweep, sweep, sweep_until_stopped
from .sweep_files import FILES
from .sweep_statistics import scaled_error
from .sweep_units import unit_of
from .workers import executor_of

__all__ = [
    "FILES",
    "Sweep",
    "check_sweep",
    "executor_of",
    "scaled_error",
    "sweep",
    "sweep_until_stopped",
    "unit_of",
]
