"""Jobs run by this process, by others on this machine, or by a Dask cluster.

Long work is cut into short jobs: any executor can share them, and Ctrl-C loses no finished job.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import os
import re
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent import futures
from concurrent.futures import Executor, Future
from multiprocessing import get_context, parent_process
from typing import TypeVar

from .interrupts import interrupts_deferred
from .problems import InputError

T = TypeVar("T")
#: progress(done, total) is called while work goes on.
Progress = Callable[[int, int], None]

#: Most unfinished jobs of an executor.
WINDOW = 64
#: Largest number of processes on this machine.
MOST = 256
#: Time limit [s] for a scheduler's answer, and for its first worker.
PATIENCE = 5.0


@contextlib.contextmanager
def sigint_blocked() -> Iterator[None]:
    """Ctrl-C is for this process only, not for processes that are started in the block."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def set_up_worker() -> None:
    """In a worker process: its parent handles Ctrl-C; the parent's end ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Python's own worker waits forever for the next job of a parent that was killed."""
    if (parent := parent_process()) is not None:
        parent.join()
        os._exit(1)


@contextlib.contextmanager
def executor_of(workers: int | None, scheduler: str | None) -> Iterator[Executor | None]:
    """The executor of the options, None for this process.

    InputError for options that exclude each other or are out of range, for a missing cluster, and
    for failures on workers.
    """
    if workers is not None and not 1 <= workers <= MOST:
        raise InputError(f"--workers {workers}: must be a whole number, 1 to {MOST}")
    if workers is not None and scheduler is not None:
        raise InputError("--workers and --scheduler: give one of them")
    if scheduler is not None:
        with _cluster(scheduler) as executor:
            yield executor
    elif workers is not None and workers > 1:
        with _processes(workers) as executor:
            yield executor
    else:
        yield None


@contextlib.contextmanager
def _processes(count: int) -> Iterator[Executor]:
    # Spawn, as forking a process whose libraries have threads is not safe. One thread each, as
    # small matrices are slower with more.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        with futures.ProcessPoolExecutor(count, get_context("spawn"), set_up_worker) as pool:
            with sigint_blocked():  # Each of the first jobs starts a process.
                for _ in range(count):
                    pool.submit(os.getpid)
            yield pool
    except futures.BrokenExecutor:
        raise InputError(f"one of {count} worker processes died: out of memory?") from None


@contextlib.contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    """The executor of a Dask client; its errors are those of the address, network or cluster."""
    place = f"--scheduler {address}"
    try:
        import distributed
    except ImportError:
        raise InputError(f"{place}: needs Dask: pip install distributed") from None
    # distributed logs each failed connection, with a traceback.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    tls = distributed.Security().get_connection_args("client").get("ssl_context")
    if address.startswith("tls:") and tls is None:
        raise InputError(f"{place}: needs certificates: distributed.comm.tls of Dask's settings")
    client, failure = None, ""
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:
        failure = _line(error)
    if client is None:
        # Ends the failed client's thread here: while another client starts, it would wait forever.
        gc.collect()
        raise InputError(f"{place}: {failure}")
    lost = (distributed.KilledWorker, distributed.comm.CommClosedError, futures.CancelledError)
    try:
        # Not pure: the cluster must not return an earlier result.
        with client, client.get_executor(pure=False) as executor:
            client.wait_for_workers(1, timeout=PATIENCE)
            yield executor
    except (*lost, ImportError, TimeoutError) as error:
        raise InputError(f"{place}: {_line(error)}") from None


def _line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def check_host(place: str, host: str) -> None:
    """InputError, naming `place`, unless `host` may be a machine's name or address."""
    with contextlib.suppress(UnicodeError):
        host.encode("idna")  # As sockets do.
        if re.fullmatch(r"[^\s\0]+", host):
            return
    raise InputError(f"{place}: must be the name or the address of a machine")


def run_jobs(
    next_job: Callable[[], Callable[[], T] | None],
    executor: Executor | None,
    keep: Callable[[T], None],
) -> None:
    """Runs jobs until the last is done; `keep` takes each result.

    next_job: the next job or None; it is called again after each result. A job for an executor must
    be picklable. After an error or Ctrl-C waiting jobs are dropped.
    """
    if executor is None:
        while (job := next_job()) is not None:
            with interrupts_deferred():
                keep(job())
        return
    running: set[Future[T]] = set()
    try:
        while True:
            while len(running) < WINDOW and (job := next_job()) is not None:
                running.add(executor.submit(job))
            if not running:
                return
            for future in futures.wait(running, return_when=futures.FIRST_COMPLETED).done:
                running.remove(future)
                keep(future.result())
    finally:
        for future in running:
            future.cancel()
