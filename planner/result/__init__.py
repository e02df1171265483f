"""What planning gives back: the plan, its files, and reading them again."""

from .files import PlanPath, SavedThrow, joint_samples, read_plan, write_table
from .plan import Plan, sent_throw, throw_of
from .planned import PlannedThrow
from .wanted import checked_target
