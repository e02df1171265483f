"""Which landing poses are in reach: the map, and throws solved ahead all over it."""

from .preparing import solved
from .reach_map import MAP_FILES, MOST, ReachMap, check_map, reach_map

__all__ = ["MAP_FILES", "MOST", "ReachMap", "check_map", "reach_map", "solved"]
