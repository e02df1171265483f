"""Motions thrown by the exact models, and what such a throw breaks of its scene.

The promise behind `solved` is kept here: nothing here knows how a throw was found.
"""

from .bodies import LANDING, Around, bar_ends, obstacles_of, pairs_of
from .clearance import (
    BAR,
    Nearness,
    Track,
    check_obstacles,
    contacts,
    least_room,
    nearnesses,
    overlap,
    track_of,
)
from .entry import cup_entries, enters_cup_at_landing
from .geometry import (
    bar_outline,
    column_distance,
    column_of,
    held_bar,
    lowest_of_bar,
    palm_corners,
    palm_distance,
    reach_of_bar,
    tool_speeds,
)
from .given_motion import given_hand, planar_joints, recorded_joints
from .measures import Measured, friction_use
from .mover import Limits, Mover, State, joint_limits, make_mover, outline
from .sending import NO_SAMPLES, TICK, Samples, SmoothingError, braked, broken_limits, keeps, send
from .simulation import Simulation, named_model, simulate, simulate_batch
from .throw import Throw, case_of
from .torques import Torques, torque_limits, torques_of
from .violations import (
    Guard,
    Margin,
    Violation,
    throw_violations,
)
