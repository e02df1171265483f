"""Sweeps: a plan's motion thrown under the scene's uncertainty."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ...models import Array, Indices
from ...models.release import BATCH_MODELS
from ...problems import InputError, checked
from ...workers import Progress, run_jobs
from ..result import Plan, SavedThrow, plan_of
from ..throw import ThrowBatch, named_model, release_model
from ..uncertainty import FURTHEST, Entries, Sampler, sampler_of, scan_delays
from ..verdict import Judge, Verdicts
from .results import Sweep
from .statistics import derivatives, variance_shares

#: Largest number of samples; their parameters and landings stay in memory.
MOST = 10_000_000
#: Default number of samples.
SAMPLES = 1000
#: Default seed of the samples.
SEED = 0
#: Most samples that are followed until the object rests, 10 ms each.
RESTED = 256


def sweep(
    plan: Plan | SavedThrow | str | Path,
    samples: int = SAMPLES,
    seed: int = SEED,
    model: str = "",
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Throw a solved plan's sent motion under its scene's [uncertainty].

    plan: also what `read_plan` read, or the path of a plan.json or of its folder.
    A delay and an opening that it leaves out are assumed. model: of the release;
    empty for the model of the scene's tolerance. The samples are a seeded Halton sequence; an
    executor, Dask's `client.get_executor()` for instance, spreads chunks of them without any change
    of the result. progress(thrown, samples) is called on the way. Raises InputError for a plan
    without a throw, an unknown model, numbers out of range.
    """
    started, plan = time.perf_counter(), plan_of(plan)
    own = plan.scene.deciding_model
    check_sweep(samples, seed, plan.scene.tolerance.model if model in ("", own) else model)
    model = model or own
    sampler = sampler_of(plan.scene, seed)
    if not sampler.names:
        words = "[uncertainty] says so of delay and opening"
        raise InputError(f"{plan.scene.place}: nothing is uncertain to sweep over: {words}")
    judge = judge_of(plan, model, sampler)
    numbers, values, landings = run_sweep(judge, sampler, samples, executor, progress)
    shares = [variance_shares(values, landings.pose[:, column]) for column in (0, 1)]
    rests = None
    if plan.scene.rest is not None:
        rests = Entries.of(judge, values[:RESTED], seed).count(judge.batch.scene)
    return Sweep(
        plan,
        judge.batch,
        sampler,
        numbers=numbers,
        values=values,
        landings=landings,
        nominal=judge.verdicts(judge.batch.nominal()),
        derivatives=derivatives(judge.batch, sampler),
        shares=dict(zip(sampler.names, zip(*shares, strict=True), strict=True)),
        delays=scan_delays(judge),
        rests=rests,
        seconds=time.perf_counter() - started,
    )


def check_sweep(samples: int, seed: int, model: str, prefix: str = "") -> None:
    """InputError for numbers out of range and unknown models; `prefix` as on the command line."""
    named_model(model, BATCH_MODELS, prefix=prefix)
    for name, value, low, high in (("samples", samples, 1, MOST), ("seed", seed, 0, 2**32 - 1)):
        checked(f"{prefix}{name}", value, int, {"least": low, "most": high})


def judge_of(plan: Plan, model: str, sampler: Sampler) -> Judge:
    """A judge of throws of a solved plan's motion; InputError for a plan without a throw."""
    if plan.throw is None or not plan.solved:
        raise InputError(f"plan: status {plan.status}: there is no throw to sweep")
    early, late, longest = sampler.openings(plan.scene)
    reach = min(-FURTHEST, early), max(FURTHEST, late), longest
    throw = replace(plan.throw.deciding, scene=plan.scene.aimed_at(plan.goal))
    batch = ThrowBatch.of(throw, plan.goal, sampler.names, reach, model)
    return Judge.of_success(batch)


#: Numbers (N,) of samples in the sequence, their parameters (N, P), and their verdicts.
Throws = tuple[Indices, Array, Verdicts]


def _throw_chunk(judge: Judge, sampler: Sampler, first: int, count: int) -> Throws:
    """Draw and throw samples `first` to `first + count`."""
    values = sampler.draw(first, count)
    return np.arange(first, first + count), values, judge.verdicts(values)


def run_sweep(
    judge: Judge,
    sampler: Sampler,
    samples: int,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Throws:
    """Throws `samples` samples.

    The chunks, and so the result to the last bit, do not depend on the executor.
    """
    size = release_model(judge.batch.scene, judge.batch.model).chunk
    chunks = iter(range(0, samples, size))
    done: list[Throws] = []

    def next_chunk() -> Callable[[], Throws] | None:
        first = next(chunks, None)
        if first is None:
            return None
        return partial(_throw_chunk, judge, sampler, first, min(size, samples - first))

    def keep(part: Throws) -> None:
        done.append(part)
        if progress is not None:
            progress(sum(numbers.size for numbers, _, _ in done), samples)

    run_jobs(next_chunk, executor, keep)
    done.sort(key=lambda part: int(part[0][0]))
    numbers, values, landings = zip(*done, strict=True)
    return np.concatenate(numbers), np.vstack(values), Verdicts.joined(landings)
