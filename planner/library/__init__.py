"""Solved throws all over a scene's reach, stored in the cache and looked up by where they land."""

from .library import Library, Neighbour, Turns, digest_of, landing_errors, nearest_landings
from .records import Records
