"""Who does long work: this process, others on this machine, or a Dask cluster.

A sweep's throws are made in chunks, so that they are spread and can be stopped at any time.
"""

from __future__ import annotations

import itertools
import re
import signal
import socket
import struct
from collections.abc import Callable, Iterator
from concurrent import futures
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context

import numpy as np

from ...models import MODELS, Array, Indices
from ...problems import InputError
from .samples import Sampler
from .throws import Outcomes, Thrower

#: Numbers (N,) of samples in the sequence, their parameters (N, P), and what came of them.
Thrown = tuple[Indices, Array, Outcomes]
#: Told how many samples are done, of how many.
Progress = Callable[[int, int], None]

#: Chunks handed out at once.
WINDOW = 64
#: Most processes here.
MOST = 256
#: A scheduler must answer in this time, and have a worker [s].
PATIENCE = 5.0


@contextmanager
def executor_of(workers: int | None, scheduler: str | None) -> Iterator[Executor | None]:
    """The executor that the options ask for, None for this process.

    InputError for options that do not go together or are out of range, where there is no
    such cluster, and for what goes wrong on workers.
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


@contextmanager
def _processes(count: int) -> Iterator[Executor]:
    # Spawned: forking a process whose libraries have threads is not safe.
    # Taken from the module here, since it takes 15 ms to import.
    pool = futures.ProcessPoolExecutor(count, get_context("spawn"), _leave_ctrl_c_to_the_parent)
    try:
        with pool:
            yield pool
    except BrokenExecutor:
        raise InputError(f"one of {count} worker processes died: out of memory?") from None


def _leave_ctrl_c_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    place = f"--scheduler {address}"
    _check_scheduler(address, place)
    try:
        import distributed
    except ImportError:
        raise InputError(f"{place}: needs Dask: pip install distributed") from None
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"{place}: {_line(error)}") from None
    # What can go wrong with a cluster, and with what is installed on it.
    failures = (distributed.KilledWorker, ImportError, OSError, CancelledError)
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        # Not pure: every sweep is thrown, whatever the cluster remembers. Tasks of a worker
        # that is lost are done again by others.
        with client.get_executor(pure=False) as executor:
            yield executor
    except TimeoutError:
        raise InputError(f"{place}: the scheduler has no workers") from None
    except failures as error:
        raise InputError(f"{place}: work failed there: {_line(error)}") from None
    finally:
        client.close(timeout=PATIENCE)


def _check_scheduler(address: str, place: str) -> None:
    """InputError unless something like a Dask scheduler answers there.

    Dask's own client waits long for other servers, and for names that do not exist.
    """
    found = re.fullmatch(r"(?:(tcp|tls)://)?(\[.+\]|[^/:]+):(\d{1,5})", address)
    if found is None:
        raise InputError(f"{place}: must be like tcp://host:8786")
    scheme, host, port = found[1], found[2].strip("[]"), int(found[3])
    try:
        with socket.create_connection((host, port), PATIENCE) as connection:
            if scheme == "tls":
                return
            # A scheduler speaks first; its message begins with its length.
            connection.settimeout(PATIENCE)
            begin = connection.recv(8, socket.MSG_WAITALL)
    except TimeoutError:
        raise InputError(f"{place}: no Dask scheduler answers there") from None
    except (OSError, OverflowError, UnicodeError) as error:
        raise InputError(f"{place}: no Dask scheduler there ({_line(error)})") from None
    if len(begin) < 8 or struct.unpack("<Q", begin)[0] > 1 << 20:
        raise InputError(f"{place}: what answers there is no Dask scheduler")


def _line(error: BaseException) -> str:
    """An error in one line that is not too long."""
    words = str(error) if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
    return " ".join(words.split())[:300]


def throw_chunk(thrower: Thrower, sampler: Sampler, first: int, count: int) -> Thrown:
    """Draw and throw samples `first` to `first + count`."""
    values = sampler.draw(first, count)
    return np.arange(first, first + count), values, thrower.throw(values)


def run_sweep(
    thrower: Thrower,
    sampler: Sampler,
    samples: int,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Thrown | None:
    """Throw `samples` samples; after Ctrl-C what was thrown until then.

    The chunks, and so the result to the last bit, do not depend on the executor. After
    Ctrl-C chunks in work are finished, the others dropped; None if there is nothing.
    """
    # The same whatever the number of workers; a power of two, as the sequence likes it.
    size = MODELS[thrower.model].chunk
    work = (
        partial(throw_chunk, thrower, sampler, first, min(size, samples - first))
        for first in range(0, samples, size)
    )
    done: list[Thrown] = []

    def keep(part: Thrown) -> None:
        done.append(part)
        if progress is not None:
            progress(sum(numbers.size for numbers, _, _ in done), samples)

    try:
        if executor is None:
            for chunk in work:
                keep(chunk())
        else:
            _spread(work, executor, keep)
    except KeyboardInterrupt:
        if not done:
            return None
    done.sort(key=lambda part: int(part[0][0]))
    numbers, values, landings = zip(*done, strict=True)
    return np.concatenate(numbers), np.vstack(values), Outcomes.joined(landings)


def _spread(
    work: Iterator[Callable[[], Thrown]], executor: Executor, keep: Callable[[Thrown], None]
) -> None:
    """Throw the chunks on the executor's workers; `keep` takes each as it is done."""
    running: set[Future[Thrown]] = set()
    try:
        while True:
            for chunk in itertools.islice(work, WINDOW - len(running)):
                running.add(executor.submit(chunk))
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                running.remove(future)
                keep(future.result())
    except KeyboardInterrupt:
        # What has begun is nearly done; the rest is dropped.
        for future in wait([future for future in running if not future.cancel()]).done:
            keep(future.result())
        raise
    except BaseException:
        for future in running:
            future.cancel()
        raise
