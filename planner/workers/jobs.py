"""Short jobs shared by an executor: Ctrl-C loses none that is done."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import TypeVar

T = TypeVar("T")
#: progress(done, total) is called while work goes on.
Progress = Callable[[int, int], None]

#: Jobs that an executor is given before the first of them is done.
WINDOW = 64


def run_jobs(
    next_job: Callable[[], Callable[[], T] | None],
    executor: Executor | None,
    keep: Callable[[T], None],
) -> None:
    """Runs jobs until there is none left and none running; `keep` takes each result.

    next_job: the next job, or None while there is none; it is called again after each result. A job
    for an executor must be picklable. After Ctrl-C running jobs are finished and kept, the others
    dropped, and KeyboardInterrupt is raised.
    """
    if executor is None:
        while (job := next_job()) is not None:
            keep(job())
        return
    running: set[Future[T]] = set()
    try:
        while True:
            while len(running) < WINDOW and (job := next_job()) is not None:
                running.add(executor.submit(job))
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                running.remove(future)
                keep(future.result())
    except KeyboardInterrupt:
        for future in wait([future for future in running if not future.cancel()]).done:
            keep(future.result())
        raise
    except BaseException:
        for future in running:
            future.cancel()
        raise
