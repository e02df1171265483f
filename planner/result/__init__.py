"""The result of planning: the plan, its files, and reading them again."""

from .files import (
    PlanPath,
    SavedThrow,
    check_overwrites,
    joint_samples,
    read_plan,
    write_table,
)
from .plan import Plan, draw_flight, plan_of, sent_throw, throw_of
from .planned_throw import PlannedThrow
