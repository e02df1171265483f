"""Many throws in chunks, here or on other processes and machines, stoppable at any time."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...models import MODELS
from .sweep_throws import Landings, Thrower
from .uncertain import Sampler

Array = npt.NDArray[np.float64]
#: Told how many samples are done, of how many.
Progress = Callable[[int, int], None]

#: Chunks handed out at once.
WINDOW = 64


@dataclass(frozen=True)
class Chunk:
    """Samples `first` to `first + count` of a sweep: all that a worker needs."""

    thrower: Thrower
    sampler: Sampler
    first: int
    count: int


def throw_chunk(chunk: Chunk) -> tuple[Array, Landings]:
    """Draw and throw one chunk: parameters (count, P) and landings."""
    values = chunk.sampler.draw(chunk.first, chunk.count)
    return values, chunk.thrower.throw(values)


@dataclass(frozen=True)
class Thrown:
    """Samples that were thrown: numbers (N,) in the sequence, parameters (N, P), landings."""

    numbers: npt.NDArray[np.int_]
    values: Array
    landings: Landings


def run_sweep(
    thrower: Thrower,
    sampler: Sampler,
    samples: int,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> tuple[Thrown | None, bool]:
    """Throw `samples` samples; what was thrown, and whether Ctrl-C cut it short.

    The chunks, and so the result to the last bit, do not depend on the executor. After
    Ctrl-C chunks in work are finished, the others dropped; None if there is nothing.
    """
    # The same whatever the number of workers; a power of two, as the sequence likes it.
    size = MODELS[thrower.model].chunk
    chunks = [
        Chunk(thrower, sampler, first, min(size, samples - first))
        for first in range(0, samples, size)
    ]
    done: dict[int, tuple[Array, Landings]] = {}

    def keep(index: int, result: tuple[Array, Landings]) -> None:
        done[index] = result
        if progress is not None:
            progress(sum(chunks[i].count for i in done), samples)

    interrupted = False
    try:
        if executor is None:
            for index, chunk in enumerate(chunks):
                keep(index, throw_chunk(chunk))
        else:
            _spread(chunks, executor, keep)
    except KeyboardInterrupt:
        interrupted = True
    if not done:
        return None, interrupted
    order = sorted(done)
    numbers = [chunks[i].first + np.arange(chunks[i].count) for i in order]
    values = np.vstack([done[i][0] for i in order])
    landings = Landings.joined([done[i][1] for i in order])
    return Thrown(np.concatenate(numbers), values, landings), interrupted


def _spread(
    chunks: list[Chunk], executor: Executor, keep: Callable[[int, tuple[Array, Landings]], None]
) -> None:
    """Throw the chunks on the executor's workers; `keep` takes each as it is done."""
    waiting = iter(enumerate(chunks))
    running: dict[Future[tuple[Array, Landings]], int] = {}
    try:
        while True:
            for index, chunk in itertools.islice(waiting, WINDOW - len(running)):
                running[executor.submit(throw_chunk, chunk)] = index
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                keep(running.pop(future), future.result())
    except KeyboardInterrupt:
        # What has begun is nearly done; the rest is dropped.
        begun = [future for future in running if not future.cancel()]
        for future in wait(begun).done:
            keep(running[future], future.result())
        raise
    except BaseException:
        for future in running:
            future.cancel()
        raise
