"""The result of planning: the plan, its files, and reading them again."""

from .files import (
    PlanPath,
    SavedThrow,
    check_overwrites,
    complete,
    joint_samples,
    read_plan,
    read_samples,
    write_table,
)
from .plan import Plan, draw_flight, plan_of, sent_throw, throw_of
from .planned_throw import PLAIN, PlannedThrow
