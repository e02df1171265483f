"""Arms as data; planar kinematics, torques, and shapes for collisions."""

from .arm import (
    Arm,
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
from .kinematics import PlanarArm, PlanarDynamics, PlanarHand, flange_velocity, hand_motion
from .spatial import FrameMotion, arm_torques, frame_motions
