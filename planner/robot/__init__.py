"""Plans on other systems: written for robot controllers, and thrown again in MuJoCo.

Both read a saved plan back (`read_plan`) and check it again, since files can be edited.
"""

from .controllers import (
    FRANKA_FILES,
    OPEN_WIDTH,
    ROS_FILES,
    joint_motion,
    joint_names,
    ros_typestore,
    write_franka,
    write_ros,
)
from .mujoco_replay import Replay, replay
from .mujoco_throw import Rest, load_mujoco
