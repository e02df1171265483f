"""The picture of the section "stability"."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .extreme_runs import Outcome


def draw(found: Sequence[Outcome], path: Path) -> None:
    """Error over time, and condition over iterations, of the extreme cases."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    from ..sweep import BLUE, GREEN, GREY, RED

    figure = Figure(figsize=(11, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    kinds = (("free hand", GREEN, False), ("Panda", BLUE, True))
    floor = 1e-7
    for label, colour, robot in kinds:
        some = [o for o in found if (o.case.scene.robot is not None) == robot]
        solved = [(o, o.verdict) for o in some if o.verdict is not None]
        errors = [max(1e3 * verdict.other, floor) for _, verdict in solved]
        left.loglog([o.seconds for o, _ in solved], errors, "o", ms=4, color=colour, label=label)
        counts = [max(o.iterations, 1) for o, _ in solved]
        right.loglog(counts, [o.scaled for o, _ in solved], "o", ms=4, color=colour, label=label)
    failed = [o.seconds for o in found if o.status not in ("solved", "refused")]
    left.plot(
        failed, [20.0] * len(failed), "x", ms=5, color=GREY, label="not solved (drawn at the top)"
    )
    false = [(o.seconds, 1e3 * o.verdict.other) for o in found if o.verdict and o.false]
    left.plot(*zip(*false, strict=True) if false else ((), ()), "s", color=RED, label="false")
    left.set(xlabel="plan, with building [s]", ylabel="position error by independent steps [mm]")
    right.set(xlabel="iterations", ylabel="condition of the scaled KKT matrix")
    # Labels within less than two decades would overlap.
    left.xaxis.set_minor_formatter(NullFormatter())
    for axis in (left, right):
        axis.grid(alpha=0.3)
        axis.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=120)
