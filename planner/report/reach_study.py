"""Random targets that are known to be in reach, and how the planner does on them.

A target is where a random motion throws the bar: from rest (at the scene's start pose
where it has one) along a polynomial run-up to a random state, through the opening at
constant acceleration, and braked to rest; sent at 1 kHz and thrown by the exact model,
with every limit, the grip (10 % kept free), the workspace and the cup checked. The
planner's own table and NLP have no part in it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene
from ..check import (
    Limits,
    Mover,
    PlannedMotion,
    SmoothingError,
    broken_limits,
    make_mover,
    scene_violations,
    send,
    throw,
)
from ..plan import Planner
from ..result import Plan
from ..search import polynomial, run_up

Array = npt.NDArray[np.float64]

#: Pieces of the run-up: cubic ones, so near the polynomial that limits carry over.
PIECES = 40
#: Share of velocity and acceleration limits that a random motion uses at most.
MOST = 0.95
#: Largest friction use while carrying: 10 % of the grip is kept free.
GRIP = 0.9
#: Random states drawn at once.
BATCH = 2000


def reachable_targets(scene: Scene, seed: int) -> Iterator[Pose]:
    """Endless landing poses in reach; theta None where the scene's target leaves it open."""
    assert scene.target is not None
    mover = make_mover(scene)
    rng = np.random.default_rng(seed)
    opening = scene.gripper.profile().opening
    while True:
        for motion, at in _motions(scene, mover, opening, rng):
            pose = _thrown(scene, mover, motion, at, scene.target)
            if pose is not None:
                yield pose


def _motions(
    scene: Scene, mover: Mover, opening: float, rng: np.random.Generator
) -> Iterator[tuple[PlannedMotion, float]]:
    """Random motions within the limits, and when their opening starts [s]."""
    limits, n = mover.planning, mover.size
    q = rng.uniform(limits.q_min, limits.q_max, (BATCH, n))
    dq = rng.uniform(-MOST, MOST, (BATCH, n)) * limits.dq
    ddq = rng.uniform(-MOST, MOST, (BATCH, n)) * limits.ddq
    shortest = max(scene.gripper.profile().dwell, 0.1)
    durations = rng.uniform(shortest, 1.2, BATCH)
    for state in zip(q, dq, ddq, durations, strict=True):
        end = state[0] + opening * (state[1] + opening * state[2] / 2)
        rate = state[1] + opening * state[2]
        if _too_fast(limits, end, rate):
            continue
        if ((end < limits.q_min) | (end > limits.q_max)).any():
            continue
        motion = _motion(mover, *state, opening)
        if motion is not None and _inside(limits, motion):
            yield motion, float(state[3])


def _motion(
    mover: Mover, q: Array, dq: Array, ddq: Array, duration: float, opening: float
) -> PlannedMotion | None:
    """Rest to (q, dq, ddq) in `duration`, then constant acceleration over the opening."""
    times = np.append(np.linspace(0.0, duration, PIECES + 1), duration + opening)
    t = times[:-1, None]
    coefficients = run_up(mover.start, q, dq, ddq, duration)
    place, rate, acceleration = (polynomial(coefficients, t, k) for k in range(3))
    # Cubic pieces that meet in position, rate and acceleration at the pieces' middles.
    dt = duration / PIECES
    jerk = polynomial(coefficients, t + dt / 2, 3)
    jerk[-1] = 0.0
    for k in range(PIECES):
        place[k + 1] = place[k] + dt * (rate[k] + dt * (acceleration[k] / 2 + dt * jerk[k] / 6))
        rate[k + 1] = rate[k] + dt * (acceleration[k] + dt * jerk[k] / 2)
        acceleration[k + 1] = acceleration[k] + dt * jerk[k]
    return PlannedMotion(times, place, rate, acceleration, jerk)


def _inside(limits: Limits, motion: PlannedMotion) -> bool:
    """Whether the motion keeps all limits, looked at at its nodes."""
    if (motion.q < limits.q_min).any() or (motion.q > limits.q_max).any():
        return False
    if _too_fast(limits, motion.q, motion.dq):
        return False
    if (np.abs(motion.ddq) > MOST * limits.ddq).any():
        return False
    return limits.jerk is None or not (np.abs(motion.jerk) > MOST * limits.jerk).any()


def _too_fast(limits: Limits, q: Array, dq: Array) -> bool:
    """Whether any velocity is above its share of the limit there."""
    low, high = limits.velocity(q)
    return bool(((dq < MOST * low) | (dq > MOST * high)).any())


def _thrown(
    scene: Scene, mover: Mover, motion: PlannedMotion, at: float, target: Pose
) -> Pose | None:
    """The landing pose of a motion that breaks nothing."""
    try:
        samples = send(mover, motion)
    except SmoothingError:
        return None
    if broken_limits(mover.hard, mover.joints, samples):
        return None
    stop = samples.q[-1]
    if ((stop < mover.planning.q_min) | (stop > mover.planning.q_max)).any():
        return None
    sent = motion if scene.robot is None else samples
    thrown = throw(scene, mover, sent, at, target.z)
    if thrown.grip_use > GRIP or not np.isfinite(thrown.landing.flight_time):
        return None
    theta = None if target.theta is None else thrown.landing.theta
    pose = target.in_plane(thrown.landing.x, theta)
    end = motion.times[-1] if scene.robot is None else samples.times[-1]
    aimed = scene.aimed_at(pose)
    return None if scene_violations(aimed, mover, sent, float(end), at, thrown) else pose


@dataclass(frozen=True)
class Outcome:
    """One target's plan: status, times [s], errors of what is sent [m, rad]."""

    target: Pose
    plan: Plan
    seconds: float

    @property
    def error(self) -> tuple[float, float]:
        """(position [m], angle [rad]) of the landing that counts."""
        return self.plan.error_sent()


def outcomes(planner: Planner, targets: list[Pose], **options: object) -> Iterator[Outcome]:
    """The planner's answers, one after the other."""
    for target in targets:
        start = time.perf_counter()
        plan = planner.plan(target, **options)  # type: ignore[arg-type]
        yield Outcome(target, plan, time.perf_counter() - start)
