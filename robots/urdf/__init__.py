"""An arm from a URDF file: a serial chain of joints, with limits and masses, as an `Arm`.

Needs the extra `urdf`.
"""

from .arm import kinematics_difference, limits_of, link_inertias
from .chain import chain_of
from .command import COMMANDS
from .reading import read_urdf
from .shapes import link_meshes
