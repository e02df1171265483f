"""Plans and cycles on other systems: played on robots, written for controllers, thrown in MuJoCo.

All read a saved plan or cycle back and check it again, since files can be edited.
"""

from .controller_files import FRANKA_FILES, export, motion_facts, write_motion
from .cycles import CycleReplay, ObjectReplay, cycle_in_space, replay_cycle
from .expectations import Expectations
from .franka import Franka, check_motion, connected
from .franka_run import approach, rehearse, throws
from .gripper import GripperLink, GripperReply, GripperState
from .learning import corrected
from .motions import JointMotion, joint_motion
from .mujoco_replay import Replay, replay, throw_to_rest, view
from .recording import Recording, read_recording
from .watch import find_stops
