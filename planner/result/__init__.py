"""The result of planning: the plan, its files, and reading them again."""

from .files import PlanPath, SavedThrow, joint_samples, read_plan, write_table
from .plan import Plan, PlannedThrow, sent_throw, throw_of
