"""What the measured rows say to someone who has to choose a method."""

from __future__ import annotations

from collections.abc import Sequence

from .model_measures import Measured
from .page import Cell, Table

#: Scaled landing errors [m] for which the cheapest settings are told.
ASKED = (1e-3, 1e-4, 1e-5)
#: A scaled landing error [m] that never matters.
NEAR = 1e-4


def choice(measured: Sequence[Measured]) -> list[str | Table]:
    """Per family the cheapest setting that keeps an own error in all four throws."""
    families = dict.fromkeys(row.method.family for row in measured[0].rows)
    rows: list[list[Cell]] = []
    for family in families:
        settings = _settings(measured, family)
        cells: list[Cell] = [family]
        for asked in ASKED:
            able = [s for s in settings if s[2] <= asked and not s[4]]
            name, seconds = min(able, key=lambda s: s[1])[:2] if able else (None, None)
            cells += [name, None if seconds is None else 1e6 * seconds]
        sound = [s for s in settings if not s[4]]
        near = min(sound, key=lambda s: s[3]) if sound else None
        cells += [None if near is None else 1e3 * near[3]]
        reasons = [s[4] for s in settings if s[4]]
        words = f"{len(reasons)} of {len(settings)} settings fail: {reasons[0]}" if reasons else ""
        rows.append([*cells, words])
    columns = ["method"]
    for asked in ASKED:
        columns += [f"to {1e3 * asked:g} mm", "time [µs]"]
    columns += ["best model error [mm]", "failures, the first one's cause"]
    words = (
        "To choose from: the fastest setting whose own scaled landing error is below the figure in "
        "all four throws, its slowest time, and the model error, worst of the four, of the "
        "family's best setting"
    )
    return [Table("models-choice", words, columns, rows), _advice(measured)]


def _settings(
    measured: Sequence[Measured], family: str
) -> list[tuple[str, float, float, float, str]]:
    """Setting, worst time, own and model error over the throws, and trouble, of one family."""
    found = []
    for i, row in enumerate(measured[0].rows):
        if row.method.family == family:
            same = [one.rows[i] for one in measured]
            seconds = max(r.seconds for r in same)
            own = max(float(r.own[3]) for r in same)
            model = max(float(r.model[3]) for r in same)
            trouble = next((r.trouble for r in same if r.trouble), "")
            found.append((row.method.setting, seconds, own, model, trouble))
    return found


def _advice(measured: Sequence[Measured]) -> str:
    """From how many steps on the law, not the steps, decides the error."""
    sentences = []
    for family, law in (("sp, RK4", "sp"), ("ls-step", "ls"), ("ls-step, extrapolated", "ls")):
        able = [
            same
            for same in zip(*(one.rows for one in measured), strict=True)
            if same[0].method.family == family
            and all(
                row.own[3] < max(one.apart(law)[3] / 2, NEAR)
                for row, one in zip(same, measured, strict=True)
            )
        ]
        words = f"no setting of `{family}` has"
        if able:
            slowest = 1e6 * max(row.seconds for row in able[0])
            words = f"`{family}` with {able[0][0].method.setting} ({slowest:.0f} µs) has"
        sentences.append(f"{words} such an own error in all four throws")
    return (
        "The steps no longer matter once the own error is below half of the law's model error, or "
        f"below {1e3 * NEAR:g} mm: {'; '.join(sentences)}. Finer steps bring a law hardly nearer "
        "to the patch."
    )
