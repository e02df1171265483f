"""What planning gives back: the plan, its files, and reading them again."""

from .files import (
    PlanPath,
    SavedThrow,
    joint_samples,
    read_plan,
    sent_throw,
    throw_of,
    write_table,
)
from .plan import Plan, PlannedThrow, Status
from .wanted import checked_target
