"""An object from a closed mesh: mass, CoM and inertia, and its outline as capsules.

Needs trimesh (extra `objects`).
"""

from .command import COMMANDS
