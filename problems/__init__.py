"""What is wanted: scenes as data, with their checks."""

from .arm_file import arm_from, load_arm
from .arm_text import arm_text
from .choice import Choice
from .distribution import Distribution
from .errors import InputError, ThrowplanError
from .folders import copy_out, filling, prepare_folder, save_text
from .grip_recording import monotone_grip
from .hold import Grasp, Gripper, PadContact, ThrownObject
from .load import as_scene, load_scene, scene_names, scene_text
from .mesh import Mesh
from .movers import Hand, Motion, Robot
from .reference import reference as scene_reference
from .robust import COMPARED as COMPARED_METHODS
from .robust import METHODS as ROBUST_METHODS
from .robust import Robust
from .scene import Scene
from .scene_table import scene_from_table, scene_table
from .surroundings import Cup, Workspace
from .target import Landing, Pose, Tolerance
from .text_file import read_csv, read_text, toml_tables
from .throw_data import MeasuredThrow, Shared, ThrowData, load_throws
from .throw_data_files import NAMES as THROW_DATA_FILES
from .throw_data_files import write_throws
from .torque import Torque
from .uncertainty import PARAMETERS as UNCERTAIN_PARAMETERS
from .uncertainty import USUAL as USUAL_UNCERTAINTY
from .uncertainty import Uncertainty, file_key, uncertainty_table

__all__ = [
    "COMPARED_METHODS",
    "ROBUST_METHODS",
    "THROW_DATA_FILES",
    "UNCERTAIN_PARAMETERS",
    "USUAL_UNCERTAINTY",
    "Choice",
    "Cup",
    "Distribution",
    "Grasp",
    "Gripper",
    "Hand",
    "InputError",
    "Landing",
    "MeasuredThrow",
    "Mesh",
    "Motion",
    "PadContact",
    "Pose",
    "Robot",
    "Robust",
    "Scene",
    "Shared",
    "ThrowData",
    "ThrownObject",
    "ThrowplanError",
    "Tolerance",
    "Torque",
    "Uncertainty",
    "Workspace",
    "arm_from",
    "arm_text",
    "as_scene",
    "copy_out",
    "file_key",
    "filling",
    "load_arm",
    "load_scene",
    "load_throws",
    "monotone_grip",
    "prepare_folder",
    "read_csv",
    "read_text",
    "save_text",
    "scene_from_table",
    "scene_names",
    "scene_reference",
    "scene_table",
    "scene_text",
    "toml_tables",
    "uncertainty_table",
    "write_throws",
]
