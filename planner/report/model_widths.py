"""How wide the corners of the NLP's sliding pivot may be rounded."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...problems import Mesh
from .model_measures import SHOWN, Measured
from .model_runs import SmoothedRelease
from .model_throws import detached, off
from .model_truths import pivot_truth
from .page import Cell, Effort, Picture, Table

Array = npt.NDArray[np.float64]

#: Rounding widths of the study; the NLP's default is 0.02.
EPSILONS = (0.3, 0.1, 0.03, 0.02, 0.01, 3e-3, 1e-3, 1e-4)
WIDTH_STEPS = (10, 20, 40, 80, 160, 320, 640)


def width_study(
    measured: Sequence[Measured], effort: Effort, tick: Callable[[], None]
) -> list[str | Table | Picture]:
    """The smoothed sliding pivot of the NLP against epsilon -> 0."""
    epsilons = EPSILONS[:: effort.of(2, 1)]
    rows: list[list[Cell]] = []
    panels: list[tuple[str, dict[str, Array]]] = []
    slopes = []
    for one in measured:
        case, truth, lines, widths = one.throw.case, one.truths["sp"], {}, []
        for epsilon in (*epsilons, 0.0):
            errors, own = [], []
            smooth = pivot_truth(case, epsilon) if epsilon else truth
            for steps in WIDTH_STEPS:
                end = detached(SmoothedRelease(epsilon, steps).release(case))
                errors.append(1e3 * off(one.throw, end, truth)[3])
                own.append(1e3 * off(one.throw, end, smooth)[3])
            lines[f"ε {epsilon:g}" if epsilon else "not smoothed"] = np.array(errors)
            width = SHOWN * off(one.throw, smooth, truth)
            if epsilon:
                widths.append(float(width[3]))
                cells: list[Cell] = [float(v) for v in (width[0], width[1], width[3])]
                rows.append([one.throw.title, epsilon, *cells, *(float(v) for v in own)])
        slopes.append(np.polyfit(np.log(epsilons[1:5]), np.log(widths[1:5]), 1)[0])
        panels.append((one.throw.title, lines))
        tick()
    columns = ["throw", "ε", "x [mm]", "θ [deg]", "scaled landing [mm]"]
    columns += [f"{steps} steps [mm]" for steps in WIDTH_STEPS]
    words = (
        "What rounding costs: landing of the smoothed sliding pivot, converged, against ε → 0; "
        "then the scaled landing error of even RK4 steps against the same ε converged"
    )
    text = (
        "The NLP plans with a sliding pivot whose corners are rounded over ε times the object's "
        f"weight. Its landing error falls as ε to the power {min(slopes):.2f} to "
        f"{max(slopes):.2f} over the four throws. {_resolved(panels, epsilons)}"
    )

    def draw(path: Path) -> None:
        from .diagrams import draw_widths

        draw_widths(panels, WIDTH_STEPS, path)

    name = "models-epsilon"
    picture = Picture(name, "Steps and ε: landing error against the law itself", draw)
    return [text, Table(name, words, columns, rows), picture]


def _resolved(panels: Sequence[tuple[str, Mapping[str, Array]]], epsilons: Sequence[float]) -> str:
    """From which epsilon on the steps of the opening decide the error."""
    i, found = WIDTH_STEPS.index(40), []
    for epsilon in epsilons:
        pairs = [(lines[f"ε {epsilon:g}"][i], lines["not smoothed"][i]) for _, lines in panels]
        if all(error <= 1.5 * plain for error, plain in pairs):
            found.append(epsilon)
    if not found:
        return "At 40 steps every ε here still decides the error."
    return (
        f"With 40 steps, ε = {max(found):g} is small enough: its landing error is within half of "
        "that without rounding in all four throws, so a smaller one buys nothing. That is "
        f"accuracy alone: the NLP takes {Mesh().epsilon:g}, for a smaller ε makes its solves fail "
        "more often (section planner), and its corrections take the error of ε away."
    )
