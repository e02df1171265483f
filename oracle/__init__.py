"""An independent judge of throws: plain NumPy, written from the equations, not from the planner.

It reads scenes as data and a plan's files (plan.json, motion.csv), and nothing of
`throwplan.planner`, `throwplan.core` or the physics of `throwplan.models`.

    oracle = oracle_of(plan)  # or read_oracle(folder), after plan.save(folder)
    oracle.judge(planned=True).found["grip"]  # value, limit, room
    rows, found = read_rows(folder)  # of sweep.save(folder / "sweep")
    oracle.judge(rows).success
    broken_limits(folder)  # what a saved cycle breaks, in words
"""

from .clearance import Found
from .cycles import broken_limits, gap_to_waiting
from .files import oracle_of, read_oracle, read_rows
from .judge import Oracle
from .release import STEPS
