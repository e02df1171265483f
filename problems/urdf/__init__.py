"""Arms from URDF files."""

from .arm import EXACT, LIMIT_OPTIONS, STATES, Choices, arm_of, kinematics_difference, limits_of
from .file import UrdfChain, chain_of, read_urdf
from .frames import AXES
from .masses import held_joints

__all__ = [
    "AXES",
    "EXACT",
    "LIMIT_OPTIONS",
    "STATES",
    "Choices",
    "UrdfChain",
    "arm_of",
    "chain_of",
    "held_joints",
    "kinematics_difference",
    "limits_of",
    "read_urdf",
]
