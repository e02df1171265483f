"""Arms and objects of one's own, and sent motions on robots: played, written for controllers,
corrected by recordings, and followed while the target moves.

All read a saved plan or cycle back and check it again, since files can be edited.
"""

from .commands import COMMANDS
from .controller_files import export
from .expectations import Expectations
from .following import Response, Session, Update, follow
from .franka import Franka, approach, check_motion, connected, find_stops, rehearse, throws
from .gripper import GripperLink, GripperReply, GripperState
from .learning import corrected
from .motions import commands_of, joint_motion
from .recording import Recording, read_recording
