"""Arms from URDF files: a serial chain of joints, with limits and masses, as an `Arm`."""

from .arm import (
    LIMIT_OPTIONS,
    STATES,
    Choices,
    arm_of,
    kinematics_difference,
    limits_of,
    link_inertias,
    weak_joints,
)
from .chain import AXES, EXACT, MissingOptionError, UrdfChain, chain_of
from .holding import quantity
from .reading import read_urdf, urdf_file
from .shapes import LinkShapes, link_meshes, link_shapes
