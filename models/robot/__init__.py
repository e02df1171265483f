"""Arms as data; kinematics and torques in the plane and in space, and shapes for collisions."""

from .arm import (
    Arm,
    CapsuleOverlap,
    DHRow,
    JointFrame,
    JointLimits,
    LinkCapsule,
    LinkInertia,
    Slowing,
    Tool,
    described,
    placement,
)
from .capsules import ArmCapsules, Solid, about_z, segment_distance
from .in_space import PadMotion, SpatialArm
from .kinematics import PlanarArm, PlanarDynamics, PlanarHand, flange_velocity, hand_motion
from .overlaps import measured_overlaps, shape_overlaps
