"""What is wanted, as data with its checks: scenes, arms and measured throws, and their files.

Everything a user writes is read here, and refused with one line where it is wrong (`InputError`).
Scenes are frozen dataclasses in SI units and radians; a section that is None adds nothing.
"""

from .arms import arm_from, arm_text, load_arm
from .files import (
    copy_out,
    filling,
    plain,
    prepare_folder,
    read_csv,
    read_text,
    toml_lines,
    toml_tables,
    write_json,
)
from .grip import Grasp, Gripper, PadContact, ThrownObject, grip_samples, monotone_grip
from .movers import Hand, Motion, Robot, Torque
from .obstacles import Obstacle
from .scene import Mesh, Scene
from .section import InputError, ThrowplanError, checked, hint_at
from .targets import Choice, Cup, Landing, Pose, ThrowPlane, Tolerance, Workspace
from .throws import THROW_DATA_FILES, MeasuredThrow, Shared, ThrowData, load_throws, write_throws
from .toml import (
    as_scene,
    load_scene,
    scene_from_table,
    scene_names,
    scene_reference,
    scene_table,
    scene_text,
)
from .uncertainty import (
    COMPARED_METHODS,
    QUIET,
    ROBUST_METHODS,
    UNCERTAIN_PARAMETERS,
    USUAL_UNCERTAINTY,
    Distribution,
    Robust,
    Uncertainty,
    correlation_matrix,
    file_key,
    uncertainty_table,
)
