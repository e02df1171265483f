"""A validation as words and numbers: tables, notes, JSON, and the files of its folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...problems.files import filling, plain
from ..show import Row, Table, save
from .grid import MISSED
from .pictures import DEGREES, PICTURES, validation_pictures
from .validation import ModelCheck, Validation

TABLES = ("parameters", "errors", "cross_validation", "errors_by_throw")
#: All that a validation leaves in its folder.
FILES = (
    "validation.md",
    *(f"{name}.csv" for name in TABLES),
    *(f"{name}.png" for name in PICTURES),
)
#: Errors by the names of their columns, in metres and degrees, and what JSON calls them.
ERRORS = {"v_x [m/s]": "v_x", "omega [deg/s]": "omega", "x [m]": "x", "theta [deg]": "theta"}


def tables(found: Validation) -> list[Table]:
    """The tables of a validation that have rows."""
    every = (parameter_table(found), error_table(found), crossed_table(found))
    return [table for table in every if table.rows]


def parameter_table(found: Validation) -> Table:
    """Table III: the grid's errors, the best parameters, times."""
    rows = list[Row]()
    for check in found.checks.values():
        error, times = check.grid.error, 1e3 * check.single
        for label, (mu, radius) in check.parameters.items():
            row: Row = {
                "model": f"{check.model}, {label}" if label else check.model,
                "min mean error [m]": None if label else float(error.min()),
                "max mean error [m]": None if label else float(error.max()),
                "mu*": mu,
                "r* [mm]": 1e3 * radius,
                "mu* r* [mm]": 1e3 * mu * radius,
            }
            if not label:
                row["one release [ms]"] = float(times.mean()), float(times.std())
                row["in a batch [ms]"] = 1e3 * check.batched
            rows.append(row)
    caption = f"Parameters and times (Table III), {len(found.batch)} throws"
    return Table("parameters", caption, rows)


def absolute_errors(found: Validation, check: ModelCheck) -> list[tuple[float, float] | None]:
    """MAE and STD of v_x [m/s], omega [rad/s], x [m], theta [rad] on the batch; None for none."""
    off = np.abs(np.hstack([check.twist, check.landing])[found.batch])
    known = [column[np.isfinite(column)] for column in off.T]
    return [(float(v.mean()), float(v.std())) if v.size else None for v in known]


def error_table(found: Validation) -> Table:
    """Table IV: MAE and STD of the absolute errors on the batch."""
    rows = list[Row]()
    for check in found.checks.values():
        row: Row = {"model": check.model}
        spreads = zip(ERRORS, absolute_errors(found, check), np.tile(DEGREES, 2), strict=True)
        for name, spread, unit in list(spreads)[0 if found.tracked else 2 :]:
            row[name] = None if spread is None else tuple(float(unit) * s for s in spread)
        rows.append(row)
    return Table("errors", "Absolute errors, MAE ± STD (Table IV)", rows)


def crossed_table(found: Validation) -> Table:
    """Mean pose errors of throws inside and outside the fit."""
    rows = list[Row]()
    for check in found.checks.values():
        crossed = check.crossed
        if crossed is not None:
            limits = 1e3 * crossed.parameters.prod(axis=1)
            row: Row = {
                "model": check.model,
                "throws": crossed.throws,
                "folds": crossed.folds,
                "fitted": tuple(crossed.inside.tolist()),
                "cross-validated": tuple(crossed.outside.tolist()),
                "difference": tuple(crossed.more.tolist()),
                "mu* r* of the folds [mm]": f"{limits.min():.2f} to {limits.max():.2f}",
            }
            rows.append(row)
    caption = (
        "Mean pose error (position plus angle times half the length) [m] with 95 % interval: "
        "parameters from the same throws, and from other conditions"
    )
    return Table("cross_validation", caption, rows)


def errors_by_throw(found: Validation) -> Table:
    """A row per throw and model, angles in degrees; cells without a landing are empty."""
    names, batch, rows = list(found.data.factors), set(found.batch.tolist()), list[Row]()
    heads = ("friction", "patch_radius", "dx", "dtheta_deg", "scaled", "dv_x", "domega_deg")
    for model, check in found.checks.items():
        off = np.column_stack([check.landing * DEGREES, found.scaled(model), check.twist * DEGREES])
        for i, throw in enumerate(found.data.throws):
            row: Row = {"throw": throw.name}
            row |= {name: throw.factors.get(name, "") for name in names}
            numbers = (*check.parameters[check.surface[i]], *off[i].tolist())
            row |= {"model": model} | dict(zip(heads, plain(numbers), strict=True))
            rows.append(row | {"in_batch": int(i in batch)})
    return Table("errors_by_throw", "Errors of every throw", rows)


def head(found: Validation) -> list[str]:
    """Lines that say what the data are."""
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
    """Lines about what is left out and what limits the results."""
    lines = [*found.data.notes]
    for check in found.checks.values():
        lines += _model_notes(found, check)
    surfaces = [name for name in next(iter(found.checks.values())).parameters if name]
    if surfaces:
        lines.append(
            f"surface: parameters for {', '.join(surfaces)} are identified anew, on the throws "
            "that are then judged"
        )
    if not found.tracked:
        lines.append("no tracks: v_x and omega are left out")
    if all(check.crossed is None for check in found.checks.values()):
        lines.append("cross-validation: left out, it needs 5 throws of 2 conditions")
    return lines


def _model_notes(found: Validation, check: ModelCheck) -> list[str]:
    """Notes on one model: parameters at the edge of the grid, throws without landing."""
    model, grid, lines = check.model, check.grid, []
    for surface in check.at_edge:
        best = f"its best parameters for {surface}" if surface else "its best parameters"
        lines.append(f"{model}: {best} are at the edge of the grid: it may fit better beyond")
    missed = int(grid.missed.sum())
    if missed:
        lines.append(
            f"{model}: no landing in {100 * missed / grid.predictions:.2g} % of the grid's "
            f"predictions, each counts as {MISSED:g} m"
        )
    lost = int((~np.isfinite(check.landing[:, 0])).sum())
    if lost:
        lines.append(f"{model}: no landing for {lost} throws by its best parameters: left out")
    return lines


def as_text(found: Validation) -> str:
    """Head, tables and notes for a terminal."""
    parts = ["\n".join(head(found))]
    parts += ["\n".join([table.caption, "", *table.markdown()]) for table in tables(found)]
    parts.append("\n".join(f"- {note}" for note in notes(found)))
    return "\n\n".join(parts)


def save_validation(found: Validation, folder: Path) -> None:
    """Write all files into `folder`, or none."""
    drawn, shown = validation_pictures(found), tables(found)
    lines = ["# Release models on measured throws", ""]
    lines += [f"- {line}" for line in (*head(found), *notes(found))]
    for table in shown:
        lines += ["", f"**{table.caption}** ([{table.name}.csv]({table.name}.csv))", ""]
        lines += table.markdown()
    for name in drawn:
        lines += ["", f"![{PICTURES[name]}]({name}.png)", "", f"*{PICTURES[name]}*"]
    lines += ["", "Errors of every throw: [errors_by_throw.csv](errors_by_throw.csv).", ""]
    with filling(folder, FILES) as scratch:
        for name, figure in drawn.items():
            save(figure, scratch / f"{name}.png")
        for table in (*shown, errors_by_throw(found)):
            table.write(scratch)
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
        "time": found.seconds,
    }


def _model_dict(found: Validation, check: ModelCheck) -> dict[str, Any]:
    error, crossed = check.grid.error, check.crossed
    spreads = zip(ERRORS.values(), absolute_errors(found, check), strict=True)
    errors = {name: s and {"mae": s[0], "std": s[1]} for name, s in spreads}
    return {
        "parameters": {
            label or "batch": {"friction": mu, "patch_radius": radius}
            for label, (mu, radius) in check.parameters.items()
        },
        "min_mean_error": float(error.min()),
        "max_mean_error": float(error.max()),
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
