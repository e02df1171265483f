"""Plans on other systems: export for Franka and ROS 2, replay in MuJoCo."""

from .export import joint_motion, option_folder
from .export_franka import FILES, write_franka
from .replay import Replay, Rest, replay
from .replay_runs import load_mujoco

__all__ = [
    "FILES",
    "Replay",
    "Rest",
    "joint_motion",
    "load_mujoco",
    "option_folder",
    "replay",
    "write_franka",
]
