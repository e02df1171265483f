"""How near arm, hand and bar come to each other and to what is around them.

Outlines and distances in the throw's plane; arm and bar as capsules among obstacles in 3-D.
"""

from .bodies import LANDING, CollisionScene, KeepOut, bar_ends, obstacles_of, pairs_of
from .distances import (
    BAR,
    Clearance,
    SweptBodies,
    bar_room,
    check_obstacles,
    clearances_of,
    contacts,
    min_clearance,
    overlap,
    swept_bodies,
)
from .geometry import (
    bar_outline,
    column_distance,
    held_bar,
    lowest_of_bar,
    palm_corners,
    palm_distance,
    reach_of_bar,
    tool_speeds,
)
