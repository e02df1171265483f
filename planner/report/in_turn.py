"""Work in a process that can be ended: a solver that hangs in compiled code hears no exception."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import Any

#: What a process may take to start [s].
STARTING = 60.0
#: How often it is looked how long a process has worked [s], and how much longer it may take by
#: the clock, where others keep the machine busy.
LOOK, SLOW = 2.0, 10.0
#: How a process can end without an answer, in words.
ENDINGS = {"hang": "no answer in time: process ended", "crash": "its process died"}
#: Processes that share jobs.
LANES = 2
#: Processes are started one at a time: what they inherit is set for that moment.
_starting = threading.Lock()


def shared(
    work: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], patience: float, lanes: int = LANES
) -> Iterator[Any]:
    """As `in_turn`, by several processes at once; the answers in the order of the jobs."""
    queues: list[SimpleQueue[Any]] = [SimpleQueue() for _ in range(lanes)]

    def run(lane: int) -> None:
        try:
            for answer in in_turn(work, jobs[lane::lanes], patience):
                queues[lane].put((answer, None))
        except BaseException as error:
            queues[lane].put((None, error))

    for lane in range(lanes):
        threading.Thread(target=run, args=(lane,), daemon=True).start()
    for number in range(len(jobs)):
        answer, error = queues[number % lanes].get()
        if error is not None:
            raise error
        yield answer


def in_turn(
    work: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], patience: float
) -> Iterator[Any]:
    """work(*job) for each job in one other process; "hang" or "crash" where that gives nothing.

    patience [s]: processor time for one job (ten times as much by the clock, which is all
    that counts where processor times cannot be read); the process is then ended and another
    one goes on.
    """
    left = list(jobs)
    while left:
        # Spawned: forking a process whose libraries have threads is not safe.
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there, work, left), daemon=True)
        with _starting, _one_thread():
            process.start()
        there.close()
        try:
            # The first answer is that it is there: starting is not the job's own time.
            answered = here.poll(patience + STARTING) and here.recv() is None
            while left and answered:
                answer = "hang"
                try:
                    answered = _answers(here, process.pid, patience)
                    if answered:
                        answer = here.recv()
                except EOFError:
                    answer, answered = "crash", False
                left.pop(0)
                yield answer
        finally:
            process.kill()
            process.join()


def _answers(here: Connection, pid: int | None, patience: float) -> bool:
    """Whether an answer comes before the process has worked for `patience` [s]."""
    begun, worked = time.perf_counter(), _processor_time(pid)
    while not here.poll(min(patience, LOOK)):
        now = _processor_time(pid)
        known = now is not None and worked is not None
        if known and now - worked > patience:  # type: ignore[operator]
            return False
        if time.perf_counter() - begun > (SLOW if known else 1.0) * patience:
            return False
    return True


def _processor_time(pid: int | None) -> float | None:
    """Processor time of a process [s]; None where that cannot be read."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return None


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes started here compute with one thread: small matrices are slower with more."""
    name = "OPENBLAS_NUM_THREADS"
    before = os.environ.get(name)
    os.environ[name] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def _work(there: Connection, work: Callable[..., Any], jobs: Sequence[tuple[Any, ...]]) -> None:
    # Hundreds of release tables that nobody needs again stay out of the user's cache.
    os.environ["THROWPLAN_CACHE"] = ""
    there.send(None)
    for job in jobs:
        there.send(work(*job))
