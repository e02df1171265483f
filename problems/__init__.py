"""Problem data with their checks: a scene, its sections, and the errors of wrong input.

Scenes are frozen dataclasses in SI units and radians; a section that is None adds nothing. Users'
files are read here only, each kind by a module that refuses each mistake with one line
(`InputError`): `scene_files`; `job_files` with picks and bins; `arms` with grippers; `throws`,
measured ones; `urdf` and `meshes`, of which arms and objects are made. `files` is what they read
and write with.
"""

from .calibration import Calibration
from .checks import InputError, ThrowplanError, checked
from .grip import Grasp, Gripper, OutlinePart, PadContact, ThrownObject
from .manipulators import Hand, Motion, Robot, Torque
from .poses import Pose, Region, ThrowPlane
from .scene import Scene
from .targets import Choice, Cost, Cup, Landing, Mesh, Obstacle, Rest, Tolerance, Workspace
from .uncertainty import Distribution, Robust, Uncertainty
