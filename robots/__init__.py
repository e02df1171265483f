"""Sent motions on other systems: played on robots, written for controllers, thrown in MuJoCo.

All read a saved plan or cycle back and check it again, since files can be edited.
"""

from .controller_files import FRANKA_FILES, export, motion_facts, write_motion
from .expectations import Expectations
from .franka import Franka, check_motion, connected
from .franka_run import approach, rehearse, throws
from .gripper import GripperLink, GripperReply, GripperState
from .learning import corrected
from .motions import arm_of, commands_of, joint_motion
from .mujoco_replay import ObjectReplay, Replay, replay
from .recording import Recording, read_recording
from .swings import Response, Session, Update, follow
from .viewing import motion_to_rest, view
from .watch import find_stops
