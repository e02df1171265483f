"""Jobs run by this process, by others on this machine, or by a Dask cluster.

Long work is cut into short jobs: any executor can share them, and Ctrl-C loses no finished job.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import signal
import socket
import ssl
import struct
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent import futures
from concurrent.futures import Executor, Future
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from ...interrupts import ENDING, INTERRUPTS
from ...problems import InputError

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
def signals_deferred() -> Iterator[None]:
    """Signals that end this process wait until the block is done.

    Processes are started inside such a block: one whose parent ends before it has its first job
    prints a traceback, and its pool waits forever. They inherit the mask, so that a Ctrl-C does not
    meet their start either. The mask alone does not defer: another thread, of NumPy for instance,
    may take the signal.
    """
    received = list[int]()
    ours = ENDING if threading.current_thread() is threading.main_thread() else ()
    handlers = {kind: signal.getsignal(kind) for kind in ours if callable(signal.getsignal(kind))}
    masks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING) if masks else None
    try:
        for kind in handlers:
            signal.signal(kind, lambda number, frame: received.append(number))
        yield
    finally:
        if before is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for kind, handler in handlers.items():
            signal.signal(kind, handler)
        for number in received:
            signal.raise_signal(number)


def set_up_worker() -> None:
    """In a worker process: its parent handles Ctrl-C; other signals and the parent's end end it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
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
    # Imported here with the attribute, which takes 15 ms.
    others = active_children()
    pool = futures.ProcessPoolExecutor(count, get_context("spawn"), set_up_worker)
    try:
        with pool:
            with signals_deferred():  # Each of the first jobs starts a process.
                for _ in range(count):
                    pool.submit(os.getpid)
            try:
                yield pool
            finally:
                _end_missed_workers(pool, others)
    except futures.BrokenExecutor:
        raise InputError(f"one of {count} worker processes died: out of memory?") from None


def _end_missed_workers(pool: Executor, others: Sequence[BaseProcess]) -> None:
    """Ends the workers of a broken pool.

    Python 3.11 misses one that starts while the pool breaks, and waits for it forever.
    """
    try:
        pool.submit(os.getpid)
    except futures.BrokenExecutor:
        for child in active_children():
            if child not in others:
                child.terminate()


@contextlib.contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    place = f"--scheduler {address}"
    found = re.fullmatch(r"(?:(tcp|tls)://)?(\[.+\]|[^/:]+):(\d{1,5})", address)
    if found is None:
        raise InputError(f"{place}: must be like tcp://host:8786")
    connection: dict[str, Any] = {}
    if found[1] == "tls":
        connection = _load_dask(place).Security().get_connection_args("client")
        if connection.get("ssl_context") is None:
            raise InputError(
                f"{place}: needs certificates: distributed.comm.tls of Dask's settings"
            )
    host = found[2].strip("[]")
    check_host(place, host)
    _check_scheduler(place, host, int(found[3]), connection.get("ssl_context"))
    distributed = _load_dask(place)
    try:
        # In a thread: a notebook's has an event loop of its own.
        with futures.ThreadPoolExecutor(1) as thread:
            asked = _dask_role(distributed, address, connection)
            role = thread.submit(asyncio.run, asked).result()
        if role != "Scheduler":
            raise InputError(f"{place}: what answers there is no Dask scheduler but a {role}")
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"{place}: {_line(error)}") from None
    # Failures of a cluster and of the packages on it.
    failures = (distributed.KilledWorker, ImportError, OSError, futures.CancelledError)
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        # Not pure: the cluster must not return an earlier result. Other workers repeat the tasks
        # of a lost one.
        with client.get_executor(pure=False) as executor:
            yield executor
    except TimeoutError:
        raise InputError(f"{place}: the scheduler has no workers") from None
    except failures as error:
        raise InputError(f"{place}: work failed there: {_line(error)}") from None
    finally:
        client.close(timeout=PATIENCE)


def _load_dask(place: str) -> Any:
    try:
        import distributed
    except ImportError:
        raise InputError(f"{place}: needs Dask: pip install distributed") from None
    return distributed


def check_host(place: str, host: str) -> None:
    """InputError, naming `place`, unless `host` may be a machine's name or address."""
    with contextlib.suppress(UnicodeError):
        host.encode("idna")  # As sockets do.
        if re.fullmatch(r"[^\s\0]+", host):
            return
    raise InputError(f"{place}: must be the name or the address of a machine")


async def _dask_role(distributed: Any, address: str, connection: dict[str, Any]) -> str:
    """The part of Dask that answers there: its client would wait long for a worker."""
    async with asyncio.timeout(PATIENCE):
        comm = await distributed.core.connect(address, **connection)
        await comm.write({"op": "identity"})
        role = str((await comm.read()).get("type"))
        comm.abort()
        return role


def _check_scheduler(place: str, host: str, port: int, tls: ssl.SSLContext | None) -> None:
    """InputError unless a part of Dask seems to answer there.

    Dask's own client waits long for other servers and for unknown names, and does not expect all
    that they may say.
    """
    try:
        with contextlib.ExitStack() as stack:
            connection = stack.enter_context(socket.create_connection((host, port), PATIENCE))
            if tls is not None:
                connection = stack.enter_context(tls.wrap_socket(connection))
            # Dask speaks first; its message begins with its length.
            message = stack.enter_context(connection.makefile("rb"))
            begin = message.read(8)
            length = struct.unpack("<Q", begin)[0] if len(begin) == 8 else 0
            words = message.read(length) if length < 1 << 20 else b""
    except TimeoutError:
        raise InputError(f"{place}: no Dask scheduler answers there") from None
    except (OSError, OverflowError) as error:
        raise InputError(f"{place}: no Dask scheduler there ({_line(error)})") from None
    if b"pickle-protocol" not in words:
        raise InputError(f"{place}: what answers there is no Dask scheduler")


def _line(error: BaseException) -> str:
    """An error in one line of at most 300 characters."""
    words = str(error) if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
    return " ".join(words.split())[:300]


def run_jobs(
    next_job: Callable[[], Callable[[], T] | None],
    executor: Executor | None,
    keep: Callable[[T], None],
) -> None:
    """Runs jobs until the last is done; `keep` takes each result.

    next_job: the next job or None; it is called again after each result. A job for an executor must
    be picklable. After Ctrl-C running jobs are finished and kept, the others dropped, and
    KeyboardInterrupt is raised.
    """
    if executor is None:
        while (job := next_job()) is not None:
            INTERRUPTS.check()
            keep(job())
        return
    running: set[Future[T]] = set()
    try:
        while True:
            while len(running) < WINDOW and (job := next_job()) is not None:
                running.add(executor.submit(job))
            if not running:
                return
            INTERRUPTS.check()
            for future in futures.wait(running, return_when=futures.FIRST_COMPLETED).done:
                running.remove(future)
                keep(future.result())
    except KeyboardInterrupt:
        for future in futures.wait([future for future in running if not future.cancel()]).done:
            keep(future.result())
        raise
    except BaseException:
        for future in running:
            future.cancel()
        raise
