"""Section `stability`: extreme scenes, each solved one judged by the oracle, and noisy starts."""

from __future__ import annotations

import collections
import dataclasses
import functools

import numpy as np
from throwplan import Plan, Planner, load_scene, scene_names
from throwplan.models import Array
from throwplan.pictures import Row, Table
from throwplan.planner.ocp import ThrowNlp
from throwplan.planner.search import Exact, Starts, Task, attempt

from .extremes import PATIENCE, CaseOutcome, cases, outcomes, some
from .judge import judge
from .page import Effort, ReportSection
from .processes import ENDINGS, in_processes

#: Outcomes of a plan without a defect.
STATUSES = ("solved", "not_found", "refused")
#: Outcomes that are defects.
DEFECTS = ("traceback", "hang", "crash")
#: Standard deviations of the noise on starts, over each variable's size.
NOISE = (0.01, 0.1, 0.3, 1.0)
#: Number of noisy starts of each size: quick, full.
NOISY = (3, 8)
#: Seed of the noise.
SEED = 3


def make(effort: Effort) -> ReportSection:
    """Extreme cases and noisy starts."""
    chosen_cases = some(20) if effort.quick else cases()
    scenes = {name: load_scene(name) for name in scene_names()}
    # A scene with an uncertain opening is another one's NLP again.
    names = [n for n, s in scenes.items() if s.motion is None and s.uncertainty is None]
    chosen = ["hand-flip", "cup"] if effort.quick else names
    step, found = effort.counter(len(chosen_cases) + len(chosen)), list[CaseOutcome]()
    for outcome in outcomes(chosen_cases):
        found.append(outcome)
        step()
    noisy = list[Row]()
    for name in chosen:
        noisy += noisy_rows(name, effort.of(*NOISY))
        step()
    return ReportSection(
        "stability",
        "Stability",
        [*_figures(found), _noisy_figure(noisy)],
        [
            Table("stability-cases", "Every extreme case", [_case_row(one) for one in found]),
            Table("stability-starts", "Noisy starts", noisy),
        ],
    )


def _case_row(one: CaseOutcome) -> Row:
    seen = one.judgement
    return {
        "case": one.case.name,
        "status": "FALSE solved" if one.false else one.status,
        "oracle's error [mm]": None if seen is None else 1e3 * seen.error,
        "its doubt [mm]": None if seen is None else 1e3 * seen.doubt,
        "iterations": one.iterations,
        "plan [ms]": 1e3 * one.seconds,
        "cause": one.cause,
    }


def _figures(found: list[CaseOutcome]) -> list[str]:
    """Counts, and the worst cases by name."""
    states = collections.Counter(outcome.status for outcome in found)
    said = ", ".join(f"{states[s]} {s}" for s in STATUSES)
    solved = [outcome for outcome in found if outcome.judgement is not None]
    undecided = [outcome.case.name for outcome in solved if outcome.undecided]
    times = np.percentile([outcome.seconds for outcome in found], [50, 95])
    slow = max(found, key=lambda outcome: outcome.seconds)
    text = (
        f"{len(found)} extreme scenes: {said}; tracebacks, hangs and crashes "
        f"{sum(states[s] for s in DEFECTS)}, numbers that are not finite "
        f"{sum(not o.finite for o in found)}. Each solved one is judged by the oracle, "
        f"code of its own: {sum(o.false for o in solved)} are not true, "
        f"{len(undecided)} undecided, where its own error exceeds the tolerance"
    )
    text += f" ({', '.join(undecided)})." if undecided else "."
    return [
        text,
        f"A plan takes {1e3 * times[0]:.0f} ms in the median and {1e3 * times[1]:.0f} ms in 95 %, "
        f"with building; the slowest {slow.seconds:.1f} s ({slow.case.name}, "
        f"{slow.status}).",
    ]


@functools.cache
def _planned(name: str) -> tuple[Planner, Plan]:
    """A built-in scene's planner and plan, once in each process."""
    planner = Planner(load_scene(name), library=False)
    return planner, planner.plan()


def from_noisy_start(name: str, size: float, number: int) -> tuple[str, str]:
    """("true", "false" or "failed", why) of a scene's first solve from its guess with noise on it.

    Each variable gets `size` times its value (at least 0.1) times a normal number; FATROP alone,
    without another start.
    """
    planner, plan = _planned(name)
    rng = np.random.default_rng([SEED, number])
    # A target that moves counts where it is met: the time of arrival comes after the solve.
    target, releases = plan.target.changed(velocity=None, arrival=None), planner.releases()
    task = Task(plan.scene.aimed_at(target), target)
    table = Starts(releases, task, planner.manipulator)
    index, goal, _ = table.nearest[0]
    exact = table.guess(index)

    def noisy(nlp: ThrowNlp) -> Array:
        guess = exact(nlp)
        return guess + size * np.maximum(np.abs(guess), 0.1) * rng.standard_normal(guess.size)

    found = attempt(planner.problems, Exact(goal, noisy), task, rounds=1)
    if found.throw is None or not found.hits:
        return "failed", ", ".join(found.broken) or "no motion keeps all constraints"
    broken = judge(
        dataclasses.replace(plan, scene=task.scene, target=target, throw=found.throw)
    ).broken
    return ("false" if broken else "true"), "; ".join(broken)


def noisy_rows(name: str, count: int) -> list[Row]:
    """A row for each size of the noise."""
    jobs = [(name, size, number) for size in NOISE for number in range(count)]
    answers = list(in_processes(from_noisy_start, jobs, PATIENCE))
    rows = list[Row]()
    for i, size in enumerate(NOISE):
        group = answers[i * count : (i + 1) * count]
        found = [(a, ENDINGS[a]) if isinstance(a, str) else a for a in group]
        kinds = collections.Counter(kind for kind, _ in found)
        causes = collections.Counter(why for _, why in found if why)
        row: Row = {"scene": name, "noise": size, "starts": count}
        row |= {kind: kinds[kind] for kind in ("true", "false", "failed", *ENDINGS)}
        said = "; ".join(f"{n} × {why}" for why, n in causes.most_common(2))
        rows.append(row | {"causes": said or None})
    return rows


def _noisy_figure(rows: list[Row]) -> str:
    """How many plans from noisy starts are solved, and whether that is true."""
    starts = Table("", "", rows)
    kinds = ("starts", "true", "false", "failed", *ENDINGS)
    total = {kind: sum(n for n in starts.column(kind) if isinstance(n, int)) for kind in kinds}
    return (
        "The planner's own guess with noise on every variable (up to 100 %), FATROP alone: of "
        f"{total['starts']} solves {total['true']} are solved and true, {total['false']} solved "
        f"and not true, {total['failed']} not solved, {total['hang'] + total['crash']} hung or "
        "crashed."
    )
