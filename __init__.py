"""throwplan: plans throws to a landing pose through a model of the release.

import throwplan as tp
plan = tp.plan("cup")
print(plan.status, plan.to_dict()["error"])
"""

from importlib.metadata import PackageNotFoundError, version

from .planner.check import Throw as SentThrow
from .planner.check import simulate, simulate_batch
from .planner.identify import Identified, identify, throw_data, thrown
from .planner.plan import Planner, plan
from .planner.reach import ReachMap, reach_map
from .planner.result import Plan, read_plan
from .planner.robot import Replay, replay
from .planner.sweep import Sweep, sweep
from .problems import (
    InputError,
    Pose,
    Scene,
    ThrowData,
    ThrowplanError,
    load_scene,
    load_throws,
    scene_names,
    scene_text,
)

try:
    __version__ = version("throwplan")
except PackageNotFoundError:  # run from a checkout that is not installed
    __version__ = "0"

__all__ = [
    "Identified",
    "InputError",
    "Plan",
    "Planner",
    "Pose",
    "ReachMap",
    "Replay",
    "Scene",
    "SentThrow",
    "Sweep",
    "ThrowData",
    "ThrowplanError",
    "identify",
    "load_scene",
    "load_throws",
    "plan",
    "reach_map",
    "read_plan",
    "replay",
    "scene_names",
    "scene_text",
    "simulate",
    "simulate_batch",
    "sweep",
    "throw_data",
    "thrown",
]
