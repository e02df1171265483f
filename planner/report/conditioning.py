"""How well posed a scene's NLP is: its KKT matrix, its derivatives, units, and the guess.

The names `..._rows` are what is measured of one scene; `..._parts` say it in words and a table.
"""

from __future__ import annotations

import collections
import dataclasses
import functools
import math
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems.load import load_scene
from ...problems.scene import Scene
from ..check import limit_surface_throw, throw
from ..context import Guard
from ..correction import Search, attempt
from ..derivatives import nlp_functions
from ..guess import guess_from
from ..motion import PlannedMotion
from ..mover import make_mover
from ..nlp import ThrowNlp, build_nlp
from ..numbers import bounds, parameter_values, structure_of
from ..plan import Plan, PlannedThrow
from ..planner import Planner
from ..window import window_of
from .extreme_scenes import STEPS, judged
from .page import Effort, Table

Array = npt.NDArray[np.float64]

#: Multipliers and distances from bounds are taken to be at least this.
LEAST = 1e-9
#: Rounds of scaling rows and columns to a largest entry of one.
ROUNDS = 12
#: Steps of differences along a random direction of length one per variable.
NEAR, FAR = 2e-7, 4e-7
#: Sizes of the noise on guesses.
NOISE = (0.01, 0.1, 0.3, 1.0)
SEED = 3
#: A solve from a noisy guess that takes longer than this [s] is a hang.
GUESS_PATIENCE = 6.0
#: What a process may take to start [s].
STARTING = 60.0
#: How a process can end without an answer, in words.
ENDINGS = {"hang": "no answer in time: process ended", "crash": "its process died"}
GUARDS: frozenset[Guard] = frozenset({"carry", "flight"})


def kkt_matrix(thrown: PlannedThrow) -> Array:
    """The interior-point KKT matrix at the throw's solution, symmetric, dense.

    [W + D, A'; A, -E]: W the Lagrangian's Hessian, A the constraints' Jacobian, D the bounds'
    and E the inequality rows' multiplier over distance, and the inverse of that.
    """
    scene, mover, nlp, at = thrown.scene, thrown.mover, thrown.nlp, thrown.solution
    target = scene.target
    assert target is not None
    window = window_of(scene) if nlp.structure.robust else None
    goal = target.in_plane(target.plane_x + thrown.aim[0], target.turned(thrown.aim[1]).theta)
    numbers = nlp.parameters.vector(parameter_values(scene, mover, goal, window, thrown.room))
    functions = nlp_functions(nlp, "fatrop")
    hessian = functions["nlp_hess_l"](at.x, numbers, 1.0, at.lam_g)[1].full()
    g, jacobian = (part.full() for part in functions["nlp_jac_g"](at.x, numbers))
    low, high = bounds(nlp, scene, mover, window)
    near = np.minimum(at.x - low, high - at.x)
    pull = np.where(np.isfinite(near), _floor(at.lam_x) / _floor(near), 0.0)
    values = g.ravel()
    slack = np.minimum(values - nlp.lbg, nlp.ubg - values)
    equal = nlp.lbg == nlp.ubg
    give = np.where(equal, 0.0, _floor(slack) / _floor(at.lam_g))
    return np.block([[hessian + np.diag(pull), jacobian.T], [jacobian, -np.diag(give)]])


def _floor(values: Array) -> Array:
    return np.maximum(np.abs(values), LEAST)


def condition(matrix: Array) -> tuple[float, float]:
    """Condition (1-norm) of a symmetric matrix: as it is, and with rows and columns scaled."""
    scaled = matrix.copy()
    for _ in range(ROUNDS):
        size = np.sqrt(np.maximum(np.abs(scaled).max(axis=0), 1e-300))
        scaled /= size[:, None] * size[None, :]
    raw, better = (float(np.linalg.cond(m, 1)) for m in (matrix, scaled))
    return raw, better


def structures(scene: Scene, everything: bool) -> Iterator[tuple[str, ThrowNlp, Array]]:
    """(what, NLP, parameters) of a scene: usual; also guarded, quiet and with scenarios."""
    mover, target = make_mover(scene), scene.target
    assert target is not None
    kinds: list[tuple[str, frozenset[Guard], str]] = [("usual", frozenset(), "")]
    if everything:
        kinds += [("guarded", GUARDS, ""), ("quiet", frozenset(), "quiet")]
        kinds += [("guarded, scenarios", GUARDS, "scenarios")]
    for words, guards, robust in kinds:
        window = window_of(scene) if robust else None
        angle = target.theta is not None
        structure = structure_of(scene, mover, angle, guards=guards, robust=robust, window=window)
        nlp = build_nlp(structure, mover)
        yield words, nlp, nlp.parameters.vector(parameter_values(scene, mover, target, window))


def derivative_errors(
    nlp: ThrowNlp, numbers: Array, limits: tuple[Array, Array], points: int, seed: int
) -> tuple[float, float]:
    """Largest relative error of first and of second derivatives at random points.

    Along random directions, against central differences of fourth order; relative to the
    largest component. The points are anywhere in the middle half of the bounds.
    """
    functions = nlp_functions(nlp, "fatrop")
    rng = np.random.default_rng(seed)
    low, high = (np.clip(side, -1.0, 1.0) for side in limits)
    worst = [0.0, 0.0]
    for _ in range(points):
        x = low + (high - low) * rng.uniform(0.25, 0.75, low.size)
        multipliers = rng.standard_normal(nlp.size[1])
        way = rng.standard_normal(x.size)
        slope = functions["nlp_jac_g"](x, numbers)[1].full() @ way
        cost = functions["nlp_grad_f"](x, numbers).full().ravel() @ way
        curvature = functions["nlp_hess_l"](x, numbers, 1.0, multipliers)[1].full() @ way

        def values(at: Array) -> Array:
            g = functions["nlp_g"](at, numbers)
            return np.append(np.array(g), float(functions["nlp_f"](at, numbers)))

        def gradient(at: Array, multipliers: Array = multipliers) -> Array:
            return np.array(functions["nlp_grad"](at, numbers, 1.0, multipliers)[2]).ravel()

        for i, (function, exact) in enumerate(
            ((values, np.append(slope, cost)), (gradient, curvature))
        ):
            near, far = (
                (function(x + step * way) - function(x - step * way)) / (2 * step)
                for step in (NEAR, FAR)
            )
            error = np.abs((4 * near - far) / 3 - exact).max() / np.abs(exact).max()
            worst[i] = max(worst[i], float(error))
    return worst[0], worst[1]


def in_other_units(scene: Scene, mass: float, length: float = 1.0) -> Scene:
    """The same throw where a mass reads `mass` times as much and a length `length` times.

    Times stay. Lengths only of a free hand's scene: an arm has its own.
    """
    force = scene.gripper.force
    assert force is not None
    thing, contact, tolerance = scene.object, scene.contact, scene.tolerance
    changed = scene.replace(
        object=dataclasses.replace(
            thing,
            mass=mass * thing.mass,
            inertia=mass * length**2 * thing.inertia,
            length=length * thing.length,
            com=length * thing.com,
            width=length * thing.width,
        ),
        grasp=dataclasses.replace(scene.grasp, offset=length * scene.grasp.offset),
        contact=dataclasses.replace(contact, patch_radius=length * contact.patch_radius),
        gripper=dataclasses.replace(scene.gripper, force=mass * length * force),
        tolerance=dataclasses.replace(tolerance, position=length * tolerance.position),
        gravity=length * scene.gravity,
    )
    hand, target = scene.hand, scene.target
    if length == 1.0 or hand is None or target is None:
        return changed
    start = None if hand.start is None else (length * hand.start[0], length * hand.start[1])
    return changed.replace(
        target=dataclasses.replace(target, x=length * target.x, z=length * target.z),
        hand=dataclasses.replace(
            hand,
            x=(length * hand.x[0], length * hand.x[1]),
            z=(length * hand.z[0], length * hand.z[1]),
            speed=length * hand.speed,
            acceleration=length * hand.acceleration,
            start=start,
        ),
    )


@functools.cache
def _planned(name: str) -> tuple[Planner, Plan]:
    """A built-in scene's planner and plan, once in each process."""
    planner = Planner(load_scene(name), compiling="no")
    return planner, planner.plan()


def from_noisy_guess(name: str, size: float, number: int) -> tuple[str, str]:
    """("true", "false" or "failed", why) of a scene's solve from its guess with noise on it.

    Each variable gets `size` times the largest value of its kind in the guess (at least 0.1)
    times a normal number; FATROP alone, no second start.
    """
    planner, plan = _planned(name)
    rng = np.random.default_rng([SEED, number])
    target, releases = plan.target, planner.releases()
    index, goal, _ = planner.starts(target)[0]
    scene = plan.scene.aimed_at(target)
    flight = float(releases.landings(goal.z, scene.gravity)[2][index])
    search = Search(scene)
    nlp = planner.bench.nlp(goal, search)
    guess = guess_from(nlp, scene, planner.mover, releases, index, flight)
    noise = size * np.maximum(_spread(nlp, guess), 0.1) * rng.standard_normal(guess.size)
    problem = planner.bench.problem(goal, "fatrop", search)
    thrown = attempt(problem, planner.mover, goal, guess + noise, search)
    if thrown is None:
        return "failed", "; ".join(search.trouble)
    wrong = judged(thrown, target, STEPS // 4).wrong
    return ("false" if wrong else "true"), "; ".join(wrong)


def _spread(nlp: ThrowNlp, guess: Array) -> Array:
    """Largest size of each variable's kind in the guess."""
    largest: dict[str, float] = {}
    for name, _, where in nlp.layout:
        largest[name] = max(largest.get(name, 0.0), float(np.abs(guess[where]).max(initial=0.0)))
    return nlp.fill(lambda name, _: largest[name])


def derivative_rows(name: str, effort: Effort) -> list[list[Any]]:
    """One row per structure of a scene."""
    scene, rows = load_scene(name), []
    mover = make_mover(scene)
    for words, nlp, numbers in structures(scene, not effort.quick):
        window = window_of(scene) if nlp.structure.robust else None
        limits = bounds(nlp, scene, mover, window)
        errors = derivative_errors(nlp, numbers, limits, effort.of(2, 5), SEED)
        rows.append([name, words, *nlp.size, *errors])
    return rows


def derivative_parts(rows: list[list[Any]]) -> list[Any]:
    """The derivatives' errors, worst first in words."""
    worst = [max(row[i] for row in rows) for i in (4, 5)]
    words = (
        "Derivatives, put together stage by stage, against central differences of fourth order "
        f"along random directions at random points (seed {SEED}): the largest relative "
        f"difference is {worst[0]:.1e} for first and {worst[1]:.1e} for second derivatives."
    )
    columns = ["scene", "NLP", "variables", "constraints", "first", "second"]
    return [words, Table("stability_derivatives", "Relative differences", columns, rows)]


def unit_rows(name: str, effort: Effort) -> list[list[Any]]:
    """A scene in other units of mass, a free hand's also in other units of length."""
    scene = load_scene(name)
    plan = Planner(scene, compiling="no").plan()
    rows = []
    lengths = () if scene.hand is None else ((1.0, 0.1), (1.0, 10.0))
    for mass, length in ((1e-3, 1.0), (1e3, 1.0), *lengths):
        changed = in_other_units(scene, mass, length)
        moved = [
            abs(new.landing.x / length - old.landing.x)
            for new, old in _both_models(plan, changed, length)
        ]
        other = Planner(changed, compiling="no").plan()
        landed = math.nan
        if plan.throw is not None and other.throw is not None:
            landed = abs(other.throw.final.landing.x / length - plan.throw.final.landing.x)
        iterations = f"{plan.iterations} → {other.iterations}"
        rows.append([name, mass, length, *moved, other.status, landed, iterations])
    return rows


def _both_models(plan: Plan, changed: Scene, length: float) -> Iterator[tuple[Any, Any]]:
    """The plan's motion thrown by both models in the new units and in the old."""
    thrown = plan.throw
    assert thrown is not None and changed.target is not None
    motion = thrown.planned if thrown.sent is None else thrown.samples
    mover, scaled = make_mover(changed), motion
    if length != 1.0 and isinstance(motion, PlannedMotion):
        by = np.where(np.arange(mover.size) < 2, length, 1.0)
        q, dq, ddq, jerk = (by * v for v in (motion.q, motion.dq, motion.ddq, motion.jerk))
        scaled = PlannedMotion(motion.times, q, dq, ddq, jerk)
    for model in (throw, limit_surface_throw):
        new = model(changed, mover, scaled, thrown.opening_time, changed.target.z)
        old = model(plan.scene, plan.mover, motion, thrown.opening_time, plan.target.z)
        yield new, old


def unit_parts(rows: list[list[Any]]) -> list[Any]:
    """What other units move."""
    same = max(max(row[3], row[4]) for row in rows)
    mass = [row[6] for row in rows if row[2] == 1.0]
    length = [row[6] for row in rows if row[2] != 1.0]
    states = collections.Counter(row[5] for row in rows)
    words = (
        "The same throws in other units: numbers for mass (mass, inertia, grip force) and length "
        "(all geometry, gravity, speeds, accelerations; free hands only) multiplied. A given "
        f"motion's landing by the two exact models moves by {same:.1e} m at most. Planned anew "
        f"({', '.join(f'{n} {s}' for s, n in states.items())}), the landing moves by "
        f"{np.nanmax(mass):.1e} m at most with mass"
    )
    if length:
        words += (
            f", and by {np.nanmax(length):.1e} m with length: the planner's weights and "
            "correction are in metres, so it takes another throw inside the same tolerance"
        )
    columns = ["scene", "mass ×", "length ×", "sliding pivot moves [m]", "limit surface moves [m]"]
    columns += ["planned anew", "landing moves [m]", "iterations"]
    return [words + ".", Table("stability_units", "Other units, same throw", columns, rows)]


def guess_rows(name: str, effort: Effort) -> list[list[Any]]:
    """The planner's guess for a scene with noise of several sizes."""
    rows, count = [], effort.of(3, 8)
    jobs = [(name, size, number) for size in NOISE for number in range(count)]
    answers = list(in_turn(from_noisy_guess, jobs, GUESS_PATIENCE))
    for i, size in enumerate(NOISE):
        group = answers[i * count : (i + 1) * count]
        kinds = collections.Counter(a if isinstance(a, str) else a[0] for a in group)
        causes = collections.Counter(
            ENDINGS[a] if isinstance(a, str) else (a[1] or "no cause given")
            for a in group
            if isinstance(a, str) or a[0] != "true"
        )
        said = "; ".join(f"{n} × {why}" for why, n in causes.most_common(2))
        ended = kinds["hang"] + kinds["crash"]
        rows.append(
            [name, size, count, kinds["true"], kinds["failed"], kinds["false"], ended, said]
        )
    return rows


def guess_parts(rows: list[list[Any]]) -> list[Any]:
    """How many noisy guesses lead to a throw, and whether that is true."""
    total, true, failed, wrong, ended = (sum(row[i] for row in rows) for i in range(2, 7))
    words = (
        f"The planner's guess with noise on every variable (seed {SEED}), FATROP alone without "
        f"another start: of {total} runs {true} are solved and true, {failed} say that they "
        f"failed and why, {wrong} are called solved and are not, {ended} hung or crashed (over "
        f"{GUESS_PATIENCE:g} s inside FATROP, in a process that was then ended)."
    )
    columns = [
        "scene",
        "noise",
        "runs",
        "solved, true",
        "failed",
        "solved, false",
        "hung",
        "causes",
    ]
    caption = "Noise is a share of the largest value of each kind of variable in the guess"
    return [words, Table("stability_guesses", caption, columns, rows)]


# Work in a process that can be ended: a solver that hangs in compiled code hears no exception.


def in_turn(
    work: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], patience: float
) -> Iterator[Any]:
    """work(*job) for each job in one other process; "hang" or "crash" where that gives nothing.

    patience [s]: for one job; the process is then ended and another one goes on.
    """
    left = list(jobs)
    while left:
        # Spawned: forking a process whose libraries have threads is not safe.
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there, work, left), daemon=True)
        with _one_thread():
            process.start()
        there.close()
        try:
            # The first answer is that it is there: starting is not the job's own time.
            answered = here.poll(patience + STARTING) and here.recv() is None
            while left and answered:
                answer = "hang"
                try:
                    answered = here.poll(patience)
                    if answered:
                        answer = here.recv()
                except EOFError:
                    answer, answered = "crash", False
                left.pop(0)
                yield answer
        finally:
            process.kill()
            process.join()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes started here compute with one thread: small matrices are slower with more."""
    name = "OPENBLAS_NUM_THREADS"
    before = os.environ.get(name)
    os.environ[name] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def _work(there: Connection, work: Callable[..., Any], jobs: Sequence[tuple[Any, ...]]) -> None:
    # Hundreds of release tables that nobody needs again stay out of the user's cache.
    os.environ["THROWPLAN_CACHE"] = ""
    there.send(None)
    for job in jobs:
        there.send(work(*job))
