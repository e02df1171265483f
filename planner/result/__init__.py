"""The result of planning: the plan, its files, and reading them again."""

from .active_limits import CUT_SHORT, ActiveLimit, Bound, binding_words
from .beyond_recommended import allowed, exceeded_entries
from .motion import Carry, SentMotion
from .motion_files import (
    carry_entries,
    is_cycle,
    part_thrown,
    read_motion,
    saved_entries,
    write_motion,
    write_table,
)
from .over_time import PHASES, Timeline, arm_points, timeline
from .plan import Plan, Sendable, Source, plan_of, sent_motion, throw_of
from .plan_files import (
    NEAREST,
    PlanPath,
    SavedThrow,
    check_hits,
    complete,
    joint_samples,
    read_plan,
    read_samples,
)
from .planned_throw import PlannedThrow
from .summary import (
    assumed_words,
    exceeded_lines,
    load_words,
    margins,
    models_words,
    uncertain_words,
    unchecked_words,
)
