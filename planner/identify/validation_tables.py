"""A validation as tables: parameters (Table III), errors (Table IV), cross-validation, factors."""

from __future__ import annotations

import math

import numpy as np

from .factors import SIGNIFICANT, FactorRow
from .validation import Validation
from .validation_table import Cell, Spread, Table


def tables(found: Validation) -> list[Table]:
    """All tables of a validation; those without rows are left out."""
    made = (parameter_table(found), error_table(found), crossed_table(found), factor_table(found))
    return [table for table in made if table.rows]


def parameter_table(found: Validation) -> Table:
    """Table III: the grid's errors, the best parameters, times."""
    rows: list[list[Cell]] = []
    for check in found.checks.values():
        for label, (mu, radius) in check.parameters.items():
            mean = check.cells.mean()
            first = label == ""
            rows.append(
                [
                    check.model if first else f"{check.model}, {label}",
                    float(np.nanmin(mean)) if first else None,
                    float(np.nanmax(mean)) if first else None,
                    mu,
                    1e3 * radius,
                    1e3 * mu * radius,
                    Spread(*_mean_std(1e3 * check.single)) if first else None,
                    None if check.batched is None or not first else 1e3 * check.batched,
                    (check.cells.friction.size if first else None),
                ]
            )
    caption = f"Parameters and times (Table III), {len(found.batch)} throws"
    columns = (
        *(("model", 0), ("min mean error [m]", 4), ("max mean error [m]", 4)),
        *(("mu*", 3), ("r* [mm]", 2), ("mu* r* [mm]", 3)),
        *(("one release [ms]", 2), ("in a batch [ms]", 4), ("cells", 0)),
    )
    return Table("parameters", caption, columns, rows)


def _mean_std(values: np.ndarray) -> tuple[float, float]:
    there = values[np.isfinite(values)]
    return (float(there.mean()), float(there.std())) if there.size else (math.nan, math.nan)


def error_table(found: Validation) -> Table:
    """Table IV: MAE and STD of the absolute errors on the batch, the lowest MAE marked."""
    degrees = math.degrees(1.0)
    columns: list[tuple[str, int]] = [("model", 0)]
    if found.tracked:
        columns += [("v_x [m/s]", 4), ("omega [deg/s]", 2)]
    columns += [("x [m]", 4), ("theta [deg]", 2)]
    numbers = []
    for check in found.checks.values():
        parts = [check.landing[found.batch]]
        if found.tracked:
            parts.insert(0, check.twist[found.batch])
        off = np.abs(np.hstack(parts)) * np.tile([1.0, degrees], len(parts))
        numbers.append([_mean_std(column) for column in off.T])
    means = np.array([[mean for mean, _ in row] for row in numbers])
    lowest = np.nanmin(np.where(np.isnan(means), np.inf, means), axis=0)
    rows: list[list[Cell]] = []
    for model, row in zip(found.checks, numbers, strict=True):
        cells = zip(row, lowest, strict=True)
        rows.append([model, *(Spread(m, s, best=m == low) for (m, s), low in cells)])
    caption = "Absolute errors, MAE ± STD (Table IV); the lowest marked"
    return Table("errors", caption, columns, rows)


def crossed_table(found: Validation) -> Table:
    """Mean scaled errors of throws that the parameters are fitted to, and of others."""
    rows: list[list[Cell]] = []
    for check in found.checks.values():
        crossed = check.crossed
        if crossed is None:
            continue
        limits = 1e3 * crossed.parameters.prod(axis=1)
        rows.append(
            [
                check.model,
                crossed.throws,
                _interval(crossed.inside, crossed.inside_interval),
                _interval(crossed.outside, crossed.outside_interval),
                _interval(float(crossed.more[0]), crossed.more[1:]),
                f"{limits.min():.2f} to {limits.max():.2f}",
            ]
        )
    folds = max((c.crossed.folds for c in found.checks.values() if c.crossed), default=0)
    caption = (
        f"Mean scaled error [m] with 95 % interval: parameters from the same throws, and from "
        f"other conditions ({folds} folds)"
    )
    columns = (
        *(("model", 0), ("throws", 0), ("fitted", 4), ("cross-validated", 4)),
        *(("difference", 4), ("mu* r* of the folds [mm]", 0)),
    )
    return Table("cross_validation", caption, columns, rows)


def _interval(mean: float, ends: np.ndarray) -> Spread:
    return Spread(mean, ends=(float(ends[0]), float(ends[1])))


def factor_table(found: Validation) -> Table:
    """Shifts from condition A to B, errors in both, p of Mann-Whitney U."""
    rows: list[list[Cell]] = []
    for group in found.factors:
        compared = group[0].comparison
        labels = f"{compared.labels[0]} → {compared.labels[1]}"
        sizes = f"{len(compared.first)}, {len(compared.second)}"
        measured = group[0].measured
        shift: list[Cell] = [float(measured[0]), math.degrees(measured[1])]
        rows.append([f"{compared.factor}: {labels}", sizes, "measured", *shift, *[None] * 6])
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
    scale = np.array([1.0, math.degrees(1.0)])
    shift, mean, std = row.predicted * scale, row.mean * scale, row.std * scale
    cells: list[Cell] = [row.model, *map(float, shift)]
    for i in range(2):
        cells += [Spread(float(mean[side, i]), float(std[side, i])) for side in range(2)]
        star = " *" if row.p[i] < SIGNIFICANT else ""
        cells.append(f"{row.p[i]:.2g}{star}")
    return cells
