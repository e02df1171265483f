"""The result of planning: the plan, its files, and reading them again."""

from .files import PlanPath, SavedThrow, joint_samples, read_plan, write_table
from .plan import Plan, sent_throw, throw_of
from .planned import PlannedThrow
from .target_check import checked_target
