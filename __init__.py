"""throwplan: plans throws to a landing pose through a model of the release.

import throwplan as tp
plan = tp.plan("cup")
print(plan.status, plan.to_dict()["error"])

A scene is made of the sections of its file, each a class of that name: `tp.Object` is [object],
`tp.Cup` is [cup]; `help(tp.Scene)` lists them. All is in SI units and radians.
"""

from importlib.metadata import PackageNotFoundError, version

from .cycles import Cycle, plan_cycle
from .lab import Calibrated, Identified, calibrate, identify, throw_data, thrown
from .planner.planner import Planner, plan
from .planner.reach import ReachMap, reach_map
from .planner.result import (
    Plan,
    PlanPath,
    SavedThrow,
    SentMotion,
    draw_flight,
    read_motion,
    read_plan,
)
from .planner.show import draw_bars, draw_cup
from .planner.sweep import Sweep, sweep
from .planner.throw import State, simulate, simulate_batch
from .planner.throw import Throw as SentThrow
from .problems import (
    Calibration,
    Choice,
    Cost,
    Cup,
    Distribution,
    Grasp,
    Gripper,
    Hand,
    InputError,
    Landing,
    Mesh,
    Motion,
    Obstacle,
    OutlinePart,
    Pose,
    Region,
    Rest,
    Robot,
    Robust,
    Scene,
    ThrowplanError,
    Tolerance,
    Torque,
    Uncertainty,
    Workspace,
)
from .problems import PadContact as Contact
from .problems import Pose as Target
from .problems import ThrownObject as Object
from .problems.job_files import load_jobs
from .problems.scene_files import load_scene, scene_names, scene_text
from .problems.throws import ThrowData, load_throws
from .robots import Replay, Response, Session, Update, export, follow, replay, view

try:
    __version__ = version("throwplan")
except PackageNotFoundError:  # run from a checkout that is not installed
    __version__ = "0"

__all__ = [
    "Calibrated",
    "Calibration",
    "Choice",
    "Contact",
    "Cost",
    "Cup",
    "Cycle",
    "Distribution",
    "Grasp",
    "Gripper",
    "Hand",
    "Identified",
    "InputError",
    "Landing",
    "Mesh",
    "Motion",
    "Object",
    "Obstacle",
    "OutlinePart",
    "Plan",
    "PlanPath",
    "Planner",
    "Pose",
    "ReachMap",
    "Region",
    "Replay",
    "Response",
    "Rest",
    "Robot",
    "Robust",
    "SavedThrow",
    "Scene",
    "SentMotion",
    "SentThrow",
    "Session",
    "State",
    "Sweep",
    "Target",
    "ThrowData",
    "ThrowplanError",
    "Tolerance",
    "Torque",
    "Uncertainty",
    "Update",
    "Workspace",
    "calibrate",
    "draw_bars",
    "draw_cup",
    "draw_flight",
    "export",
    "follow",
    "identify",
    "load_jobs",
    "load_scene",
    "load_throws",
    "plan",
    "plan_cycle",
    "reach_map",
    "read_motion",
    "read_plan",
    "replay",
    "scene_names",
    "scene_text",
    "simulate",
    "simulate_batch",
    "sweep",
    "throw_data",
    "thrown",
    "view",
]


def __dir__() -> list[str]:
    """What is meant to be used; the rooms behind it are not."""
    return [*__all__, "__version__"]
