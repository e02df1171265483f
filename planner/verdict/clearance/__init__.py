"""Clearances of arm, hand and bar to each other and to the bodies around them."""

from .bodies import (
    BAR,
    LANDING,
    Clearance,
    CollisionScene,
    SweptBodies,
    bar_radii,
    check_obstacles,
    hand_pairs,
    overlap,
)
from .in_space import WAITS, SpatialScene
from .outlines import (
    bar_ends,
    bar_outline,
    column_distance,
    grasp_distance,
    held_bar,
    lowest_of_bar,
    palm_corners,
    palm_distance,
    reach_of_bar,
    tool_speeds,
)
