"""Which landing poses are in reach: the map, and throws solved ahead all over it."""

from .maps import MAP_FILES, MOST, ReachMap, check_map, reach_map
from .preparing import solved
