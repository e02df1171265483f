"""What the measured rows say to someone who has to choose a method."""

from __future__ import annotations

from collections.abc import Sequence

from .model_measures import Measured
from .model_runs import Method
from .page import Cell, Table, shown

#: Scaled landing errors [m] for which the cheapest settings are told.
ASKED = (1e-3, 1e-4, 1e-5)
#: A scaled landing error [m] that never matters.
NEAR = 1e-4


def choice(measured: Sequence[Measured]) -> list[str | Table]:
    """Per family the cheapest setting that keeps an own error in all four throws."""
    rows: list[list[Cell]] = []
    for family in dict.fromkeys(_kind(row.method) for row in measured[0].rows):
        settings = _settings(measured, family)
        cells: list[Cell] = [family]
        for asked in ASKED:
            able = [s for s in settings if s[2] <= asked and not s[4]]
            best = min(able, key=lambda s: s[1]) if able else None
            cells += [None] * 3 if best is None else [best[0], 1e6 * best[1], 1e3 * best[3]]
        reasons = [s[4] for s in settings if s[4]]
        words = (
            f"{len(reasons)} of {len(settings)} settings fail: {reasons[0]}" if reasons else None
        )
        rows.append([*cells, words])
    columns = ["method"]
    for asked in ASKED:
        to = f"to {1e3 * asked:g} mm"
        columns += [to, f"{to}: time [µs]", f"{to}: model error [mm]"]
    columns += ["failures, the first one's cause"]
    words = (
        "To choose from: the fastest setting whose own scaled landing error is below the figure in "
        "all four throws, its slowest time, and its own model error, worst of the four"
    )
    return [Table("models-choice", words, columns, rows), _advice(measured)]


def single(measured: Sequence[Measured]) -> str:
    """In short: what to take for one release."""
    words = []
    for family, why in (
        ("sp, RK4", "fast"),
        ("ls-step, extrapolated", "near the patch"),
        ("patch", "the measure itself"),
    ):
        able = [s for s in _settings(measured, family) if s[2] <= NEAR and not s[4]]
        if able:
            name, seconds, _, model, _ = min(able, key=lambda s: s[1])
            words.append(
                f"`{family}` with {name} ({why}): {shown(1e3 * seconds)} ms, at most "
                f"{1e3 * model:.2g} mm of scaled landing error from the patch"
            )
    return (
        f"One release to {1e3 * NEAR:g} mm of its own law, worst of four throws: "
        f"{'; '.join(words)}. "
        "`throwplan simulate SCENE` runs them side by side, `--model patch` is the check to trust."
    )


def _kind(method: Method) -> str:
    """Family; bristles of every stiffness are a law of their own."""
    return method.setting.split(",")[0] if method.family == "LuGre" else method.family


def _settings(
    measured: Sequence[Measured], family: str
) -> list[tuple[str, float, float, float, str]]:
    """Setting, worst time, own and model error over the throws, and trouble, of one family."""
    found = []
    for i, row in enumerate(measured[0].rows):
        if family in (row.method.family, _kind(row.method)):
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
