"""Physics of holding, letting go and flying, for numbers, arrays and CasADi symbols alike.

Release models are in the registry `MODELS`; scenes, files and solvers are not known here.
"""

from .body import (
    Array,
    Body,
    Contact,
    Flags,
    FlightState,
    HandMotion,
    HandSamples,
    HandTrack,
    Indices,
    Value,
    com_twist,
    com_wrench,
    contact_twist,
    hand_of,
    land,
    pivot_wrench,
    placement,
    sticking_state,
    time_to_height,
)
from .capsules import ArmCapsules, Solid, about_z, segment_distance
from .dynamics import PlanarDynamics
from .exact import exact_pivot_release, exact_surface_release, relative_states
from .kinematics import (
    Arm,
    DHRow,
    JointFrame,
    JointLimits,
    LinkCapsule,
    LinkInertia,
    PlanarArm,
    PlanarHand,
    Slowing,
    Tool,
    described,
    hand_motion,
)
from .limit_surface import (
    ImplicitRelease,
    KarnoppRelease,
    held_wrench,
    sliding_wrench,
    slip_onset,
)
from .patch import RADIUS_PER_ARM, Patch, PointSolver, SlipProblem, disc
from .patch_release import (
    CREEP,
    PATCH_CHUNK,
    PatchRelease,
    PatchThrows,
    critical_damping,
)
from .path import INSIDE, MovedHand, Path, low_pass
from .registry import (
    BATCH_MODELS,
    DECIDING,
    IDENTIFIED,
    MODELS,
    SLIDING_PIVOT,
    STEPPED_SURFACE,
    VALIDATED,
    ReleaseModel,
)
from .release import (
    BLEW_UP,
    FALL_SHARE,
    LOST,
    LOST_SLIP,
    BatchRelease,
    GripProfile,
    LinearRelease,
    Release,
    ReleaseBatch,
    ReleaseCase,
    TableRelease,
    onset,
)
from .sliding_pivot import (
    PivotSteps,
    SlidingPivot,
    SlidingPivotRelease,
    positive,
    relative_widths,
    soft_positive,
    world_release,
)
from .stepping import (
    Opening,
    march,
    number_symbols,
    numbers,
    rk4_step,
)
from .time_stepping import ITERATIONS, ImpulseProblem, Iterate, LimitSurfaceStepping, SteppedRelease
