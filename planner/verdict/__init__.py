"""Verdicts: which limits a throw breaks, whether it is solved, whether it succeeds.

This package alone decides on landing, grip, cup, bin and clearances.
"""

from .calibrated import CalibratedLanding, calibrated_landing, region_words
from .clearance import (
    BAR,
    LANDING,
    Clearance,
    CollisionScene,
    SpatialScene,
    SweptBodies,
    bar_outline,
    bar_radii,
    check_obstacles,
    column_distance,
    grasp_distance,
    hand_pairs,
    held_bar,
    lowest_of_bar,
    overlap,
    palm_corners,
    palm_distance,
    reach_of_bar,
    tool_speeds,
)
from .findings import INTO, JOINT_LIMITS, Code, Finding, Verdict
from .grip_in_space import grip_use
from .in_space import (
    approach_findings,
    first_finding,
    flight_findings,
    flight_gaps,
    motion_verdict,
    obstacles_hit,
)
from .landing import lands_well
from .measures import Measures, measures_of
from .motion import FLYING, collision, held_verdict
from .verdicts import Judge, Verdicts, is_as_successful, outside_tolerance, verdict_on
