"""Problem data with their checks: a scene, its sections, and the errors of wrong input.

Scenes are frozen dataclasses in SI units and radians; a section that is None adds nothing. Users'
files are read here, each kind by a module that refuses each mistake with one line (`InputError`):
`scene_files`, and `arms` with grippers; `files` is what all readers and writers use. A room whose
files have sections of their own makes them of `Section`.
"""

from ..models.robot import (
    Arm,
    DHRow,
    JointFrame,
    JointLimits,
    LinkCapsule,
    LinkInertia,
    Tool,
    measured_overlaps,
    placement,
    shape_overlaps,
)
from .arm_files import (
    TABLES,
    GripperCapsule,
    GripperData,
    arm_from,
    arm_table,
    arm_text,
    load_arm,
    load_gripper,
)
from .bins import WALL, Bin
from .calibration import Calibration
from .checks import InputError, Mistakes, ThrowplanError, checked, within
from .constraint import Constraint
from .files import (
    copy_out,
    csv_lines,
    filling,
    plain,
    prepare_folder,
    read_csv,
    read_text,
    shipped,
    shipped_text,
    table_number,
    text_of,
    toml_lines,
    toml_tables,
    write_json,
)
from .grip import Contact, Grasp, Gripper, Object, OutlinePart
from .manipulators import Hand, Motion, Robot, Torque, check_angles
from .poses import Pose, Region, ThrowPlane
from .scene import SECTIONS, TOP_KEYS, Scene, obstacles_besides_bins
from .scene_files import as_scene, load_scene, scene_from_table, scene_names, scene_text
from .section import (
    UNSET,
    Section,
    file_key,
    from_table,
    hints_of,
    meanings,
    optional,
    quantity,
    unknown,
)
from .stl import SAME, Capsule, covered_mesh, distances, small_triangles, stl_bytes
from .targets import Choice, Cost, Cup, Landing, Nlp, Obstacle, Rest, Tolerance, Workspace
from .uncertainty import SHARES, Distribution, Robust, Uncertainty
