"""What planning gives back: the plan, its files, and reading them again."""

from .files import joint_samples, read_plan, sent_throw, write_table
from .plan import Plan, PlannedThrow, Status, checked_target
