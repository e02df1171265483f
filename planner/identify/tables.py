"""A validation as words and numbers: tables, notes, JSON, and the files of its folder."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems import filling
from ..show import save
from .factors import SIGNIFICANT, FactorRow
from .grid import MISSED
from .pictures import PICTURES, validation_pictures
from .validation import GUIDE, ModelCheck, Validation

Array = npt.NDArray[np.float64]

TABLES = ("parameters", "errors", "cross_validation", "factors", "errors_by_throw")
#: All that a validation leaves in its folder.
FILES = (
    "validation.md",
    *(f"{name}.csv" for name in TABLES),
    *(f"{name}.png" for name in PICTURES),
)
#: From metres and radians to metres and degrees.
DEGREES = np.array([1.0, math.degrees(1.0)])

#: Words, a number, mean and standard deviation, or mean and the ends of its interval.
Cell = str | int | float | tuple[float, ...] | None
#: What its columns in a CSV file are called.
ENDS = {1: [""], 2: ["", " std"], 3: ["", " low", " high"]}


@dataclass(frozen=True)
class Table:
    """name: stem of its CSV file; columns with their decimals; rows; marked: whether the
    lowest mean of each column is marked."""

    name: str
    caption: str
    columns: Sequence[tuple[str, int]]
    rows: Sequence[Sequence[Cell]]
    marked: bool = False

    def words(self, mark: str = "{} *") -> list[list[str]]:
        """Header and rows as they are read."""
        shown = [[name for name, _ in self.columns]]
        means = [
            [c[0] for c in column if isinstance(c, tuple)]
            for column in zip(*self.rows, strict=True)
        ]
        for row in self.rows:
            shown.append([])
            for cell, (_, digits), known in zip(row, self.columns, means, strict=True):
                words = _words(cell, digits)
                lowest = self.marked and isinstance(cell, tuple) and cell[0] == min(known)
                shown[-1].append(mark.format(words) if lowest else words)
        return shown

    def text(self) -> str:
        """Columns under each other."""
        words = self.words()
        widths = [max(len(row[i]) for row in words) for i in range(len(self.columns))]
        lines = [self.caption]
        for row in words:
            pairs = zip(row, widths, strict=True)
            cells = [w.ljust(n) if i == 0 else w.rjust(n) for i, (w, n) in enumerate(pairs)]
            lines.append("  " + "  ".join(cells).rstrip())
        return "\n".join(lines)

    def markdown(self) -> str:
        """The same for a page; the lowest of a column bold."""
        words = [[cell.replace("|", "\\|") for cell in row] for row in self.words("**{}**")]
        align = ["---", *["---:"] * (len(self.columns) - 1)]
        lines = [f"**{self.caption}** ([{self.name}.csv]({self.name}.csv))", ""]
        for row in (words[0], align, *words[1:]):
            lines.append("| " + " | ".join(row) + " |")
        return "\n".join(lines)

    def write(self, folder: Path) -> None:
        """The CSV file: numbers in full, a spread in columns of its own."""
        columns: list[list[Any]] = []
        for (name, _), cells in zip(self.columns, zip(*self.rows, strict=True), strict=True):
            parts = [cell if isinstance(cell, tuple) else (cell,) for cell in cells]
            ends = ENDS[max(map(len, parts))]
            for k, end in enumerate(ends):
                columns.append([name + end, *(part[k] if k < len(part) else "" for part in parts)])
        write_csv(folder / f"{self.name}.csv", zip(*columns, strict=True))


def _words(cell: Cell, digits: int) -> str:
    """A cell as it is read."""
    if cell is None:
        return "–"
    if not isinstance(cell, tuple):
        return f"{cell:.{digits}f}" if isinstance(cell, float) else str(cell)
    shown = [f"{number:.{digits}f}" for number in cell]
    return f"{shown[0]} ({shown[1]} to {shown[2]})" if len(cell) == 3 else " ± ".join(shown)


def write_csv(path: Path, rows: Iterable[Iterable[Any]]) -> None:
    """A CSV file of these rows."""
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)


def tables(found: Validation) -> list[Table]:
    """All tables of a validation; those without rows are left out."""
    made = (parameter_table(found), error_table(found), crossed_table(found), factor_table(found))
    return [table for table in made if table.rows]


def parameter_table(found: Validation) -> Table:
    """Table III: the grid's errors, the best parameters, times."""
    rows: list[list[Cell]] = []
    for check in found.checks.values():
        error, times = check.grid.error, 1e3 * check.single
        batched = None if check.batched is None else 1e3 * check.batched
        for label, (mu, radius) in check.parameters.items():
            known: list[Cell] = [mu, 1e3 * radius, 1e3 * mu * radius]
            if label:
                rows.append([f"{check.model}, {label}", None, None, *known, None, None, None])
                continue
            spread = (float(times.mean()), float(times.std()))
            ends = float(error.min()), float(error.max())
            rows.append([check.model, *ends, *known, spread, batched, error.size])
    caption = f"Parameters and times (Table III), {len(found.batch)} throws"
    columns = (
        *(("model", 0), ("min mean error [m]", 4), ("max mean error [m]", 4)),
        *(("mu*", 3), ("r* [mm]", 2), ("mu* r* [mm]", 3)),
        *(("one release [ms]", 2), ("in a batch [ms]", 4), ("cells", 0)),
    )
    return Table("parameters", caption, columns, rows)


def absolute_errors(found: Validation, check: ModelCheck) -> dict[str, tuple[float, float] | None]:
    """MAE and STD of v_x [m/s], omega [rad/s], x [m], theta [rad] on the batch; None for none."""
    off = np.abs(np.hstack([check.twist, check.landing])[found.batch])
    known = [column[np.isfinite(column)] for column in off.T]
    spreads = [(float(v.mean()), float(v.std())) if v.size else None for v in known]
    return dict(zip(("v_x", "omega", "x", "theta"), spreads, strict=True))


def error_table(found: Validation) -> Table:
    """Table IV: MAE and STD of the absolute errors on the batch, the lowest MAE marked."""
    columns = (("v_x [m/s]", 4), ("omega [deg/s]", 2), ("x [m]", 4), ("theta [deg]", 2))
    first = 0 if found.tracked else 2
    rows: list[list[Cell]] = []
    for check in found.checks.values():
        spreads = zip(absolute_errors(found, check).values(), np.tile(DEGREES, 2), strict=True)
        cells = [None if s is None else (float(f) * s[0], float(f) * s[1]) for s, f in spreads]
        rows.append([check.model, *cells[first:]])
    caption = "Absolute errors, MAE ± STD (Table IV); the lowest marked"
    return Table("errors", caption, (("model", 0), *columns[first:]), rows, marked=True)


def crossed_table(found: Validation) -> Table:
    """Mean scaled errors of throws that the parameters are fitted to, and of others."""
    rows: list[list[Cell]] = []
    folds = 0
    for check in found.checks.values():
        crossed = check.crossed
        if crossed is None:
            continue
        limits, folds = 1e3 * crossed.parameters.prod(axis=1), max(folds, crossed.folds)
        spreads = [tuple(part.tolist()) for part in (crossed.inside, crossed.outside, crossed.more)]
        words = f"{limits.min():.2f} to {limits.max():.2f}"
        rows.append([check.model, crossed.throws, *spreads, words])
    caption = (
        f"Mean scaled error [m] with 95 % interval: parameters from the same throws, and from "
        f"other conditions ({folds} folds)"
    )
    columns = (
        *(("model", 0), ("throws", 0), ("fitted", 4), ("cross-validated", 4)),
        *(("difference", 4), ("mu* r* of the folds [mm]", 0)),
    )
    return Table("cross_validation", caption, columns, rows)


def factor_table(found: Validation) -> Table:
    """Shifts from condition A to B, errors in both, p of Mann-Whitney U."""
    rows: list[list[Cell]] = []
    for group in found.factors:
        compared, shift = group[0].comparison, group[0].measured * DEGREES
        labels = f"{compared.labels[0]} → {compared.labels[1]}"
        sizes = f"{len(compared.first)}, {len(compared.second)}"
        nothing: list[Cell] = [None] * 6
        rows.append([f"{compared.factor}: {labels}", sizes, "measured", *shift.tolist(), *nothing])
        rows += [["", "", *_factor_cells(row)] for row in group]
    caption = (
        f"Factors: shift of the mean landing from A to B, MAE ± STD in both; * p < {SIGNIFICANT}"
    )
    columns = (
        *(("factor", 0), ("throws A, B", 0), ("model", 0), ("shift x [m]", 4)),
        *(("shift theta [deg]", 1), ("x error A [m]", 4), ("x error B [m]", 4), ("p of x", 0)),
        *(("theta error A [deg]", 2), ("theta error B [deg]", 2), ("p of theta", 0)),
    )
    return Table("factors", caption, columns, rows)


def _factor_cells(row: FactorRow) -> list[Cell]:
    shift, mean, std = row.predicted * DEGREES, row.mean * DEGREES, row.std * DEGREES
    cells: list[Cell] = [row.model, *map(_number, shift)]
    for i in range(2):
        spreads = [(float(mean[side, i]), float(std[side, i])) for side in range(2)]
        cells += [None if math.isnan(spread[0]) else spread for spread in spreads]
        cells.append(f"{row.p[i]:.2g}" + (" *" if row.p[i] < SIGNIFICANT else ""))
    return cells


def errors_by_throw(found: Validation) -> list[list[str]]:
    """Head, then a row per throw and model, angles in degrees; empty where nothing landed."""
    names, batch = list(found.data.factors), set(found.batch.tolist())
    header = ["throw", *names, "model", "friction", "patch_radius"]
    header += ["dx", "dtheta_deg", "scaled", "dv_x", "domega_deg", "in_batch"]
    rows = [header]
    for model, check in found.checks.items():
        off = np.column_stack([check.landing * DEGREES, found.scaled(model), check.twist * DEGREES])
        for i, throw in enumerate(found.data.throws):
            numbers = [*check.parameters[check.surface[i]], *off[i]]
            cells = [f"{v:.9g}" if math.isfinite(v) else "" for v in numbers]
            labels = [throw.factors.get(name, "") for name in names]
            rows.append([throw.name, *labels, model, *cells, str(int(i in batch))])
    return rows


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
        lines += _model_notes(found, check)
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


def _model_notes(found: Validation, check: ModelCheck) -> list[str]:
    """How one model was searched, and what it gave nothing for."""
    model, grid, lines = check.model, check.grid, []
    if not check.whole:
        names = ", ".join(found.data.throws[i].name for i in check.rows)
        lines.append(
            f"{model}: too slow for the whole grid: its parameters are the best of "
            f"{grid.error.size} around {GUIDE}'s best, on {grid.throws} throws: {names}"
        )
    for surface in check.at_edge:
        where = "grid" if check.whole else "searched parameters"
        best = f"its best parameters for {surface}" if surface else "its best parameters"
        lines.append(f"{model}: {best} are at the edge of the {where}")
    missing = int(grid.missed.sum())
    if missing:
        lines.append(
            f"{model}: no landing in {100 * missing / grid.predictions:.2g} % of the grid's "
            f"predictions, each counts as {MISSED:g} m"
        )
    lost = int((~np.isfinite(check.landing[:, 0])).sum())
    if lost:
        lines.append(f"{model}: no landing for {lost} throws by its best parameters: left out")
    return lines


def as_text(found: Validation) -> str:
    """Head, tables and notes for a terminal."""
    parts = ["\n".join(head(found)), *(table.text() for table in tables(found))]
    parts.append("\n".join(f"- {note}" for note in notes(found)))
    return "\n\n".join(parts)


def save_validation(found: Validation, folder: Path) -> None:
    """Write all files into `folder`, or none."""
    drawn = validation_pictures(found)
    lines = ["# Release models on measured throws", ""]
    lines += [f"- {line}" for line in (*head(found), *notes(found))]
    for table in tables(found):
        lines += ["", table.markdown()]
    for name in drawn:
        lines += ["", f"![{PICTURES[name]}]({name}.png)", "", f"*{PICTURES[name]}*"]
    lines += ["", "Errors of every throw: [errors_by_throw.csv](errors_by_throw.csv).", ""]
    with filling(folder, FILES) as scratch:
        for name, figure in drawn.items():
            save(figure, scratch / f"{name}.png")
        for table in tables(found):
            table.write(scratch)
        write_csv(scratch / "errors_by_throw.csv", errors_by_throw(found))
        (scratch / "validation.md").write_text("\n".join(lines), encoding="utf-8")


def as_dict(found: Validation) -> dict[str, Any]:
    """For --json: head, notes, the tables' numbers."""
    return {
        "data": found.data.name,
        "synthetic": found.data.shared.synthetic or None,
        "throws": len(found.data.throws),
        "batch": len(found.batch),
        "notes": notes(found),
        "models": {model: _model_dict(found, check) for model, check in found.checks.items()},
        "factors": [_factor_dict(row) for group in found.factors for row in group],
        "time": found.seconds,
    }


def _model_dict(found: Validation, check: ModelCheck) -> dict[str, Any]:
    error, crossed = check.grid.error, check.crossed
    spreads = absolute_errors(found, check).items()
    errors = {name: s and {"mae": s[0], "std": s[1]} for name, s in spreads}
    return {
        "parameters": {
            label or "batch": {"friction": mu, "patch_radius": radius}
            for label, (mu, radius) in check.parameters.items()
        },
        "min_mean_error": float(error.min()),
        "max_mean_error": float(error.max()),
        "whole_grid": check.whole,
        "release_time": {"mean": float(check.single.mean()), "std": float(check.single.std())},
        "batch_time": check.batched,
        "errors": errors,
        "cross_validation": crossed
        and {
            "throws": crossed.throws,
            "folds": crossed.folds,
            "fitted": crossed.inside.tolist(),
            "cross_validated": crossed.outside.tolist(),
        },
    }


def _factor_dict(row: FactorRow) -> dict[str, Any]:
    numbers = {
        "measured": row.measured,
        "predicted": row.predicted,
        "mae_a": row.mean[0],
        "mae_b": row.mean[1],
        "std_a": row.std[0],
        "std_b": row.std[1],
        "p": row.p,
    }
    known = {key: [_number(v) for v in values] for key, values in numbers.items()}
    labels = list(row.comparison.labels)
    return {"factor": row.comparison.factor, "labels": labels, "model": row.model, **known}


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
