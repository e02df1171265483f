"""Which landing poses are in reach: the map, and the growth of a library of throws all over it."""

from .maps import MAP_FILES, MOST, Progress, ReachMap, check_map, reach_map
from .processes import grow
