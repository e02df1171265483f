"""Arms as data, the planar motion, torques and shapes of what moves in a throw."""

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
from .dynamics import PlanarBody, PlanarDynamics
from .kinematics import PlanarArm, PlanarHand, flange_velocity, hand_motion
