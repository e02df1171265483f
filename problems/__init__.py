"""Problem data with their checks: scenes, arms and measured throws, and their files.

This package reads all files of users and refuses each mistake with one line (`InputError`). Scenes
are frozen dataclasses in SI units and radians; a section that is None adds nothing. `files` reads
and writes, `throws` has measured throws, `job_files` picks and bins, `urdf` makes arms from robots'
files.
"""

from .arms import GripperData, load_arm
from .calibration import Calibration
from .checks import InputError, ThrowplanError, check_arguments, checked
from .grip import Grasp, Gripper, OutlinePart, PadContact, ThrownObject
from .job_files import Bin, Jobs, Pick, jobs_names, jobs_text, load_jobs
from .manipulators import Hand, Motion, Robot, Torque
from .poses import MANY_TURNS, Pose, Region, ThrowPlane
from .scene import Scene
from .scene_files import as_scene, load_scene, scene_from_table, scene_names, scene_text
from .targets import Choice, Cost, Cup, Landing, Mesh, Obstacle, Rest, Tolerance, Workspace
from .uncertainty import Distribution, Robust, Uncertainty
