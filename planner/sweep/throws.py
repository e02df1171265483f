"""The throws of a sweep: landings and verdicts of sampled parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...models import Array, Flags, Indices
from ...models.release import MODELS
from ...problems import InputError
from ..result import Plan
from ..throw import BatchFlights, ThrowBatch
from ..verdict import Code, Judge, Sampler, Verdicts
from ..workers import Progress, run_jobs

#: Largest delay [s] of a sweep's scan.
FURTHEST = 0.05
#: Number of throws in the choice of the number of steps.
PROBES = 64
#: Error of the chosen steps in 95 % of the probes, as a share of the tolerance.
STEP_ERROR = 0.1


@dataclass(frozen=True)
class Outcomes:
    """Landings and verdicts of N throws.

    pose (N, 3): x [m], theta [rad] and flight time [s] at the target's height, relative to a moving
    target; NaN for a throw that never lands.
    """

    pose: Array
    verdicts: Verdicts

    @property
    def in_tolerance(self) -> Flags:
        """Flags (N,) of the throws that land within the tolerance."""
        return ~self.verdicts.breaks(Code.LANDING, Code.NO_LANDING)

    @property
    def in_cup(self) -> Flags:
        """Flags (N,) of the throws that enter the cup without contact; of all that land without
        one."""
        return ~self.verdicts.breaks(Code.CUP_MISSED, Code.CUP_WALL, Code.NO_LANDING)

    @property
    def sticks(self) -> Flags:
        """Flags (N,) of the throws that stick in the grip until the opening."""
        return ~self.verdicts.breaks(Code.SLIP_BEFORE_OPENING)

    @staticmethod
    def joined(parts: Sequence[Outcomes]) -> Outcomes:
        """The outcomes of several parts as one."""
        poses = np.concatenate([part.pose for part in parts])
        return Outcomes(poses, Verdicts.joined([part.verdicts for part in parts]))


@dataclass(frozen=True)
class ThrowSimulator:
    """Throws a plan's motion with other parameter values, and judges the throws; can be pickled."""

    judge: Judge

    @property
    def batch(self) -> ThrowBatch:
        """The motion, its parameters, its release model."""
        return self.judge.batch

    def throw(self, values: Array) -> Outcomes:
        """N throws: values (N, P) of the parameters, columns as `batch.names`, SI units."""
        flights = self.batch.fly(values)
        return Outcomes(self._relative(flights), self.judge.verdicts(flights, values))

    def poses(self, values: Array) -> Array:
        """Landings (N, 3) as in `Outcomes`, without verdicts."""
        return self._relative(self.batch.fly(values))

    def _relative(self, flights: BatchFlights) -> Array:
        """Landings in the frame of a target that moves."""
        landing = flights.landing.copy()
        landing[:, 0] -= flights.goal - self.batch.throw.target.plane_x
        return landing


def simulator_of(plan: Plan, model: str, sampler: Sampler) -> ThrowSimulator:
    """A simulator of a solved plan's motion; InputError for a plan without a throw.

    Clearances of the scene are reserves of the plan: a throw of a sweep fails only on contact.
    """
    if plan.throw is None or not plan.solved:
        raise InputError(f"plan: status {plan.status}: there is no throw to sweep")
    scene = plan.scene.without_clearances()
    mean, opening = scene.mean_delay, scene.gripper.profile().opening
    low, high = sampler.reach("delay", mean)
    longest = max(opening, sampler.reach("opening", opening)[1])
    reach = min(-FURTHEST, low - mean), max(FURTHEST, high - mean), longest
    throw = replace(plan.throw.deciding, scene=scene.aimed_at(plan.goal))
    batch = ThrowBatch.of(throw, plan.goal, sampler.names, reach, model)
    return _with_steps(ThrowSimulator(Judge(batch)), sampler)


def _with_steps(simulator: ThrowSimulator, sampler: Sampler) -> ThrowSimulator:
    """The simulator with the coarsest steps that are accurate to `STEP_ERROR`."""
    batch, tolerance = simulator.batch, simulator.batch.scene.tolerance
    probes = np.vstack([batch.nominal(), sampler.draw(0, PROBES - 1)])
    coarse, poses = simulator, None
    for steps in MODELS[batch.model].sweep_steps:
        fine = ThrowSimulator(Judge(replace(batch, steps=steps)))
        fine_poses = fine.poses(probes)[:, :2]
        if poses is not None:
            change = np.abs(fine_poses - poses) / (tolerance.position, tolerance.angle)
            if batch.throw.target.theta is None:
                change = change[:, :1]
            if np.quantile(np.nan_to_num(change.max(axis=1)), 0.95) <= STEP_ERROR:
                return coarse
        coarse, poses = fine, fine_poses
    return coarse


#: Numbers (N,) of samples in the sequence, their parameters (N, P), and their outcomes.
Throws = tuple[Indices, Array, Outcomes]


def throw_chunk(simulator: ThrowSimulator, sampler: Sampler, first: int, count: int) -> Throws:
    """Draw and throw samples `first` to `first + count`."""
    values = sampler.draw(first, count)
    return np.arange(first, first + count), values, simulator.throw(values)


def run_sweep(
    simulator: ThrowSimulator,
    sampler: Sampler,
    samples: int,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Throws | None:
    """Throws `samples` samples; after Ctrl-C the finished ones, None without any.

    The chunks, and so the result to the last bit, do not depend on the executor.
    """
    # A power of two: other parts of a Sobol sequence are not balanced.
    size = MODELS[simulator.batch.model].chunk
    chunks = iter(range(0, samples, size))
    done: list[Throws] = []

    def next_chunk() -> Callable[[], Throws] | None:
        first = next(chunks, None)
        if first is None:
            return None
        return partial(throw_chunk, simulator, sampler, first, min(size, samples - first))

    def keep(part: Throws) -> None:
        done.append(part)
        if progress is not None:
            progress(sum(numbers.size for numbers, _, _ in done), samples)

    try:
        run_jobs(next_chunk, executor, keep)
    except KeyboardInterrupt:
        if not done:
            return None
    done.sort(key=lambda part: int(part[0][0]))
    numbers, values, landings = zip(*done, strict=True)
    return np.concatenate(numbers), np.vstack(values), Outcomes.joined(landings)
