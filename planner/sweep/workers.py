"""Who does long work: this process, others on this machine, or a Dask cluster."""

from __future__ import annotations

import re
import signal
import socket
import struct
from collections.abc import Iterator
from concurrent import futures
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from contextlib import contextmanager
from multiprocessing import get_context

from ...problems import InputError

#: Most processes here.
MOST = 256
#: A scheduler must answer in this time, and have a worker [s].
PATIENCE = 5.0


def check_workers(workers: int | None, scheduler: str | None) -> None:
    """InputError for numbers of processes out of range, and for both kinds at once."""
    if workers is not None and not 1 <= workers <= MOST:
        raise InputError(f"--workers {workers}: must be a whole number, 1 to {MOST}")
    if workers is not None and scheduler is not None:
        raise InputError("--workers and --scheduler: give one of them")


@contextmanager
def executor_of(workers: int | None, scheduler: str | None) -> Iterator[Executor | None]:
    """The executor that the options ask for, None for this process.

    InputError where there is no such cluster, and for what goes wrong on workers.
    """
    check_workers(workers, scheduler)
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
        raise InputError(f"--workers {count}: a worker process died: out of memory?") from None


def _leave_ctrl_c_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    place = f"--scheduler {address}"
    _check_scheduler(address, place)
    try:
        import distributed
    except ImportError:
        raise InputError(f"{place}: needs Dask: pip install 'throwplan[dask]'") from None
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"{place}: {_line(error)}") from None
    # What can go wrong with a cluster, and with what is installed on it.
    trouble = (distributed.KilledWorker, ImportError, OSError, CancelledError)
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        # Not pure: every sweep is thrown, whatever the cluster remembers. Tasks of a worker
        # that is lost are done again by others.
        with client.get_executor(pure=False) as executor:
            yield executor
    except TimeoutError:
        raise InputError(f"{place}: the scheduler has no workers") from None
    except trouble as error:
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
