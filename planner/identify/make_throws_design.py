"""The design of a synthetic batch: throwing postures, and joint motions for them.

As in Liu and Billard, section VI-A: per pitch angle one state of the joints as the grip
force starts to fall, and from there on six constant joint accelerations along the joints'
rates, from speeding up to slowing down. Each motion starts at rest, keeps the Panda's
limits on position, velocity, acceleration and jerk, and brakes to rest.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from ...models import PlanarArm
from ...problems import Scene
from ..check import (
    TICK,
    Limits,
    Mover,
    PlannedMotion,
    SampledMotion,
    SmoothingError,
    broken_limits,
    make_mover,
    scene_violations,
    send,
    slip_while_carrying,
    throw,
)
from ..compile import mapped
from ..search import polynomial, run_up
from .make_throws_scene import BARS, GRIPPER, HEIGHT, HELD, scene_with, surfaced

Array = npt.NDArray[np.float64]

#: The hand as the force starts to fall: angle [deg], x [m], forward and upward speed [m/s],
#: each from, to: an upward throw, one in between and a forward one.
PITCHES = {
    "p1": ((-50, -40), (0.45, 0.7), (0.3, 0.6), (1.2, 1.7)),
    "p2": ((-62, -52), (0.5, 0.65), (0.4, 0.8), (1.0, 1.4)),
    "p3": ((-80, -70), (0.55, 0.8), (0.7, 1.5), (0.4, 0.9)),
}
#: Joint accelerations from speeding up to slowing down: one joint's share of its limit.
RELEASES = (0.6, 0.3, 0.0, -0.3, -0.6, -0.9)
#: Share of the rate limits that the states are within.
FASTEST = 0.95
#: How much longer than the nominal opening the acceleration stays constant [s]: late
#: openings and the low-pass filter of the recording then see no step.
LONGER = 0.025
#: Durations of the launch that are tried [s].
LAUNCHES = (0.5, 0.4, 0.32, 0.65, 0.8)
#: Largest friction use on the way: a fifth of the grip is kept free for a weak throw.
GRIP = 0.8
#: Random states that are looked at, and how many of those that will do are compared.
STATES, COMPARED = 150_000, 3


@dataclass(frozen=True)
class Throwing:
    """A motion of the design: samples at 1 kHz; opening_time [s]: nominal start of the fall."""

    samples: SampledMotion
    opening_time: float


#: A bar and its surface.
Held = tuple[str, str]


def bars_of(pitch: str) -> list[Held]:
    """Which (bar, surface) are thrown from a posture; the factors' are all from the middle one."""
    batch = [("com1", "base"), ("com2", "base")]
    more = [("com1", "papertape"), *((bar, "base") for bar in list(BARS)[2:])]
    return batch + more if pitch == "p2" else batch


@cache
def design(seed: int = 0) -> dict[str, list[Throwing]]:
    """For each pitch the motions of the six release accelerations.

    `seed` is of the random states only: the same design for every data set.
    """
    mover = make_mover(scene_with("com1", *HELD))
    rng = np.random.default_rng(seed)
    found = {}
    for pitch in PITCHES:
        states = _states(mover, rng, pitch)
        some = list(itertools.islice(_possible(mover, states, bars_of(pitch)), COMPARED))
        found[pitch] = max(some, key=lambda motions: _spread(mover, motions))
    return found


def _states(mover: Mover, rng: np.random.Generator, pitch: str) -> tuple[Array, Array]:
    """Joint positions and rates (S, n) that move the hand as PITCHES asks, fastest turn first."""
    limits, n = mover.planning, mover.size
    q = rng.uniform(limits.q_min, limits.q_max, (STATES, n))
    dq = rng.uniform(-FASTEST, FASTEST, (STATES, n)) * limits.dq
    angle, *windows = PITCHES[pitch]
    # The last joint turns the hand one to one: it is set to the angle that is asked for.
    hand = mapped(mover.motion)
    assert isinstance(mover.kinematics, PlanarArm)
    sign = mover.kinematics.signs[-1]
    wanted = np.radians(rng.uniform(*angle, STATES))
    off = wanted - hand(q, dq, 0 * q)[0][:, 2]
    q[:, -1] += sign * ((off + math.pi) % (2 * math.pi) - math.pi)
    pose, twist, _ = (rows.T for rows in hand(q, dq, 0 * q))
    good = (q[:, -1] >= limits.q_min[-1]) & (q[:, -1] <= limits.q_max[-1])
    for values, (least, most) in zip((pose[0], twist[0], twist[1]), windows, strict=True):
        good &= (values > least) & (values < most)
    good &= (pose[1] > 0.1) & (twist[2] > 1.5)
    # Those whose hardest motion keeps the limits at its end.
    span = float(GRIPPER.opening or 0.0) + LONGER
    end = dq + span * RELEASES[0] * _along(mover, dq)
    reached = q + span * (dq + end) / 2
    good &= (np.abs(end) <= limits.dq).all(axis=1)
    good &= ((reached >= limits.q_min) & (reached <= limits.q_max)).all(axis=1)
    order = np.flatnonzero(good)[np.argsort(-twist[2][good])]
    return q[order], dq[order]


def _along(mover: Mover, dq: Array) -> Array:
    """Joint accelerations (..., n) along rates, one joint at its limit."""
    share = (np.abs(dq) / mover.planning.ddq).max(axis=-1, keepdims=True)
    return np.asarray(dq / share)


def _possible(
    mover: Mover, states: tuple[Array, Array], bars: Sequence[Held]
) -> Iterator[list[Throwing]]:
    """The motions of each state whose six motions keep everything."""
    for q, dq in zip(*states, strict=True):
        along = _along(mover, dq)
        motions = []
        # The longest and the fastest first: they fail most often.
        for share in sorted(RELEASES, key=abs, reverse=True):
            motion = _throwing(mover, (q, dq, share * along), bars)
            if motion is None:
                break
            motions.append((share, motion))
        if len(motions) == len(RELEASES):
            yield [motion for _, motion in sorted(motions, key=lambda pair: -pair[0])]


def _throwing(
    mover: Mover, state: tuple[Array, Array, Array], bars: Sequence[Held]
) -> Throwing | None:
    """A launch to a state, constant acceleration and the brake; None if something forbids it."""
    opening = float(GRIPPER.opening or 0.0) + LONGER
    for duration in LAUNCHES:
        motion = _planned(*state, duration, opening)
        if not _inside(mover.planning, motion):
            continue
        try:
            samples = send(mover, motion)
        except SmoothingError:
            continue
        inside = (samples.q >= mover.planning.q_min) & (samples.q <= mover.planning.q_max)
        if not inside.all() or broken_limits(mover.hard, mover.joints, samples):
            continue
        found = Throwing(samples, duration)
        if all(_free(mover, found, surfaced(*bar, *HELD)) for bar in bars):
            return found
    return None


def _free(mover: Mover, motion: Throwing, scene: Scene) -> bool:
    """Whether grip and workspace allow the throw, by the exact sliding pivot."""
    samples, at = motion.samples, motion.opening_time
    if grip_use(mover, motion, scene) > GRIP:
        return False
    thrown = throw(scene, mover, samples, at, HEIGHT)
    return not scene_violations(scene, mover, samples, float(samples.times[-1]), at, thrown)


def _planned(q: Array, dq: Array, ddq: Array, duration: float, opening: float) -> PlannedMotion:
    """Rest to (q, dq, ddq) in `duration`, then constant acceleration; a piece a tick."""
    ticks = round(duration / TICK)
    times = np.append(TICK * np.arange(ticks + 1), duration + opening)
    launch = run_up(None, q, dq, ddq, duration)
    place, rate, acceleration = (polynomial(launch, times[:-1, None], k) for k in range(3))
    jerk = np.diff(acceleration, axis=0, append=acceleration[-1:]) / TICK
    for k in range(ticks):
        rate[k + 1] = rate[k] + TICK * (acceleration[k] + acceleration[k + 1]) / 2
        place[k + 1] = place[k] + TICK * (
            rate[k] + TICK * (2 * acceleration[k] + acceleration[k + 1]) / 6
        )
    return PlannedMotion(times, place, rate, acceleration, jerk)


def _inside(limits: Limits, motion: PlannedMotion) -> bool:
    """Whether the motion keeps all limits at its nodes and at its end."""
    assert limits.jerk is not None
    q, dq, ddq = (values.T for values in motion.at(motion.times))
    low, high = limits.velocity(q)
    kept = (q >= limits.q_min) & (q <= limits.q_max) & (dq >= low) & (dq <= high)
    soft = (np.abs(ddq) <= limits.ddq).all() and (np.abs(motion.jerk) <= limits.jerk).all()
    return bool(kept.all() and soft)


def grip_use(mover: Mover, motion: Throwing, scene: Scene) -> float:
    """Largest friction use while the bar is carried, 1 is the limit."""
    late = motion.opening_time + LONGER / 2
    return slip_while_carrying(scene, mover, motion.samples, late)


def _spread(mover: Mover, motions: Sequence[Throwing]) -> float:
    """How far hands are apart at the end of the opening in twist, as at landing [m]."""
    ends = []
    for motion in motions:
        at = np.array([motion.opening_time + float(GRIPPER.opening or 0.0)])
        _, twist, _ = mapped(mover.motion)(*(rows.T for rows in motion.samples.at(at)))
        ends.append(np.asarray(twist).ravel())
    v_x, _, omega = np.ptp(ends, axis=0)
    return float(0.6 * (v_x + omega * 0.13))
