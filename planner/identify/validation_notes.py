"""What a reader of a validation's tables must know beside them."""

from __future__ import annotations

import numpy as np

from .grid import MISSED
from .validation import GUIDE, ModelCheck, Validation


def head(found: Validation) -> list[str]:
    """What the data are."""
    data = found.data
    apart = len(data.throws) - len(found.batch)
    kinds = len({found.conditions[i] for i in found.batch})
    lines = [f"{data.name}: {len(found.batch)} throws of {kinds} conditions"]
    if apart:
        lines[0] += f", and {apart} that vary one factor"
    if data.shared.synthetic:
        words = data.shared.synthetic.rstrip(".")
        lines.append(
            f"SYNTHETIC data: {words}. They tell how models differ, not how well they "
            "predict real throws"
        )
    return lines


def notes(found: Validation) -> list[str]:
    """What is left out, what is less than it seems, and why."""
    lines = [*found.left_out]
    for check in found.checks.values():
        lines += _of_model(found, check)
    surfaces = [name for name in next(iter(found.checks.values())).parameters if name]
    if surfaces:
        lines.append(
            f"surface: parameters for {', '.join(surfaces)} are identified anew, on the throws "
            "that are then judged"
        )
    if not found.tracked:
        lines.append("no tracks: v_x, omega and the case study are left out")
    if all(check.crossed is None for check in found.checks.values()):
        lines.append("cross-validation: left out, it needs 5 throws of 2 conditions")
    tests = 2 * sum(len(group) for group in found.factors)
    if tests:
        lines.append(
            f"factors: {tests} tests; where nothing differs one in twenty gets a star by chance"
        )
    return lines


def _of_model(found: Validation, check: ModelCheck) -> list[str]:
    """Of one model: how it was searched, and what it gave nothing for."""
    model, cells, lines = check.model, check.cells, []
    if not check.whole:
        names = ", ".join(found.data.throws[i].name for i in cells.rows)
        lines.append(
            f"{model}: too slow for the whole grid: its parameters are the best of "
            f"{cells.friction.size} around {GUIDE}'s best, on {len(cells.rows)} throws: {names}"
        )
    for surface in check.at_edge:
        where = "grid" if check.whole else "searched parameters"
        best = f"its best parameters for {surface}" if surface else "its best parameters"
        lines.append(f"{model}: {best} are at the edge of the {where}")
    if cells.missing:
        share = 100 * cells.missing / cells.error.size
        lines.append(
            f"{model}: no landing in {share:.2g} % of the grid's predictions, each counts as "
            f"{MISSED:g} m"
        )
    lost = int((~np.isfinite(check.landing[:, 0])).sum())
    if lost:
        lines.append(f"{model}: no landing for {lost} throws by its best parameters: left out")
    return lines
