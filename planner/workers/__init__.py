"""Jobs run by this process, by others on this machine, or by a Dask cluster.

Long work is cut into short jobs, so that any executor can share them and Ctrl-C loses none that
is done.
"""

from .executors import executor_of, leave_signals_to_parent, signals_deferred
from .jobs import Progress, run_jobs
