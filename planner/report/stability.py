"""Section "stability": extreme scenes planned and thrown, derivatives, units, noisy guesses."""

from __future__ import annotations

import collections
import math
from typing import Any

import numpy as np

from ...problems import load_scene, scene_names
from .derivative_check import derivative_parts, derivative_rows
from .extreme_runs import PATIENCE, Outcome, outcomes
from .extreme_scenes import SEED, cases, some
from .judge import DOUBLINGS, STEPS
from .noisy_guesses import guess_parts, guess_rows
from .other_units import unit_parts, unit_rows
from .page import Effort, Part, Picture, Section, Table
from .stability_picture import draw

#: Statuses in the order they are counted; the last three are defects.
STATUSES = (
    ("solved", "out_of_reach", "not_converged", "refused"),
    ("traceback", "hang", "crash"),
)
#: What else is measured of each scene: rows, and how they are told.
STUDIES = (
    (derivative_rows, derivative_parts),
    (unit_rows, unit_parts),
    (guess_rows, guess_parts),
)


def make(effort: Effort) -> Section:
    """Extreme cases, derivatives, units and noisy guesses."""
    section = Section("stability", "Stability")
    wanted = some(20) if effort.quick else cases()
    scenes = {name: load_scene(name) for name in scene_names()}
    # A scene with an uncertain opening is another one's NLP again.
    names = [n for n, s in scenes.items() if s.motion is None and s.uncertainty is None]
    chosen = ["hand-flip", "cup"] if effort.quick else names
    total = len(wanted) + len(STUDIES) * len(chosen)
    found: list[Outcome] = []
    for outcome in outcomes(wanted):
        found.append(outcome)
        effort.tell(len(found), total)
    section.add(*_extremes(found))
    section.short.append(_short(found))
    steps = iter(range(len(wanted) + 1, total + 1))
    for measured, told in STUDIES:
        table: list[list[Any]] = []
        for name in chosen:
            table += measured(name, effort)
            effort.tell(next(steps), total)
        section.add(*told(table))
    return section


def _extremes(found: list[Outcome]) -> list[Part]:
    """Counts in words, the table by quantity, all cases, the worst ones, a picture."""
    states = collections.Counter(outcome.status for outcome in found)
    good, bad = STATUSES
    counts = (
        ", ".join(f"{states[s]} {s}" for s in good)
        + "; "
        + ", ".join(f"{states[s]} {s}" for s in bad)
    )
    odd = sum(not outcome.finite for outcome in found)
    false = [outcome for outcome in found if outcome.false]
    solved = [outcome for outcome in found if outcome.verdict is not None]
    undecided = [outcome for outcome in solved if outcome.undecided]
    words = (
        f"{len(found)} extreme scenes, each planned in a fresh planner and, where it is called "
        "solved, judged by other means: the sent motion is thrown again by the planner's check "
        f"and by {STEPS} even steps or more of the models' own sliding pivot, and the force that "
        "holds the bar is taken from second differences of its pose. "
        "Two processes share them, so times are a little longer than alone. "
        f"Status: {counts}. Plans with a number that is not finite: {odd}. Called solved: "
        f"{len(solved) - len(false) - len(undecided)} are judged true, {len(false)} not true, "
        f"{len(undecided)} undecided. A hang is a case of more than {PATIENCE:g} s of processor "
        f"time. Mixtures draw everything at once, seed {SEED}."
    )
    if undecided:
        words += (
            f" Undecided: the even steps, up to {STEPS << DOUBLINGS}, do not settle to the "
            f"tolerance: {', '.join(o.case.name for o in undecided)}."
        )
    parts: list[Part] = [words]
    if solved:
        parts += [_worst(found, solved)]
    parts += [_by_lever(found)]
    columns = [
        "case",
        "status",
        "thrown again [mm]",
        "plain steps [mm]",
        "their doubt [mm]",
        "iterations",
        "plan [ms]",
        "log10 condition, scaled",
        "log10 condition",
        "cause",
    ]
    troubled = [o for o in found if o.status in bad or o.false or not o.finite]
    rest = [o for o in found if o.status not in ("solved", *bad)]
    slow = sorted(solved, key=lambda o: -o.iterations)[:8]
    shown = [*troubled, *rest, *[o for o in slow if o not in troubled]]
    parts.append(
        Table(
            "stability_failures",
            "What failed, with its cause, and the solved cases with most iterations",
            columns,
            [outcome.row() for outcome in shown],
        )
    )
    every = Table("stability_cases", "", columns, [outcome.row() for outcome in found])
    parts.append(Picture("stability", _CAPTION, lambda path: draw(found, path), every))
    return parts


_CAPTION = (
    "Every extreme case: position error of the solved ones by independent steps over the time "
    "of the plan (left), and the condition of their scaled KKT matrix over iterations (right)"
)


def _short(found: list[Outcome]) -> str:
    """What becomes of extreme scenes."""
    states = collections.Counter(outcome.status for outcome in found)
    broken = sum(states[s] for s in STATUSES[1])
    odd = sum(not outcome.finite for outcome in found)
    said = ", ".join(f"{states[s]} {s}" for s in STATUSES[0])
    return (
        f"Of {len(found)} extreme scenes {said}; numbers that are not finite {odd}, solved and not "
        f"true {sum(o.false for o in found)}, tracebacks, hangs and crashes {broken}."
    )


def _worst(found: list[Outcome], solved: list[Outcome]) -> str:
    """The worst cases by name."""

    def most(key: str, among: list[Outcome]) -> Outcome:
        return max(among, key=lambda o: np.nan_to_num(float(getattr(o, key)), nan=-1.0))

    slow, long, ill = most("seconds", found), most("iterations", found), most("scaled", solved)

    def share(outcome: Outcome) -> float:
        verdict = outcome.verdict
        assert verdict is not None
        return verdict.other / outcome.case.scene.tolerance.position

    far = max(solved, key=share)
    assert far.verdict is not None
    times = np.percentile([outcome.seconds for outcome in found], [50, 95])
    return (
        f"Median plan {1e3 * times[0]:.0f} ms, 95 % {1e3 * times[1]:.0f} ms (with building, "
        f"nothing compiled). Slowest: {slow.case.name}, {slow.seconds:.1f} s ({slow.status}). "
        f"Most iterations: {long.case.name}, {long.iterations} ({long.status}). Worst solved "
        f"condition: {ill.case.name}, {ill.scaled:.1e} scaled, {ill.raw:.1e} as it is. Solved "
        f"nearest its tolerance by the independent steps: {far.case.name}, "
        f"{1e3 * far.verdict.other:.3g} mm of {1e3 * far.case.scene.tolerance.position:g} mm."
    )


def _by_lever(found: list[Outcome]) -> Table:
    """Counts and medians by what is extreme."""
    groups: dict[str, list[Outcome]] = collections.defaultdict(list)
    for outcome in found:
        groups[outcome.case.lever].append(outcome)
    rows = []
    for lever, group in groups.items():
        states = collections.Counter(outcome.status for outcome in group)
        true = [o for o in group if o.verdict is not None]
        errors = [o.verdict.other for o in true if o.verdict is not None]
        rows.append(
            [
                lever,
                len(group),
                *(states[s] for s in STATUSES[0]),
                sum(states[s] for s in STATUSES[1]),
                sum(o.false for o in group),
                1e3 * max(errors, default=math.nan),
                float(np.median([o.iterations for o in true])) if true else None,
                max((o.log_scaled for o in true), default=math.nan),
            ]
        )
    columns = ["far out", "cases", *STATUSES[0], "defects", "false solved"]
    columns += ["worst error [mm]", "iterations (median)", "worst log10 condition, scaled"]
    return Table("stability_levers", "The extreme cases by what is far out", columns, rows)
