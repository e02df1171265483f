"""One plan under uncertainty: thrown many times with sampled parameters, and made to bear it.

Chunks of throws may be spread over processes and machines; the result is the same to the bit.
"""

from .hardening import QUIET_MESH, Hardening, hardened, robust_scene
from .results import SWEEP_FILES, Sweep
from .running import check_sweep, sweep, sweep_until_stopped
