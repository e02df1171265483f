"""A validation as words, as JSON and as files: validation.md, tables, pictures."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np

from ...problems import filling
from .validation import Validation
from .validation_notes import head, notes
from .validation_tables import tables

#: Pictures with what is to be seen, and all that a validation leaves in its folder.
PICTURES = {
    "landings": "Measured landing poses of the batch.",
    "case": "One throw closely: measured, and by every model.",
    "errors": "Predicted less measured landing of every throw of the batch.",
    "boxes": "Absolute errors: median, quartiles, outliers.",
    "violins": "Signed errors: density, quartiles, median.",
    "factors": "What a factor does: landings measured and predicted, errors in both conditions.",
}
TABLES = ("parameters", "errors", "cross_validation", "factors", "errors_by_throw")
FILES = (
    "validation.md",
    *(f"{name}.csv" for name in TABLES),
    *(f"{name}.png" for name in PICTURES),
)


def as_text(found: Validation) -> str:
    """Head, tables and notes for a terminal."""
    parts = ["\n".join(head(found)), *(table.text() for table in tables(found))]
    parts.append("\n".join(f"- {note}" for note in notes(found)))
    return "\n\n".join(parts)


def as_page(found: Validation, drawn: list[str]) -> str:
    """validation.md."""
    lines = ["# Release models on measured throws", "", *(f"- {line}" for line in head(found))]
    lines += [f"- {note}" for note in notes(found)]
    for table in tables(found):
        lines += ["", table.markdown()]
    for name in drawn:
        lines += ["", f"![{PICTURES[name]}]({name}.png)", "", f"*{PICTURES[name]}*"]
    lines += ["", "Errors of every throw: [errors_by_throw.csv](errors_by_throw.csv).", ""]
    return "\n".join(lines)


def save_validation(found: Validation, folder: Path) -> None:
    """Write all files into `folder`, or none."""
    with filling(folder, FILES) as scratch:
        drawn = _draw(found, scratch)
        for table in tables(found):
            table.write(scratch)
        with (scratch / "errors_by_throw.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(errors_by_throw(found))
        (scratch / "validation.md").write_text(as_page(found, drawn), encoding="utf-8")


def _draw(found: Validation, folder: Path) -> list[str]:
    """Draw what there is to draw; gives its names."""
    from . import validation_pictures as pictures
    from .factors_picture import factors_picture
    from .validation_case import case_picture, middling_throw

    figures = {"landings": pictures.landings_picture(found)}
    row = middling_throw(found)
    if row is not None:
        figures["case"] = case_picture(found, row)
    figures["errors"] = pictures.errors_picture(found)
    figures["boxes"] = pictures.boxes_picture(found)
    figures["violins"] = pictures.violins_picture(found)
    if found.factors:
        figures["factors"] = factors_picture(found)
    for name, figure in figures.items():
        pictures.save(figure, folder / f"{name}.png")
    return list(figures)


def errors_by_throw(found: Validation) -> list[list[str]]:
    """Head, then a row per throw and model, angles in degrees; empty where nothing landed."""
    names = list(found.data.factors)
    header = ["throw", *names, "model", "friction", "patch_radius"]
    header += ["dx", "dtheta_deg", "scaled", "dv_x", "domega_deg"]
    batch = set(found.batch.tolist())
    rows = [[*header, "in_batch"]]
    for model, check in found.checks.items():
        scaled = found.scaled(model)
        for i, throw in enumerate(found.data.throws):
            pair = check.parameters[check.surface[i]]
            (dx, dtheta), (dv, domega) = check.landing[i], check.twist[i]
            numbers = [dx, math.degrees(dtheta), scaled[i], dv, math.degrees(domega)]
            cells = [f"{v:.9g}" if math.isfinite(v) else "" for v in (*pair, *numbers)]
            labels = [throw.factors.get(name, "") for name in names]
            rows.append([throw.name, *labels, model, *cells, str(int(i in batch))])
    return rows


def as_dict(found: Validation) -> dict[str, Any]:
    """For --json: head, notes, the tables' numbers."""
    return {
        "data": found.data.name,
        "synthetic": found.data.shared.synthetic or None,
        "throws": len(found.data.throws),
        "batch": len(found.batch),
        "notes": notes(found),
        "models": {model: _model_dict(found, model) for model in found.checks},
        "factors": [_factor_dict(row) for group in found.factors for row in group],
        "time": found.seconds,
    }


def _model_dict(found: Validation, model: str) -> dict[str, Any]:
    check = found.checks[model]
    mean, crossed = check.cells.mean(), check.crossed
    off = np.abs(np.hstack([check.twist, check.landing])[found.batch])
    named = zip(("v_x", "omega", "x", "theta"), off.T, strict=True)
    errors = {name: column[np.isfinite(column)] for name, column in named}
    return {
        "parameters": {
            label or "batch": {"friction": mu, "patch_radius": radius}
            for label, (mu, radius) in check.parameters.items()
        },
        "min_mean_error": _number(np.nanmin(mean)),
        "max_mean_error": _number(np.nanmax(mean)),
        "whole_grid": check.whole,
        "release_time": {"mean": float(check.single.mean()), "std": float(check.single.std())},
        "batch_time": check.batched,
        "errors": {
            name: {"mae": float(v.mean()), "std": float(v.std())} if v.size else None
            for name, v in errors.items()
        },
        "cross_validation": crossed
        and {
            "throws": crossed.throws,
            "folds": crossed.folds,
            "fitted": [crossed.inside, *crossed.inside_interval.tolist()],
            "cross_validated": [crossed.outside, *crossed.outside_interval.tolist()],
        },
    }


def _factor_dict(row: Any) -> dict[str, Any]:
    compared = row.comparison
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
    return {"factor": compared.factor, "labels": list(compared.labels), "model": row.model, **known}


def _number(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None
