"""All methods on one throw as a table and as diagrams."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from .model_measures import ERRORS, SHOWN, Measured
from .model_runs import STIFFNESSES
from .page import Cell, Picture, Table


def rows_table(one: Measured) -> Table:
    """All methods on one throw."""
    rows: list[list[Cell]] = []
    for row in one.rows:
        errors = [*(SHOWN * row.own)[:3], *(SHOWN * row.model)[:3]]
        cells = [float(v) if math.isfinite(v) else None for v in errors]
        best = ", ".join(row.best)
        status = f"not to be trusted: {row.trouble}" if row.trouble else "ok"
        rows.append(
            [row.method.family, row.method.setting, 1e6 * row.seconds, *cells, best, status]
        )
    columns = ["method", "setting", "time [µs]", *(f"own {e}" for e in ERRORS)]
    columns += [*(f"model {e}" for e in ERRORS), "Pareto set", "status"]
    words = (
        f"{one.throw.title.capitalize()}: time a throw, own error and model error; the Pareto set "
        "of the own error is among methods of one law, that of the model error among all but the "
        "patch's own"
    )
    return Table(f"models-{one.throw.key}", words, columns, rows)


def diagram(one: Measured) -> Picture:
    """Six panels: own and model error of landing x, theta and of the twist."""
    words = (
        f"{one.throw.title.capitalize()}: error against time a throw. Own errors (above) are drawn "
        "no lower than the converged answer is known; a model error below its law's converged one "
        "is chance, as the own error makes up for a part of it; what gave no landing is not drawn"
    )

    def draw(path: Path) -> None:
        from .diagrams import Panel, Point, draw_work_precision

        grid: list[list[Panel]] = [[], []]
        sound = [row for row in one.rows if np.isfinite(row.own).all()]
        for i, name in enumerate(ERRORS):
            own, model = [], []
            for row in sound:
                family, seconds, known = (
                    row.method.family,
                    row.seconds,
                    one.known.get(row.method.law),
                )
                least = 0.0 if known is None else float(known[i])
                errors = SHOWN[i] * max(float(row.own[i]), least), SHOWN[i] * float(row.model[i])
                own.append(Point(family, seconds, errors[0], "own" in row.best))
                model.append(Point(family, seconds, errors[1], "model" in row.best))
            soft = [float(SHOWN[i] * one.apart(f"{k:g}")[i]) for k in STIFFNESSES]
            words = f"LuGre, σ₀ {STIFFNESSES[0]:.0e} to {STIFFNESSES[-1]:.0e} 1/m".replace(
                "e+0", "e"
            )
            ends = {"sp, RK4": float(SHOWN[i] * one.apart("sp")[i])}
            ends["ls-step"] = float(SHOWN[i] * one.apart("ls")[i])
            floor = 1e-7 if i < 2 else 1e-6
            grid[0].append(Panel(f"own error of {name}", own, floor, {}))
            band = (min(soft), max(soft), words)
            grid[1].append(Panel(f"model error of {name}", model, 1e-4, ends, band))
        draw_work_precision(grid, one.throw.title, path)

    return Picture(f"models-{one.throw.key}", words, draw)
