"""Section `stability`: extreme scenes; the oracle judges each that is solved."""

from __future__ import annotations

import collections

from throwplan.pictures import Row, Table

from .extremes import CaseOutcome, cases, outcomes
from .measure import quantiles
from .page import Effort, Section

#: A quick run has each so many-th case.
QUICK = 25


def make(effort: Effort) -> Section:
    """All extreme cases; a row for each base scene, and one for all."""
    chosen = cases()[:: effort.of(QUICK, 1)]
    step, found = effort.counter(len(chosen)), list[CaseOutcome]()
    for outcome in outcomes(chosen):
        found.append(outcome)
        step()
    bases = dict.fromkeys(one.case.base for one in found)
    rows = [_row(base, [one for one in found if one.case.base == base]) for base in bases]
    undecided = [one.case.name for one in found if one.undecided]
    slowest = max(found, key=lambda one: one.seconds)
    wrong = [one for one in found if one.is_defect or one.false]
    causes = "; ".join(f"`{one.case.name}` ({one.cause or one.status})" for one in wrong)
    notes = [f"Slowest: `{slowest.case.name}`, {slowest.seconds:.1f} s, {slowest.status}."]
    notes += [f"Undecided: {'; '.join(undecided)}."] if undecided else []
    notes += [f"Defects, wrong: {causes}."] if wrong else []
    return Section(
        "Stability",
        "Stiff and extreme scenes: one number far from the usual (masses of 0.1 g to 50 kg, "
        "friction of 0.01 to 30, openings of 10 µs to 1 s), then all at random. Each solved plan "
        "is thrown by the oracle, an independent program: *wrong* breaks a limit or misses, "
        "*undecided* is one where the oracle's own error exceeds the tolerance. *Defects* are "
        "tracebacks, hangs, crashes, and numbers that are not finite. Times are by the clock, with "
        "building.",
        [Table("stability", "Extreme scenes", [*rows, _row("all", found)])],
        [Table("stability-cases", "every case", [_case_row(one) for one in found])],
        notes=notes,
    )


def _row(name: str, found: list[CaseOutcome]) -> Row:
    """Counts and times of some cases."""
    states = collections.Counter(one.status for one in found)
    median, slow = quantiles([one.seconds for one in found], 50, 95)
    return {
        "changed scene": name,
        "cases": len(found),
        **{status: states[status] for status in ("solved", "not_found", "refused")},
        "defects": sum(one.is_defect for one in found),
        "wrong": sum(one.false for one in found),
        "undecided": sum(one.undecided for one in found),
        "plan, median [s]": median,
        "95 % [s]": slow,
    }


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
