"""Which landing poses are in reach: the map, and the growth of a library of throws all over it."""

from .growing import default_workers, grow
from .maps import MAP_FILES, MOST, ReachMap, check_map, reach_map
