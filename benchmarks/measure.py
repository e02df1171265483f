"""Tools of several sections: random targets in reach, warm planners, times.

A target in reach is where a random motion throws the bar: from rest along a polynomial run-up to a
random state, through the opening at constant acceleration, and braked to rest; sent at 1 kHz and
thrown by the exact model, with every limit, the grip (10 % kept free), the workspace and the cup
checked. The planner's own table and NLP have no part in it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from throwplan import Plan, Planner, Pose, Scene, Throw
from throwplan.models import Array, Trajectory
from throwplan.planner.planner import SolverName
from throwplan.planner.search import carry
from throwplan.planner.throw import (
    Limits,
    Manipulator,
    SmoothingError,
    excesses,
    make_manipulator,
    send,
)
from throwplan.planner.verdict import measures_of, verdict_on

T = TypeVar("T")

#: Number of pieces of a random motion's run-up.
PIECES = 40
#: Largest use of velocity and acceleration limits by a random motion.
LIMIT_USE = 0.95
#: Largest use of the grip's friction by a random motion before the opening.
GRIP_USE = 0.9
#: Number of random states drawn at once.
BATCH = 2000


def least_time(run: Callable[[], T], repeats: int, budget: float, long: float) -> tuple[float, T]:
    """Least processor time [s] of `run` after a first call that does not count, and its result.

    Runs at least `repeats` times, and more while they take less than `budget` [s] together; a
    first call longer than `long` [s] counts and is not repeated.
    """
    start = time.process_time()
    found = run()
    first = time.process_time() - start
    if first > long:
        return first, found
    seconds: list[float] = []
    while len(seconds) < repeats or (sum(seconds) < budget and len(seconds) < 50):
        start = time.process_time()
        run()
        seconds.append(time.process_time() - start)
    return min(seconds), found


def warmed(scene: Scene, targets: Sequence[Pose], solver: SolverName = "fatrop") -> Planner:
    """A planner with its NLPs built by plans to `targets`, so that later times exclude that."""
    planner = Planner(scene, library=False)
    for target in targets:
        planner.plan(target, solver=solver)
    return planner


def number(cell: object) -> float:
    """A table cell's number, infinite if it has none."""
    return float(cell) if isinstance(cell, float | int) else math.inf


def planning_time(plan: Plan) -> float:
    """Time [s] of a plan without what is built once for all."""
    return plan.time["total"] - plan.time["build"]


def quantiles(values: Sequence[float] | Array, *shares: float) -> list[float]:
    """Quantiles at shares in percent; NaN without values."""
    if not len(values):
        return [math.nan] * len(shares)
    return [float(value) for value in np.percentile(values, shares)]


def reachable_targets(scene: Scene, seed: int) -> Iterator[Pose]:
    """Endless landing poses in reach; theta None where the scene's target leaves it open."""
    manipulator = make_manipulator(scene)
    rng = np.random.default_rng(seed)
    opening = scene.gripper.profile().opening
    while True:
        for motion, at in _motions(scene, manipulator, opening, rng):
            pose = _thrown(scene, manipulator, motion, at, scene.aim)
            if pose is not None:
                yield pose


def _motions(
    scene: Scene, manipulator: Manipulator, opening: float, rng: np.random.Generator
) -> Iterator[tuple[Trajectory, float]]:
    """Random motions within the limits, and when their opening starts [s]."""
    limits, n = manipulator.planning, manipulator.size
    q = rng.uniform(limits.q_min, limits.q_max, (BATCH, n))
    dq = rng.uniform(-LIMIT_USE, LIMIT_USE, (BATCH, n)) * limits.dq
    ddq = rng.uniform(-LIMIT_USE, LIMIT_USE, (BATCH, n)) * limits.ddq
    shortest = max(scene.gripper.profile().dwell, 0.1)
    durations = rng.uniform(shortest, 1.2, BATCH)
    for state in zip(q, dq, ddq, durations, strict=True):
        end = state[0] + opening * (state[1] + opening * state[2] / 2)
        rate = state[1] + opening * state[2]
        if _too_fast(limits, end, rate):
            continue
        if ((end < limits.q_min) | (end > limits.q_max)).any():
            continue
        motion = carry(manipulator, state[:3], state[3], opening, PIECES)
        if _inside(limits, motion):
            yield motion, float(state[3])


def _inside(limits: Limits, motion: Trajectory) -> bool:
    """Whether the motion keeps all limits at its nodes."""
    q, dq, ddq, jerk = (motion.starts(k) for k in range(4))
    if (q < limits.q_min).any() or (q > limits.q_max).any() or _too_fast(limits, q, dq):
        return False
    within = (np.abs(ddq) <= LIMIT_USE * limits.ddq) & (np.abs(jerk) <= LIMIT_USE * limits.jerk)
    return bool(within.all())


def _too_fast(limits: Limits, q: Array, dq: Array) -> bool:
    """Whether any velocity is above its share of the limit there."""
    low, high = limits.velocity(q)
    return bool(((dq < LIMIT_USE * low) | (dq > LIMIT_USE * high)).any())


def _thrown(
    scene: Scene, manipulator: Manipulator, motion: Trajectory, at: float, target: Pose
) -> Pose | None:
    """The landing pose of a motion that breaks nothing."""
    try:
        samples = send(manipulator, motion)
    except SmoothingError:
        return None
    if excesses(manipulator, samples):
        return None
    stop = samples.q[-1]
    if ((stop < manipulator.planning.q_min) | (stop > manipulator.planning.q_max)).any():
        return None
    throw = Throw.sent(scene.aimed_at(target), manipulator, samples, at).sliding_pivot
    if measures_of(throw).value("grip")[0] > GRIP_USE or not np.isfinite(throw.landing.flight_time):
        return None
    theta = None if target.theta is None else throw.landing.theta
    pose = target.in_plane(throw.landing.x, theta)
    return pose if verdict_on(replace(throw, scene=scene.aimed_at(pose))).ok else None
