"""Motions thrown by the exact models, and what such a throw breaks of its scene.

The promise behind `solved` is kept here: nothing in this room knows how a throw was found.
"""

from .check import Thrown, broken_limits, limit_surface_throw, throw
from .cup_entries import cup_entries, cup_entry, enters_cup_at_landing
from .exact_release import relative_states
from .geometry import (
    bar_outline,
    column_of,
    column_room,
    held_bar,
    lowest_of_bar,
    palm_corners,
    palm_distance,
    reach_of_bar,
)
from .given_motion import given_hand, recorded_joints
from .kernel_code import KernelCode, check_kernels
from .motion import TICK, Motion, PlannedMotion, SampledMotion
from .mover import Limits, Mover, make_mover
from .rollout import Landing, MoverTrack, case_of, friction_use, hand_samples, slip_while_carrying
from .sent import SentThrow
from .simulation import named_model, simulate, simulate_batch
from .smooth import SmoothingError, send
from .violations import (
    CheckedThrow,
    Guard,
    Margin,
    Violation,
    flight_poses,
    outline_kernel,
    throw_violations,
    torque_use,
)

__all__ = [
    "TICK",
    "CheckedThrow",
    "Guard",
    "KernelCode",
    "Landing",
    "Limits",
    "Margin",
    "Motion",
    "Mover",
    "MoverTrack",
    "PlannedMotion",
    "SampledMotion",
    "SentThrow",
    "SmoothingError",
    "Thrown",
    "Violation",
    "bar_outline",
    "broken_limits",
    "case_of",
    "check_kernels",
    "column_of",
    "column_room",
    "cup_entries",
    "cup_entry",
    "enters_cup_at_landing",
    "flight_poses",
    "friction_use",
    "given_hand",
    "hand_samples",
    "held_bar",
    "limit_surface_throw",
    "lowest_of_bar",
    "make_mover",
    "named_model",
    "outline_kernel",
    "palm_corners",
    "palm_distance",
    "reach_of_bar",
    "recorded_joints",
    "relative_states",
    "send",
    "simulate",
    "simulate_batch",
    "slip_while_carrying",
    "throw",
    "throw_violations",
    "torque_use",
]
