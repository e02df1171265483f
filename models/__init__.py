"""Physics of holding, letting go and flying, for numbers, arrays and CasADi symbols alike.

Release models are in the registry `MODELS`; scenes, files and solvers are not known here.
"""

from .arm import Arm, DHRow, JointFrame, JointLimits, LinkInertia, Slowing, Tool, placement
from .backend import Value
from .batch import (
    GRADING,
    PIVOT_STEPS,
    SURFACE_STEPS,
    BatchRelease,
    EvenSteps,
    ReleaseBatch,
    by_chunks,
    graded,
    sliding_pivot_batch,
    stepped_batch,
    throw_limit_surface,
    throw_sliding_pivot,
)
from .contact import (
    Body,
    Contact,
    HandMotion,
    com_twist,
    com_wrench,
    contact_acceleration,
    contact_twist,
    pivot_wrench,
)
from .dynamics import PlanarDynamics
from .flight import FlightState, land, time_to_height
from .friction import coulomb, karnopp, viscous_smoothed
from .grip_force import FALL_SHARE, GripProfile, LinearRelease, TableRelease
from .hand import PlanarArm, PlanarHand, hand_motion
from .impulse import ITERATIONS, ImpulseProblem, Iterate
from .integrate import euler_step, rk4_step
from .karnopp_batch import throw_karnopp
from .limit_surface import (
    Ellipsoid,
    LimitSurface,
    Quartic,
    ellipsoid,
    rotated_ellipsoid,
    slip_size,
    smoothed_sliding_wrench,
)
from .limit_surface_release import ImplicitRelease, KarnoppRelease
from .lugre_release import LuGreRelease, critical_damping
from .overhang import OverhangingBeam
from .patch import RADIUS_PER_ARM, Patch, PointSolver, SlipProblem, disc, scaled_patch
from .patch_gauge import patch_gauge
from .patch_release import (
    CREEP,
    PATCH_CHUNK,
    PatchRelease,
    PatchThrows,
    march_patch,
    patch_batch,
    single_release,
)
from .path import MovedHand, Path, Throws, low_pass
from .release import (
    LOST,
    UNSOLVED,
    HandSamples,
    HandTrack,
    Release,
    ReleaseCase,
    ReleaseModel,
    onset,
    sticking_state,
)
from .sliding_pivot import LOST_SLIP, STATES, SlidingPivot
from .sliding_pivot_release import SlidingPivotRelease, number_symbols, numbers, world_release
from .slip_onset import held_wrench, slip_onset, surface_gauge
from .smoothing import positive, relative_widths, soft_positive
from .time_stepping import HandState, LimitSurfaceStepping
from .time_stepping_release import SteppedRelease

__all__ = [
    "CREEP",
    "FALL_SHARE",
    "GRADING",
    "ITERATIONS",
    "LOST",
    "LOST_SLIP",
    "PATCH_CHUNK",
    "PIVOT_STEPS",
    "RADIUS_PER_ARM",
    "STATES",
    "SURFACE_STEPS",
    "UNSOLVED",
    "Arm",
    "BatchRelease",
    "Body",
    "Contact",
    "DHRow",
    "Ellipsoid",
    "EvenSteps",
    "FlightState",
    "GripProfile",
    "HandMotion",
    "HandSamples",
    "HandState",
    "HandTrack",
    "ImplicitRelease",
    "ImpulseProblem",
    "Iterate",
    "JointFrame",
    "JointLimits",
    "KarnoppRelease",
    "LimitSurface",
    "LimitSurfaceStepping",
    "LinearRelease",
    "LinkInertia",
    "LuGreRelease",
    "MovedHand",
    "OverhangingBeam",
    "Patch",
    "PatchRelease",
    "PatchThrows",
    "Path",
    "PlanarArm",
    "PlanarDynamics",
    "PlanarHand",
    "PointSolver",
    "Quartic",
    "Release",
    "ReleaseBatch",
    "ReleaseCase",
    "ReleaseModel",
    "SlidingPivot",
    "SlidingPivotRelease",
    "SlipProblem",
    "Slowing",
    "SteppedRelease",
    "TableRelease",
    "Throws",
    "Tool",
    "Value",
    "by_chunks",
    "com_twist",
    "com_wrench",
    "contact_acceleration",
    "contact_twist",
    "coulomb",
    "critical_damping",
    "disc",
    "ellipsoid",
    "euler_step",
    "graded",
    "hand_motion",
    "held_wrench",
    "karnopp",
    "land",
    "low_pass",
    "march_patch",
    "number_symbols",
    "numbers",
    "onset",
    "patch_batch",
    "patch_gauge",
    "pivot_wrench",
    "placement",
    "positive",
    "relative_widths",
    "rk4_step",
    "rotated_ellipsoid",
    "scaled_patch",
    "single_release",
    "sliding_pivot_batch",
    "slip_onset",
    "slip_size",
    "smoothed_sliding_wrench",
    "soft_positive",
    "stepped_batch",
    "sticking_state",
    "surface_gauge",
    "throw_karnopp",
    "throw_limit_surface",
    "throw_sliding_pivot",
    "time_to_height",
    "viscous_smoothed",
    "world_release",
]
