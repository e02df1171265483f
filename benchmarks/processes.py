"""Work spread over processes; those whose work may hang or crash can be ended."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from throwplan.planner.workers import executor_of, leave_signals_to_parent, signals_deferred

T = TypeVar("T")

#: Processes that share jobs.
LANES = 2
#: What `in_processes` yields for a job without an answer, with its cause in words.
ENDINGS = {"hang": "no answer in time: process ended", "crash": "its process died"}


def shared(work: Callable[..., T], *jobs: Iterable[Any], quick: bool) -> Iterator[T]:
    """`work` on each job in order, as `map`, by several processes; by this one if `quick`."""
    with executor_of(1 if quick else LANES, None) as executor:
        yield from (map if executor is None else executor.map)(work, *jobs)


def in_processes(
    work: Callable[..., T], jobs: Sequence[tuple[Any, ...]], patience: float
) -> Iterator[T | str]:
    """work(*job) for each job, in order; "hang" or "crash" where that gives no answer.

    patience [s]: longest time of one job, with the start of its process. The process is then
    ended and another one goes on: a solver that hangs hears no exception. What `work` raises is
    raised here.
    """
    # Each process computes with one thread: small matrices are slower with more.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    waiting, answers = enumerate(jobs), dict[int, tuple[Any, Exception | None]]()
    workers = [_Worker(work) for _ in range(LANES)]
    try:
        for number in range(len(jobs)):
            while number not in answers:
                for worker in workers:
                    if not worker.busy and (following := next(waiting, None)) is not None:
                        worker.begin(*following, time.monotonic() + patience)
                first = min(worker.until for worker in workers)
                pipes = [worker.pipe for worker in workers if worker.pipe is not None]
                wait(pipes, max(first - time.monotonic(), 0.0))
                for worker in workers:
                    answers |= worker.answered()
            found, error = answers.pop(number)
            if error is not None:
                raise error
            yield found
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A process that does one job after the other; started when there is one to do.

    until: when its job is given up, by the monotonic clock [s].
    """

    def __init__(self, work: Callable[..., Any]) -> None:
        self._work, self._number, self.until = work, -1, math.inf
        self._process: BaseProcess | None = None
        self.pipe: Connection | None = None

    @property
    def busy(self) -> bool:
        """Whether it has a job."""
        return self._number >= 0

    def begin(self, number: int, job: tuple[Any, ...], until: float) -> None:
        """Start the job of that number."""
        if self.pipe is None:
            # Spawned: forking a process whose libraries have threads is not safe.
            context = get_context("spawn")
            with signals_deferred():
                self.pipe, theirs = context.Pipe()
                process = context.Process(target=_serve, args=(theirs, self._work), daemon=True)
                process.start()
                self._process = process
                theirs.close()
        self._number, self.until = number, until
        # One that died meanwhile is found when it is asked for its answer.
        with contextlib.suppress(OSError):
            self.pipe.send(job)

    def answered(self) -> dict[int, tuple[Any, Exception | None]]:
        """By its number the job's result or what it raised, once there is one."""
        if self.pipe is None or not self.busy:
            return {}
        ending = "hang" if time.monotonic() > self.until else ""
        answer: tuple[Any, Exception | None] = (ending, None)
        try:
            if self.pipe.poll():
                answer, ending = self.pipe.recv(), ""
            elif not ending:
                return {}
        except (EOFError, OSError):
            answer, ending = ("crash", None), "crash"
        number, self._number, self.until = self._number, -1, math.inf
        if ending:
            self.end()
        return {number: answer}

    def end(self) -> None:
        """End the process, whatever it does."""
        if self._process is not None and self.pipe is not None:
            self._process.kill()
            self._process.join()
            self.pipe.close()
        self._process = self.pipe = None


def _serve(pipe: Connection, work: Callable[..., Any]) -> None:
    """Does jobs in a process of its own until nobody wants more."""
    leave_signals_to_parent()
    # Keeps hundreds of release tables that nobody needs again out of the user's cache.
    os.environ["THROWPLAN_CACHE"] = ""
    answer: tuple[Any, Exception | None]
    with contextlib.suppress(EOFError):
        while True:
            job = pipe.recv()
            try:
                answer = work(*job), None
            except Exception as error:
                answer = None, error
            pipe.send(answer)
