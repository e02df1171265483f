"""How a body leaves the pads: the falling grip force, the release models and their registry.

A model is one file with its law; `MODELS` names it for commands, sweeps and pictures.
"""

from .cases import LOST, BatchRelease, Release, ReleaseBatch, ReleaseCase, chunks
from .grip import GripProfile, LinearGrip, TableGrip
from .integrators import (
    compiled_release,
    exact_pivot_release,
    exact_releases,
    exact_surface_release,
    relative_states,
    rk4_step,
    track_length,
)
from .limit_surface import SteppedRelease
from .published_surface import ImplicitRelease, KarnoppRelease
from .registry import (
    BATCH_MODELS,
    DECIDING,
    MODELS,
    SLIDING_PIVOT,
    STEPPED_SURFACE,
    ReleaseModel,
    own_model,
)
from .shaped_surface import ShapedRelease
from .sliding_pivot import SlidingPivot, SlidingPivotRelease, Widths, soft_positive
