"""A swing under way: its motion is corrected until the gripper is told to open."""

from .joint_lag import Response
from .session import Session, Update, follow
