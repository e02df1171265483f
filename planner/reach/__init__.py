"""The reach of a scene: the map of landing poses, and the building of a library all over it."""

from .library_growth import default_workers, grow
from .map_samples import MOST, check_map, reach_map
from .maps import MAP_FILES, ReachMap
