"""Time and error of a throw through the release models, alone and in a batch of 10,000.

    .venv/bin/python examples/batch_speed.py [--throws N] [--seed N]

One core. The error is the landing 0.9 m below the hand against the same model's own
converged answer (a different method where there is one). All times (the processor's) come
from one run, each the least of a few. Compiled rows need a C compiler; making the library is
not in their time.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import throwplan as tp
from throwplan.models.batch import (
    BatchRelease,
    ConstantAccelerations,
    ReleaseBatch,
    throw_limit_surface,
    throw_sliding_pivot,
)
from throwplan.models.contact import Body, Contact
from throwplan.models.flight import land
from throwplan.models.grip_force import LinearRelease
from throwplan.models.hand_track import ConstantAcceleration
from throwplan.models.integrate import euler_step
from throwplan.models.limit_surface_release import ImplicitRelease
from throwplan.models.release import Release, ReleaseCase
from throwplan.models.sliding_pivot import SlidingPivot
from throwplan.models.sliding_pivot_release import SlidingPivotRelease
from throwplan.models.time_stepping_release import SteppedRelease
from throwplan.planner.compiled_batch import compiled_steps


def random_throws(count: int, seed: int) -> ReleaseBatch:
    """h 2-20 cm, m 0.1-0.4 kg, hand 1-3 m/s, opening 30-100 ms, mu 0.3-1, r_p 2.5-10 mm."""
    rng = np.random.default_rng(seed)
    mass, speed = rng.uniform(0.1, 0.4, count), rng.uniform(1, 3, count)
    up = rng.uniform(0, 1.2, count)
    hands = ConstantAccelerations(
        np.column_stack([np.zeros((count, 2)), rng.uniform(-1.5, 1.0, count)]),
        np.column_stack([speed * np.cos(up), speed * np.sin(up), rng.uniform(-4, 4, count)]),
        np.column_stack([rng.uniform(-10, 10, (count, 2)), rng.uniform(-20, 20, count)]),
    )
    return ReleaseBatch(
        count,
        Body(mass, mass * rng.uniform(0.03, 0.07, count) ** 2, rng.uniform(0.02, 0.2, count)),
        Contact(rng.uniform(0.3, 1, count), rng.uniform(0.0025, 0.01, count), 0.6, 2),
        LinearRelease(100.0, 0.0, 0.05),
        hands,
        rng.uniform(0.03, 0.1, count),
        np.full(count, 100.0),
    )


def one(batch: ReleaseBatch, i: int) -> ReleaseCase:
    """Throw number i by itself."""
    body, contact, hands = batch.body, batch.contact, batch.hands
    assert isinstance(hands, ConstantAccelerations)
    return ReleaseCase(
        Body(float(body.mass[i]), float(body.inertia[i]), float(body.com_offset[i])),
        Contact(float(contact.friction[i]), float(contact.patch_radius[i]), 0.6, 2),
        LinearRelease(100.0, 0.0, float(batch.opening[i])),
        ConstantAcceleration(hands.pose[i], hands.twist[i], hands.acceleration[i]),
    )


def python_loop(case: ReleaseCase, steps: int = 500) -> Release:
    """The paper's way: explicit Euler of the sliding pivot, step by step in Python."""
    law = SlidingPivot(case.body, case.contact, case.gravity)
    dt = case.grip.opening / steps
    state = [0.0] * 6
    for k in range(steps + 1):
        hand = case.hand.at(np.array([k * dt]))
        motion = type(hand.motion)(
            *(float(v[0]) for v in (hand.pose[2], hand.twist[2], *hand.acceleration))
        )
        if k < steps:
            state = euler_step(law.rates, state, [motion], [float(case.grip.force(k * dt))], dt)
    end = np.array(law.com_state(state, hand.pose[:, 0], hand.twist[:, 0], motion))[:, None]
    return Release(hand.times, end[:3], end[3:])


def detach(release: Release) -> np.ndarray:
    """Detach state (6,) of a release."""
    return np.concatenate([release.com[:, -1], release.com_twist[:, -1]])


ROWS: list[tuple[str, int, float, str, str]] = []


def one_by_one(release: Callable[[ReleaseCase], Release], cases: list[ReleaseCase]) -> BatchRelease:
    """The cases alone, one after the other."""
    ends = [detach(release(case)) for case in cases]
    return BatchRelease(np.array(ends), np.zeros(len(ends), bool))


def row(name: str, run: Callable[[], BatchRelease], truth: np.ndarray, repeats: int) -> None:
    """Keep one line: least time of `repeats` runs, and landing error, median / 99 % / worst."""
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        found = run().detach
        seconds.append(time.process_time() - start)
    a, b = land(found, -0.9, 9.81), land(truth[: len(found)], -0.9, 9.81)
    dx, dtheta = 1e3 * np.abs(a[:, 0] - b[:, 0]), np.degrees(np.abs(a[:, 1] - b[:, 1]))
    cells = [" / ".join(f"{np.percentile(e, p):.3f}" for p in (50, 99, 100)) for e in (dx, dtheta)]
    ROWS.append((name, len(found), 1e6 * min(seconds) / len(found), *cells))


def print_rows() -> None:
    """All lines, each with how many of its throws fit into one of the last line's."""
    for name, count, time_each, x, theta in ROWS:
        ratio = ROWS[-1][2] / time_each
        print(f"| {name} | {count} | {time_each:.1f} | {ratio:.2f} | {x} | {theta} |")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--throws", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    batch = random_throws(options.throws, options.seed)
    print(f"throwplan {tp.__version__}, seed {options.seed}, one core\n")
    print("| model | throws | time a throw [us] | times faster | x [mm] | theta [deg] |")
    print("|---|---|---|---|---|---|")
    sharp, settled = (
        throw_sliding_pivot(batch, 1500).detach,
        throw_limit_surface(batch, 2000).detach,
    )
    models = (
        ("sp", throw_sliding_pivot, (27, 32, 48, 96), sharp),
        ("ls-step", throw_limit_surface, (80, 120, 240), settled),
    )
    for name, throw, meshes, truth in models:
        compiled = compiled_steps(name, batch.hands)
        ways = [("", None, 5)] + ([(", compiled", compiled, 15)] if compiled else [])
        for words, even, repeats in ways:
            for steps in meshes:
                run = partial(throw, batch, steps, even=even)
                row(f"{name}, batch, {steps} steps{words}", run, truth, repeats)
    few = [one(batch, i) for i in range(60)]
    singles = (
        ("sp, alone, compiled loop", SlidingPivotRelease().release, sharp),
        ("sp, alone, events located", SlidingPivotRelease(steps=100, events=True).release, sharp),
        ("ls-step, alone", SteppedRelease().release, settled),
        ("ils, LSODA, d = 0.01 (paper's way)", ImplicitRelease().release, settled),
        ("sp, Euler in Python (paper's way)", python_loop, sharp),
    )
    for name, release, truth in singles:
        release(few[0])
        row(name, partial(one_by_one, release, few), truth, 2)
    print_rows()


if __name__ == "__main__":
    main()
