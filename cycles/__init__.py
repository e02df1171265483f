"""Many picks and bins as one motion in the least time: throws, their order, what joins them; joints
of hand poses."""

from .commands import COMMANDS
from .connections import joined, lifted_pose, raised_pose, standstill
from .cycle import CYCLE_FILES, Cycle, UnsolvedError
from .inverse_kinematics import HandPose, inverse_kinematics
from .job_files import Jobs, jobs_names, jobs_text, load_jobs
from .planning import plan_cycle
