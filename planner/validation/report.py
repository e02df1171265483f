"""A validation as words, tables, pictures (Figs. 17 and 18 of the paper), JSON, and its files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models import Array
from ...models.release import MODELS
from ...problems.files import filling, plain
from ..identify import MISSED
from ..show import BLACK, GREY, Row, Table, new_figure, own_style, save
from .validation import ModelCheck, Validation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Pictures of a validation and their captions.
PICTURES = {
    "errors": "Predicted less measured landing of every throw of the batch.",
    "boxes": "Absolute errors: median, quartiles, outliers.",
}
#: Files of a validation's folder.
FILES = (
    "validation.md",
    "parameters.csv",
    "errors.csv",
    "cross_validation.csv",
    "errors_by_throw.csv",
    *(f"{name}.png" for name in PICTURES),
)
#: Quantities with errors: name in JSON, column of a table, symbol and unit in a picture.
QUANTITIES = (
    ("v_x", "v_x [m/s]", "v_x", "mm/s"),
    ("omega", "omega [deg/s]", "ω", "deg/s"),
    ("x", "x [m]", "x", "mm"),
    ("theta", "theta [deg]", "θ", "deg"),
)
#: Factors from metres and radians to metres and degrees.
DEGREES = np.array([1.0, math.degrees(1.0)])
#: Factors from metres and radians to millimetres and degrees.
MILLIMETRES = np.array([1e3, math.degrees(1.0)])


def tables(found: Validation) -> list[Table]:
    """The tables of a validation that have rows."""
    every = (parameter_table(found), error_table(found), crossed_table(found))
    return [table for table in every if table.rows]


def parameter_table(found: Validation) -> Table:
    """Table III: the grid's errors, the best parameters, times."""
    rows = list[Row]()
    for model, check in found.checks.items():
        error, times = check.grid.error, 1e3 * check.single
        for label, (mu, radius) in check.parameters.items():
            row: Row = {
                "model": f"{model}, {label}" if label else model,
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


def _errors(found: Validation, check: ModelCheck, units: Array | float = 1.0) -> list[Array]:
    """Finite errors of `QUANTITIES` on the batch in `units`: of lengths, or of lengths and angles.

    Each (n,), n the number of throws that have one.
    """
    off = np.hstack([check.twist * units, check.landing * units])[found.batch]
    return [column[np.isfinite(column)] for column in off.T]


def _spreads(found: Validation, check: ModelCheck) -> list[tuple[float, float] | None]:
    """MAE and STD of the absolute errors [m, rad] of `QUANTITIES`; None without any."""
    sizes = map(np.abs, _errors(found, check))
    return [(float(v.mean()), float(v.std())) if v.size else None for v in sizes]


def error_table(found: Validation) -> Table:
    """Table IV: MAE and STD of the absolute errors on the batch."""
    rows = list[Row]()
    for model, check in found.checks.items():
        row: Row = {"model": model}
        spreads = zip(QUANTITIES, _spreads(found, check), np.tile(DEGREES, 2), strict=True)
        for (_, name, *_), spread, unit in list(spreads)[0 if found.tracked else 2 :]:
            row[name] = None if spread is None else tuple(float(unit) * s for s in spread)
        rows.append(row)
    return Table("errors", "Absolute errors, MAE ± STD (Table IV)", rows)


def crossed_table(found: Validation) -> Table:
    """Mean pose errors of throws inside and outside the fit."""
    rows = list[Row]()
    for model, check in found.checks.items():
        crossed = check.crossed
        if crossed is not None:
            limits = 1e3 * crossed.parameters.prod(axis=1)
            row: Row = {
                "model": model,
                "throws": len(found.batch),
                "folds": len(crossed.parameters),
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
            numbers = (*check.parameters[found.surface[i]], *off[i].tolist())
            row |= {"model": model} | dict(zip(heads, plain(numbers), strict=True))
            rows.append(row | {"in_batch": int(i in batch)})
    return Table("errors_by_throw", "Errors of every throw", rows)


# Words.


def head(found: Validation) -> list[str]:
    """Lines that say what the data are."""
    data = found.data
    apart = len(data.throws) - len(found.batch)
    kinds = len({found.conditions[i] for i in found.batch})
    lines = [f"{data.name}: {len(found.batch)} throws of {kinds} conditions"]
    if apart:
        lines[0] += f", and {apart} others (another set, or another surface)"
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
    for model, check in found.checks.items():
        for surface in check.at_edge:
            best = f"its best parameters for {surface}" if surface else "its best parameters"
            lines.append(f"{model}: {best} are at the edge of the grid: it may fit better beyond")
        if missed := int(check.grid.missed.sum()):
            lines.append(
                f"{model}: no landing in {100 * missed / check.grid.predictions:.2g} % of the "
                f"grid's predictions, each counts as {MISSED:g} m"
            )
        if lost := int((~np.isfinite(check.landing[:, 0])).sum()):
            lines.append(f"{model}: no landing for {lost} throws by its best parameters: left out")
    surfaces = [name for name in dict.fromkeys(found.surface) if name]
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


def as_text(found: Validation) -> str:
    """Head, tables and notes for a terminal."""
    parts = ["\n".join(head(found))]
    parts += ["\n".join([table.caption, "", *table.markdown()]) for table in tables(found)]
    parts.append("\n".join(f"- {note}" for note in notes(found)))
    return "\n\n".join(parts)


def save_validation(found: Validation, folder: Path) -> None:
    """Write all files into `folder`, or none."""
    drawn = {"errors": _draw_errors(found), "boxes": _draw_boxes(found)}
    shown = tables(found)
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
    spreads = zip(QUANTITIES, _spreads(found, check), strict=True)
    return {
        "parameters": {
            label or "batch": {"friction": mu, "patch_radius": radius}
            for label, (mu, radius) in check.parameters.items()
        },
        "min_mean_error": float(error.min()),
        "max_mean_error": float(error.max()),
        "release_time": {"mean": float(check.single.mean()), "std": float(check.single.std())},
        "batch_time": check.batched,
        "errors": {name: s and {"mae": s[0], "std": s[1]} for (name, *_), s in spreads},
        "cross_validation": crossed
        and {
            "throws": len(found.batch),
            "folds": len(crossed.parameters),
            "fitted": crossed.inside.tolist(),
            "cross_validated": crossed.outside.tolist(),
        },
    }


# Pictures.


def _title(found: Validation, words: str) -> str:
    """Title of a picture; marks synthetic data."""
    more = " (synthetic data)" if found.data.shared.synthetic else ""
    return f"{found.data.name}: {words}{more}"


def _far_off(found: Validation) -> list[str]:
    """Models whose median error is over 6 times the best one's: they would hide the others."""
    errors = {m: np.nan_to_num(found.scaled(m)[found.batch], nan=MISSED) for m in found.checks}
    typical = {model: float(np.median(values)) for model, values in errors.items()}
    return [model for model, value in typical.items() if value > 6.0 * min(typical.values())]


@own_style()
def _draw_errors(found: Validation) -> Figure:
    """Predicted less measured landing, a panel per model on common axes (Fig. 17).

    Models with much larger errors have wider axes.
    """
    models, far = list(found.checks), _far_off(found)
    columns = min(3, len(models))
    lines = math.ceil(len(models) / columns)
    more = f"; wider axes for {', '.join(far)}" if far else ""
    title = _title(found, f"landing errors, + the mean{more}")
    figure = new_figure(0.6 + 3.7 * columns, 0.7 + 3.3 * lines, title)
    off = {
        model: np.column_stack(_errors(found, check, MILLIMETRES)[2:])
        for model, check in found.checks.items()
    }
    for number, model in enumerate(models):
        axis = figure.add_subplot(lines, columns, number + 1)
        alike = [off[name] for name in models if (name in far) == (model in far)]
        reach = 1.1 * np.abs(np.vstack([*alike, [[1e-3, 1e-3]]])).max(axis=0)
        axis.set(xlim=(-reach[0], reach[0]), ylim=(-reach[1], reach[1]))
        axis.axhline(0, color=GREY, lw=0.8)
        axis.axvline(0, color=GREY, lw=0.8)
        shade = MODELS[model].colour
        axis.plot(*off[model].T, "o", color=shade, ms=4.5, mec="white", mew=0.3, alpha=0.8)
        words = "no landing"
        if len(off[model]):
            center = off[model].mean(axis=0)
            axis.plot(*center, "+", color=BLACK, ms=13, mew=2)
            words = f"mean {center[0]:+.1f} mm, {center[1]:+.2f}°".replace("-", "−")
        axis.set_title(f"{model}: {words}", loc="left", fontsize=10)
        axis.set(xlabel="x predicted − measured [mm]", ylabel="θ predicted − measured [deg]")
        axis.locator_params(axis="x", nbins=5)
        axis.grid(alpha=0.25)
    return figure


@own_style()
def _draw_boxes(found: Validation) -> Figure:
    """Absolute errors by quantity and model: quartiles, whiskers of 1.5 IQR, outliers (Fig. 18).

    The axes cut off models with much larger errors.
    """
    models, far = list(found.checks), _far_off(found)
    errors = [_errors(found, check, MILLIMETRES) for check in found.checks.values()]
    quantities = [0, 1, 2, 3] if found.tracked else [2, 3]
    cut = f"; {', '.join(far)} cut off" if far else ""
    title = _title(found, f"absolute errors, quartiles{cut}")
    figure = new_figure(0.5 + max(3.1, 0.8 + 0.5 * len(models)) * len(quantities), 4.2, title)
    style: dict[str, Any] = {"widths": 0.6, "patch_artist": True}
    style["medianprops"] = {"color": BLACK, "lw": 1.6}
    style["flierprops"] = {"marker": "o", "ms": 3, "mec": GREY, "alpha": 0.7}
    for quantity, axis in zip(quantities, figure.subplots(1, len(quantities)), strict=True):
        _, _, symbol, unit = QUANTITIES[quantity]
        values = [np.abs(columns[quantity]) for columns in errors]
        drawn = axis.boxplot(values, positions=range(len(models)), **style)
        for box, model in zip(drawn["boxes"], models, strict=True):
            box.set(facecolor=MODELS[model].colour, alpha=0.75)
        largest = [v.max(initial=0.0) for m, v in zip(models, values, strict=True) if m not in far]
        axis.set_xticks(range(len(models)), models, rotation=35, ha="right")
        axis.set(ylim=(0.0, 1.08 * max(largest) or 1.0), ylabel=f"|{symbol} error| [{unit}]")
        axis.grid(alpha=0.25, axis="y")
    return figure
