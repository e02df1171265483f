"""Sweeps: a plan's motion thrown under the scene's uncertainty."""

from __future__ import annotations

import time
from concurrent.futures import Executor

from ...models.release import BATCH_MODELS
from ...problems import checked
from ..result import Plan
from ..throw.simulation import named_model
from ..verdict import sampler_of
from ..workers import Progress
from .results import Sweep
from .statistics import derivatives, scan_delays, variance_shares
from .throws import run_sweep, simulator_of

#: Largest number of samples; their parameters and landings stay in memory.
MOST = 10_000_000
#: Default number of samples.
SAMPLES = 1000
#: Default seed of the samples.
SEED = 0


def sweep(
    plan: Plan,
    samples: int = SAMPLES,
    seed: int = SEED,
    model: str = "",
    executor: Executor | None = None,
) -> Sweep:
    """Throw a solved plan's sent motion under its scene's [uncertainty].

    A scene without that section has an opening delay uniform in +-10 ms. model: of the release;
    empty for the model of the scene's tolerance. The samples are a seeded Sobol sequence; an
    executor spreads chunks of them without any change of the result. Raises InputError for a plan
    without a throw, an unknown model, numbers out of range.
    """
    result = sweep_until_stopped(plan, samples, seed, model, executor)
    if result is None or result.samples < samples:
        raise KeyboardInterrupt
    return result


def sweep_until_stopped(
    plan: Plan,
    samples: int = SAMPLES,
    seed: int = SEED,
    model: str = "",
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Sweep | None:
    """Like `sweep`; after Ctrl-C the sweep of the finished samples, None without any."""
    started = time.perf_counter()
    model = model or checked("plan", plan, Plan, {}).scene.tolerance.model
    check_sweep(samples, seed, model)
    sampler = sampler_of(plan.scene, seed)
    simulator = simulator_of(plan, model, sampler)
    parts = run_sweep(simulator, sampler, samples, executor, progress)
    if parts is None:
        return None
    numbers, values, landings = parts
    shares = [variance_shares(values, landings.pose[:, column]) for column in (0, 1)]
    return Sweep(
        plan,
        simulator,
        sampler,
        requested=samples,
        numbers=numbers,
        values=values,
        landings=landings,
        nominal=simulator.throw(simulator.batch.nominal()),
        derivatives=derivatives(simulator, sampler),
        shares=dict(zip(sampler.names, zip(*shares, strict=True), strict=True)),
        delays=scan_delays(simulator),
        seconds=time.perf_counter() - started,
    )


def check_sweep(samples: int, seed: int, model: str, prefix: str = "") -> None:
    """InputError for numbers out of range and unknown models; `prefix` as on the command line."""
    named_model(model, BATCH_MODELS, prefix=prefix)
    for name, value, low, high in (("samples", samples, 1, MOST), ("seed", seed, 0, 2**32 - 1)):
        checked(f"{prefix}{name}", value, int, {"least": low, "most": high})
