"""Work in a process that can be ended: a solver that hangs in compiled code hears no exception."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

#: What a process may take to start [s].
STARTING = 60.0
#: How a process can end without an answer, in words.
ENDINGS = {"hang": "no answer in time: process ended", "crash": "its process died"}


def in_turn(
    work: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], patience: float
) -> Iterator[Any]:
    """work(*job) for each job in one other process; "hang" or "crash" where that gives nothing.

    patience [s]: for one job; the process is then ended and another one goes on.
    """
    left = list(jobs)
    while left:
        # Spawned: forking a process whose libraries have threads is not safe.
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there, work, left), daemon=True)
        with _one_thread():
            process.start()
        there.close()
        try:
            # The first answer is that it is there: starting is not the job's own time.
            answered = here.poll(patience + STARTING) and here.recv() is None
            while left and answered:
                answer = "hang"
                try:
                    answered = here.poll(patience)
                    if answered:
                        answer = here.recv()
                except EOFError:
                    answer, answered = "crash", False
                left.pop(0)
                yield answer
        finally:
            process.kill()
            process.join()


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
