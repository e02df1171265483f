"""Many picks and bins as one motion in the least time: throws, their order, what joins them."""

from .cycle import Cycle, Step
from .files import CYCLE_FILES, gripper_commands, read_cycle, save_cycle
from .planning import plan_cycle
