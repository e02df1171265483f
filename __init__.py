"""throwplan: plans throws to a landing pose through a model of the release.

import throwplan as tp
plan = tp.plan("cup")
print(plan.status, plan.to_dict()["error"])
"""

from importlib.metadata import PackageNotFoundError, version

from .planner.api import plan, simulate
from .planner.identification.identify_run import Identified, identify
from .planner.identification.learn import throw_data, thrown
from .planner.plan import Plan
from .planner.planner import Planner
from .planner.reach_map import ReachMap, reach_map
from .planner.replay import Replay, replay
from .planner.sent import SentThrow, read_plan
from .planner.simulate_batch import simulate_batch
from .planner.sweep import Sweep, sweep
from .problems.errors import InputError, ThrowplanError
from .problems.load import load_scene, scene_names, scene_text
from .problems.scene import Pose, Scene
from .problems.throw_data import ThrowData, load_throws

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
