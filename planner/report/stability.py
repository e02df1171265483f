"""Section "stability": extreme scenes planned and thrown, derivatives, units, noisy guesses."""

from __future__ import annotations

import collections
import dataclasses
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...problems.errors import InputError
from ...problems.load import load_scene, scene_names
from ..plan import Plan
from ..planner import Planner
from . import conditioning as study
from .extreme_scenes import STEPS, Case, Verdict, cases, judged, some
from .page import Cell, Effort, Part, Picture, Section, Table

#: A case that takes longer than this [s] is a hang; its process is ended.
PATIENCE = 120.0
#: Statuses in the order they are counted; the last three are defects.
STATUSES = (
    ("solved", "out_of_reach", "not_converged", "refused"),
    ("traceback", "hang", "crash"),
)
#: What else is measured of each scene: rows, and how they are told.
STUDIES = (
    (study.derivative_rows, study.derivative_parts),
    (study.unit_rows, study.unit_parts),
    (study.guess_rows, study.guess_parts),
)


# One case after the other, in a process that can be ended.


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What became of one case. cause: in words, why it is not solved, or not truly.

    raw, scaled: condition of the KKT matrix as it is, and equilibrated; seconds: the plan.
    """

    case: Case
    status: str
    cause: str = ""
    verdict: Verdict | None = None
    finite: bool = True
    iterations: int = 0
    seconds: float = math.nan
    raw: float = math.nan
    scaled: float = math.nan

    @property
    def false(self) -> bool:
        """Whether it is called solved and is not."""
        return self.verdict is not None and bool(self.verdict.wrong)

    @property
    def log_scaled(self) -> float:
        """Decimal logarithm of the scaled condition; NaN where there is none."""
        return math.log10(self.scaled)

    def row(self) -> list[Cell]:
        """Its line in the table."""
        error = (math.nan,) * 3
        if self.verdict is not None:
            error = (self.verdict.miss, self.verdict.other, self.verdict.doubt)
        status = "FALSE solved" if self.false else self.status
        numbers = [self.iterations, 1e3 * self.seconds, self.log_scaled, math.log10(self.raw)]
        words = self.cause if len(self.cause) < 160 else self.cause[:157] + "…"
        return [self.case.name, status, *(1e3 * e for e in error), *numbers, words]


def run(case: Case) -> Outcome:
    """Plans one case, throws it again, looks at its KKT matrix."""
    start = time.perf_counter()
    try:
        planner = Planner(case.scene, compiling="no")
        plan = planner.plan(case.target(planner))
    except InputError as error:
        return Outcome(case, "refused", str(error), seconds=time.perf_counter() - start)
    except Exception as error:
        words = f"{type(error).__name__}: {error}"
        return Outcome(case, "traceback", words, seconds=time.perf_counter() - start)
    seconds = time.perf_counter() - start
    verdict, cause, conditions = None, plan.message, (math.nan, math.nan)
    if plan.solved and plan.throw is not None:
        verdict = judged(plan.throw, plan.target)
        cause = "; ".join(verdict.wrong)
        conditions = study.condition(study.kkt_matrix(plan.throw))
    whole = finite(plan)
    return Outcome(case, plan.status, cause, verdict, whole, plan.iterations, seconds, *conditions)


def finite(plan: Plan) -> bool:
    """Whether every number that the plan stands for is one."""
    found: list[Any] = []
    if plan.nearest is not None:
        found += [plan.nearest.x, plan.nearest.z, plan.nearest.theta or 0.0]
    if plan.solved and plan.throw is not None:
        thrown = plan.throw
        found += [thrown.solution.x, thrown.solution.lam_g, thrown.planned_landing]
        found += [thrown.samples.q, thrown.samples.dq, thrown.samples.ddq, plan.error_sent()]
        found += [thrown.final.release.com, thrown.final.release.com_twist]
    return all(bool(np.isfinite(np.asarray(value, float)).all()) for value in found)


def outcomes(wanted: Sequence[Case], patience: float = PATIENCE) -> Iterator[Outcome]:
    """All cases in turn."""
    answers = study.in_turn(run, [(case,) for case in wanted], patience)
    for case, answer in zip(wanted, answers, strict=True):
        if isinstance(answer, Outcome):
            yield answer
        else:
            yield Outcome(case, answer, study.ENDINGS[answer], seconds=patience)


# The section.


def make(effort: Effort) -> Section:
    """Extreme cases, derivatives, units and noisy guesses."""
    section = Section("stability", "Stability")
    wanted = some(40) if effort.quick else cases()
    names = [name for name in scene_names() if load_scene(name).motion is None]
    chosen = ["hand-flip", "cup"] if effort.quick else names
    total = len(wanted) + len(STUDIES) * len(chosen)
    found: list[Outcome] = []
    for outcome in outcomes(wanted):
        found.append(outcome)
        effort.tell(len(found), total)
    section.add(*_extremes(found))
    steps = iter(range(len(wanted) + 1, total + 1))
    for measured, told in STUDIES:
        table = []
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
    words = (
        f"{len(found)} extreme scenes, each planned in a fresh planner and, where it is called "
        "solved, judged by other means: the sent motion is thrown again by the planner's check "
        f"and by {STEPS} even steps of the models' own sliding pivot, and the force that holds "
        "the bar is taken from second differences of its pose. "
        f"Status: {counts}. Plans with a number that is not finite: {odd}. Called solved but "
        f"not true: {len(false)}. A hang is a case of more than {PATIENCE:g} s."
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
    parts.append(Picture("stability", _CAPTION, lambda path: _draw(found, path)))
    return parts


_CAPTION = (
    "Every extreme case: position error of the solved ones by independent steps over the time "
    "of the plan (left), and the condition of their scaled KKT matrix over iterations (right)"
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


def _draw(found: list[Outcome], path: Path) -> None:
    """Error over time, and condition over iterations, of the extreme cases."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    from ..sweep_pictures import BLUE, GREEN, GREY, RED

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), constrained_layout=True)
    kinds = (("free hand", GREEN, False), ("Panda", BLUE, True))
    floor = 1e-7
    for label, colour, robot in kinds:
        some = [o for o in found if (o.case.scene.robot is not None) == robot]
        solved = [(o, o.verdict) for o in some if o.verdict is not None]
        errors = [max(1e3 * verdict.other, floor) for _, verdict in solved]
        left.loglog([o.seconds for o, _ in solved], errors, "o", ms=4, color=colour, label=label)
        counts = [max(o.iterations, 1) for o, _ in solved]
        right.loglog(counts, [o.scaled for o, _ in solved], "o", ms=4, color=colour, label=label)
    failed = [o.seconds for o in found if o.status not in ("solved", "refused")]
    left.plot(failed, [20.0] * len(failed), "x", ms=5, color=GREY, label="not solved (no error)")
    false = [(o.seconds, 1e3 * o.verdict.other) for o in found if o.verdict and o.false]
    left.plot(*zip(*false, strict=True) if false else ((), ()), "s", color=RED, label="false")
    left.set(xlabel="plan, with building [s]", ylabel="position error by independent steps [mm]")
    right.set(xlabel="iterations", ylabel="condition of the scaled KKT matrix")
    # Labels within less than two decades would overlap.
    left.xaxis.set_minor_formatter(NullFormatter())
    for axis in (left, right):
        axis.grid(alpha=0.3)
        axis.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=120)
    plt.close(figure)
