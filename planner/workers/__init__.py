"""Jobs run by this process, by others on this machine, or by a Dask cluster."""

from .executors import Progress, check_host, executor_of, run_jobs, set_up_worker, sigint_blocked
