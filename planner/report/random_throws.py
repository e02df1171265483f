"""Random throws that the full grip holds, and what the models make of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from ...models.batch import (
    BatchRelease,
    ConstantAccelerations,
    EvenSteps,
    ReleaseBatch,
    throw_limit_surface,
    throw_sliding_pivot,
)
from ...models.contact import Body, Contact, HandMotion, pivot_wrench
from ...models.grip_force import LinearRelease
from ...models.hand_track import ConstantAcceleration
from ...models.limit_surface_release import ImplicitRelease
from ...models.lugre_release import LuGreRelease
from ...models.patch_release import PatchRelease
from ...models.release import Release, ReleaseCase
from ...models.sliding_pivot_release import SlidingPivotRelease
from ..compiled_batch import compiled_steps
from .model_runs import (
    STIFFNESSES,
    SmoothedRelease,
    detached,
    differences,
    micro,
    patch_truth,
    pivot_truth,
    stepped,
    surface_truth,
)
from .page import Cell, Effort, Part, Table

Array = npt.NDArray[np.float64]

GRAVITY = 9.81
#: Of the report's sample.
SEED = 0
#: Share of the ellipsoid that the load may use at full grip: the patch's own limit
#: surface lies up to 6.6 % inside it.
HELD = 0.9
#: So many are drawn for each that is kept.
SPARE = 20
#: What is drawn, in words.
RANGES = (
    "h 2–20 cm, m 0.1–0.4 kg, hand 1–3 m/s, turning at 0–6 rad/s, accelerations to 8 m/s² along "
    "each axis and 20 rad/s², opening 30–100 ms, grip 20–235 N, μ 0.3–1, r_p 2.5–10 mm"
)


def random_throws(count: int, seed: int) -> ReleaseBatch:
    """`count` random throws (RANGES) that the full grip holds; the grip is a 2F-85's.

    Raises ValueError where too few of those drawn are held.
    """
    rng, many = np.random.default_rng(seed), SPARE * count

    def uniform(low: float, high: float) -> Array:
        return rng.uniform(low, high, many)

    mass = uniform(0.1, 0.4)
    body = Body(mass, mass * uniform(0.03, 0.08) ** 2, uniform(0.02, 0.2))
    contact = Contact(uniform(0.3, 1.0), uniform(0.0025, 0.01))
    speed, up, zero = uniform(1.0, 3.0), uniform(np.radians(10), np.radians(70)), np.zeros(many)
    pose = np.array([zero, zero, uniform(-np.pi / 3, np.pi / 2)])
    twist = np.array([speed * np.cos(up), speed * np.sin(up), uniform(0.0, 6.0)])
    acceleration = np.array([uniform(-8, 8), uniform(-8, 8), uniform(-20, 20)])
    full, opening = uniform(20, 235), uniform(0.03, 0.1)
    motion = HandMotion(pose[2], twist[2], *acceleration)
    x_r, z_r = body.com_offset * np.cos(pose[2]), body.com_offset * np.sin(pose[2])
    load = pivot_wrench(body, GRAVITY, motion, twist[2], x_r, z_r)
    held = np.flatnonzero(contact.utilisation_squared(*load, full) < HELD**2)[:count]
    if held.size < count:
        raise ValueError(f"only {held.size} of {many} random throws hold at full grip")
    hands = ConstantAccelerations(pose.T, twist.T, acceleration.T)
    grip = LinearRelease(1.0, 0.0, 1.0)
    return ReleaseBatch(many, body, contact, grip, hands, opening, full, GRAVITY).part(held)


def throw_number(batch: ReleaseBatch, i: int) -> ReleaseCase:
    """Throw number i of `random_throws` by itself."""
    body, contact, hands = batch.body, batch.contact, batch.hands
    if not isinstance(hands, ConstantAccelerations):
        raise TypeError(f"no single throw of {type(hands).__name__}")
    return ReleaseCase(
        Body(*(float(v[i]) for v in (body.mass, body.inertia, body.com_offset))),
        Contact(
            float(contact.friction[i]),
            float(contact.patch_radius[i]),
            contact.torsion,
            contact.faces,
        ),
        LinearRelease(float(batch.force[i]), 0.0, float(batch.opening[i])),
        ConstantAcceleration(hands.pose[i], hands.twist[i], hands.acceleration[i]),
        GRAVITY,
    )


# What the models make of them.


def sample_tables(effort: Effort) -> list[Part]:
    """Batch times over many random throws, own and model errors of the first of them."""
    count, few = effort.of(2048, 10_000), effort.of(5, 100)
    batch = random_throws(count, SEED)
    first = batch.part(np.arange(few))
    cases = [throw_number(batch, i) for i in range(few)]
    truths = {"sp": pivot_truth, "ls": surface_truth, "patch": patch_truth}
    ends = {law: np.array([truth(case) for case in cases]) for law, truth in truths.items()}
    sure = np.isfinite(np.hstack(list(ends.values()))).all(axis=1)
    own: list[list[Cell]] = []
    model: list[list[Cell]] = []
    for name, law, thrown, run in _ways(batch, first, cases, effort):
        seconds, found = _least(run, 2 if thrown < count else effort.of(3, 7))
        came = np.isfinite(found[:few]).all(axis=1)
        good, missed = came & sure, int(few - came.sum())
        cells: list[Cell] = [name, thrown, micro(seconds / thrown)]
        if law in ends:
            own.append([*cells, *_quantiles(found[:few][good], ends[law][good]), missed])
        model.append([*cells, *_quantiles(found[:few][good], ends["patch"][good]), missed])
    columns = ["method", "throws timed", "time a throw [µs]"]
    columns += [
        f"{what}, {q}" for what in ("x [mm]", "θ [deg]") for q in ("median", "99 %", "worst")
    ]
    columns += ["not computed"]
    text = (
        f"Random throws that the full grip holds, seed {SEED}: {RANGES}. Times are of {count} "
        f"throws (single ones: {few}), errors of {sure.sum()} of the first "
        f"{few}, those with converged answers. `sp` steps of a batch are graded "
        "towards the end of the opening and doubled for throws that swing fast; batches of "
        "`ls-step` take so many steps and twice as many, and extrapolate. Compiled rows need a C "
        "compiler. The last column counts throws without an answer."
    )
    words = "Random throws: {} error of the landing, median, 99 % and worst"
    return [
        text,
        Table("models-sample-own", words.format("own"), columns, own),
        Table("models-sample-model", words.format("model"), columns, model),
    ]


def _ways(
    batch: ReleaseBatch, first: ReleaseBatch, cases: Sequence[ReleaseCase], effort: Effort
) -> Iterator[tuple[str, str, int, Callable[[], Array]]]:
    """Name, law, number of throws and how to get their detach states (N, 6)."""
    meshes = {"sp": (12, 27, 48, 96, 192), "ls-step": (40, 80, 120, 240)}
    throwers: dict[str, Callable[..., BatchRelease]] = {
        "sp": throw_sliding_pivot,
        "ls-step": throw_limit_surface,
    }
    for name, steps in meshes.items():
        law, throw = name.split("-")[0], throwers[name]
        for number in steps:
            yield (
                f"{name}, batch, {number} steps, NumPy", law, batch.count,
                partial(_thrown, throw, batch, number, None),
            )  # fmt: skip
        even = compiled_steps(name, batch.hands)
        for number in steps if even else ():
            yield (
                f"{name}, batch, {number} steps, compiled", law, batch.count,
                partial(_thrown, throw, batch, number, even),
            )  # fmt: skip

    def alone(run: Callable[[ReleaseCase], Release]) -> Callable[[], Array]:
        return lambda: np.array([detached(run(case)) for case in cases])

    singles: list[tuple[str, str, Callable[[ReleaseCase], Release]]] = [
        ("sp, alone, RK4, 80 steps", "sp", SlidingPivotRelease(steps=80).release),
        ("sp, alone, RK4, 1000 steps", "sp", SlidingPivotRelease().release),
        (
            "sp, alone, events located, 16 steps",
            "sp",
            SlidingPivotRelease(steps=16, events=True).release,
        ),
        ("sp, alone, ε 0.03, 40 steps", "sp", SmoothedRelease(0.03, 40).release),
        ("ls-step, alone, 1000 steps", "ls", partial(stepped, 1000)),
        ("ils, alone, LSODA, d 0.01 m/s", "ls", ImplicitRelease(samples=2).release),
    ]
    for words, law, run in singles:
        yield words, law, len(cases), alone(run)
    steps_of_points = effort.of(200, 1000)
    yield (
        f"patch, batch, {steps_of_points} steps", "patch", len(cases),
        lambda: PatchRelease(steps=steps_of_points).batch(first),
    )  # fmt: skip
    for stiffness in STIFFNESSES:
        model = LuGreRelease(stiffness=stiffness, steps=steps_of_points)
        words = f"LuGre, batch, σ₀ {stiffness:.0e} 1/m, {steps_of_points} steps".replace("e+0", "e")
        yield words, "LuGre", len(cases), partial(model.batch, first)


def _thrown(
    throw: Callable[..., BatchRelease], batch: ReleaseBatch, steps: int, even: EvenSteps | None
) -> Array:
    return throw(batch, steps, even=even).detach


def _least(run: Callable[[], Array], repeats: int) -> tuple[float, Array]:
    """Least processor time [s] of a few runs after a first one, and its result."""
    found, seconds = run(), []
    for _ in range(repeats):
        start = time.process_time()
        run()
        seconds.append(time.process_time() - start)
    return min(seconds), found


def _quantiles(found: Array, truth: Array) -> list[Cell]:
    """Median, 99 % and worst of |dx| [mm], then of |d theta| [deg]."""
    x, theta = differences(found, truth, GRAVITY, 0.0)[:2]
    cells: list[Cell] = []
    for values in (1e3 * x, np.degrees(theta)):
        cells += [float(v) for v in np.quantile(values, [0.5, 0.99, 1.0])]
    return cells
