"""The compiled core: the planner's innermost loops in C, one library for all scenes.

It is built with the package and optional: without it callers run slower and give the same answers.
"""

from .loading import library, threads
from .structures import (
    AXES,
    FRAMES,
    GripC,
    LimitsC,
    LinkageC,
    Measured,
    PathC,
    ReleaseC,
    SamplesC,
    SceneC,
    ThrowC,
    address,
)
