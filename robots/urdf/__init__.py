"""An arm from a URDF file: a serial chain of joints, with limits and masses, as an `Arm`.

Needs the extra `urdf`.
"""

from .command import COMMANDS
