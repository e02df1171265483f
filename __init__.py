"""throwplan: plans throws to a landing pose through a model of the release.

import throwplan as tp
plan = tp.plan("cup")
print(plan.status, plan.to_dict()["error"])

A scene is made of the sections of its file, each a class of that name: `tp.Object` is [object],
`tp.Cup` is [cup]; `help(tp.Scene)` lists them. All is in SI units and radians. More is in
`throwplan.pictures`, `.robots`, `.lab`, `.cycles` and `.models`, each imported by itself.
"""

from importlib.metadata import PackageNotFoundError, version

from .planner import (
    Plan,
    Planner,
    ReachMap,
    SentMotion,
    State,
    Sweep,
    Throw,
    plan,
    reach_map,
    read_motion,
    read_plan,
    simulate,
    simulate_batch,
)
from .planner.sweep import sweep
from .problems import (
    Bin,
    Calibration,
    Choice,
    Constraint,
    Contact,
    Cost,
    Cup,
    Distribution,
    Grasp,
    Gripper,
    Hand,
    InputError,
    Landing,
    Motion,
    Nlp,
    Object,
    Obstacle,
    OutlinePart,
    Pose,
    Region,
    Rest,
    Robot,
    Robust,
    Scene,
    Tolerance,
    Torque,
    Uncertainty,
    Workspace,
    load_scene,
    scene_names,
    scene_text,
)

try:
    __version__ = version("throwplan")
except PackageNotFoundError:  # run from a checkout that is not installed
    __version__ = "0"

__all__ = [
    "Bin",
    "Calibration",
    "Choice",
    "Constraint",
    "Contact",
    "Cost",
    "Cup",
    "Distribution",
    "Grasp",
    "Gripper",
    "Hand",
    "InputError",
    "Landing",
    "Motion",
    "Nlp",
    "Object",
    "Obstacle",
    "OutlinePart",
    "Plan",
    "Planner",
    "Pose",
    "ReachMap",
    "Region",
    "Rest",
    "Robot",
    "Robust",
    "Scene",
    "SentMotion",
    "State",
    "Sweep",
    "Throw",
    "Tolerance",
    "Torque",
    "Uncertainty",
    "Workspace",
    "load_scene",
    "plan",
    "reach_map",
    "read_motion",
    "read_plan",
    "scene_names",
    "scene_text",
    "simulate",
    "simulate_batch",
    "sweep",
]


def __dir__() -> list[str]:
    """What is meant to be used; the rooms behind it are not."""
    return [*__all__, "__version__"]
