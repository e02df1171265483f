"""Work in several processes, which are ended if they hang."""

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

from throwplan.workers import executor_of, set_up_worker, sigint_blocked

T = TypeVar("T")

#: Number of processes that share jobs.
LANES = 2
#: Results of `in_processes` for a job without an answer, with their causes in words.
ENDINGS = {"hang": "no answer in time: process ended", "crash": "its process died"}


def shared(work: Callable[..., T], *jobs: Iterable[Any], quick: bool) -> Iterator[T]:
    """Results of `work` in the order of the jobs, by several processes; by this one if `quick`."""
    with executor_of(1 if quick else LANES, None) as executor:
        yield from (map if executor is None else executor.map)(work, *jobs)


def in_processes(
    work: Callable[..., T], jobs: Sequence[tuple[Any, ...]], patience: float
) -> Iterator[T | str]:
    """work(*job) for each job, in order; "hang" or "crash" for a job without an answer.

    patience [s]: longest time of one job, with the start of its process. After that the process is
    killed, as a solver that hangs ignores exceptions, and another one continues. Exceptions of
    `work` are raised here.
    """
    # One thread in each process, as small matrices are slower with more.
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
    """A process that does one job after the other; the first job starts it.

    until: deadline [s] of its job by the monotonic clock.
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
        """Start job `number`."""
        if self.pipe is None:
            # Spawn, as forking a process whose libraries have threads is not safe.
            context = get_context("spawn")
            with sigint_blocked():
                self.pipe, theirs = context.Pipe()
                process = context.Process(target=_serve, args=(theirs, self._work), daemon=True)
                process.start()
                self._process = process
                theirs.close()
        self._number, self.until = number, until
        # `answered` finds a process that has died.
        with contextlib.suppress(OSError):
            self.pipe.send(job)

    def answered(self) -> dict[int, tuple[Any, Exception | None]]:
        """The finished job's number with its result or exception; empty before that."""
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
        """Kill the process."""
        if self._process is not None and self.pipe is not None:
            self._process.kill()
            self._process.join()
            self.pipe.close()
        self._process = self.pipe = None


def _serve(pipe: Connection, work: Callable[..., Any]) -> None:
    """The process: does jobs until the pipe is closed."""
    set_up_worker()
    # Hundreds of release tables, each used once, stay out of the user's cache.
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
