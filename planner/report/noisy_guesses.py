"""What becomes of a solve whose guess has noise on it."""

from __future__ import annotations

import collections
import dataclasses
import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems import load_scene
from ..ocp import ThrowNlp
from ..plan import Planner
from ..result import Plan
from ..search import Task, attempts, release_start, starts
from .in_turn import ENDINGS, shared
from .judge import STEPS, judged
from .page import Effort, Table

Array = npt.NDArray[np.float64]
#: Sizes of the noise on guesses.
NOISE = (0.01, 0.1, 0.3, 1.0)
SEED = 3
#: A solve from a noisy guess that takes longer than this [s] is a hang.
GUESS_PATIENCE = 6.0


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
    scene = plan.scene.aimed_at(target)
    task = Task(scene, target, ("fatrop",))
    index, goal, _ = starts(releases, scene, target, "exact", 1)[0]
    start = release_start(planner.problems, task, releases, index, goal)

    def noisy(nlp: ThrowNlp) -> Array:
        guess = start.guess(nlp)
        return guess + size * np.maximum(_spread(nlp, guess), 0.1) * rng.standard_normal(guess.size)

    start = dataclasses.replace(start, guess=noisy, tries=1)
    attempt = next(attempts(planner.problems, start, task))
    thrown = attempt.throw
    if thrown is None or not attempt.solved:
        return "failed", attempt.reason
    wrong = judged(thrown, target, STEPS // 4).wrong
    return ("false" if wrong else "true"), "; ".join(wrong)


def _spread(nlp: ThrowNlp, guess: Array) -> Array:
    """Largest size of each variable's kind in the guess."""
    largest: dict[str, float] = {}
    for name, _, where in nlp.layout:
        largest[name] = max(largest.get(name, 0.0), float(np.abs(guess[where]).max(initial=0.0)))
    return nlp.fill(lambda name, _: largest[name])


def guess_rows(name: str, effort: Effort) -> list[list[Any]]:
    """The planner's guess for a scene with noise of several sizes."""
    rows, count = [], effort.of(3, 8)
    jobs = [(name, size, number) for size in NOISE for number in range(count)]
    answers = list(shared(from_noisy_guess, jobs, GUESS_PATIENCE))
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
