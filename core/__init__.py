"""The compiled core: the planner's innermost loops in C, one library for all scenes.

It is built with the package and optional: without it callers run slower and give the same answers.
"""

from .loading import library, threads
from .structures import (
    AXES,
    FRAMES,
    LimitsC,
    LinkageC,
    Measured,
    PathC,
    SamplesC,
    SceneC,
    ThrowC,
    addresses,
)
