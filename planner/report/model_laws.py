"""How far converged laws of friction are from the meshed patch, and how well that is known."""

from __future__ import annotations

from collections.abc import Sequence

from .model_measures import ERRORS, FINE_MESH, SHOWN, Measured
from .model_runs import STIFFNESSES
from .page import Cell, Table

TRUTHS = """Converged answers come from other methods than the rows: `sp` from DOP853 at a relative
 tolerance of 1e-13, whose steps shrink at the law's corners by themselves; `ls`, `ls-step` and
 the patch from differential equations whose friction is rounded over 1e-10 m/s, by Radau with
 exact derivatives; `ils` from extrapolated time stepping. Only LuGre's is its own stepping,
 extrapolated.""".replace("\n", "")


def laws(measured: Sequence[Measured]) -> list[str | Table]:
    """How far converged laws are from the patch, and how well the answers are known."""
    names = {"sp": "sp", "ls": "limit surface"}
    names |= {f"{k:g}": f"LuGre, σ₀ {k:.0e} 1/m".replace("e+0", "e") for k in STIFFNESSES}
    rows: list[list[Cell]] = []
    for one in measured:
        for law, name in names.items():
            x, theta, twist, scaled = (float(v) for v in SHOWN * one.apart(law))
            rows.append([one.throw.title, name, x, theta, twist, scaled])
    columns = ["throw", "law", *ERRORS, "scaled landing [mm]"]
    words = "Model errors: each law's converged answer against the meshed Coulomb patch"
    table = Table("models-laws", words, columns, rows)
    sure: list[list[Cell]] = []
    seconds = {
        "sp": "RK4 with events located",
        "ls": "time stepping, extrapolated",
        "patch": "its own steps, extrapolated",
        "mesh": f"{FINE_MESH} points",
    }
    about = names | {"mesh": "patch"}
    for one in measured:
        for law, other in seconds.items():
            if law not in one.known:
                continue
            values = [float(v) for v in SHOWN * one.known[law]]
            sure.append([one.throw.title, about.get(law, law), other, *values])
    columns = ["throw", "law", "second method", *ERRORS, "scaled landing [mm]"]
    words = "How well the converged answers are known: their distance to a second method"
    nearest = min(("sp", "ls"), key=lambda law: max(one.apart(law)[3] for one in measured))
    far = {law: 1e3 * max(one.apart(law)[3] for one in measured) for law in ("sp", "ls")}
    text = (
        f"Converged, the nearest law to the patch is `{names[nearest]}`: at most "
        f"{far[nearest]:.2g} mm of scaled landing error in these throws (`sp` {far['sp']:.2g} mm, "
        f"limit surface {far['ls']:.2g} mm); random throws, at the end of this section, go "
        "further. Bristles are a band for compliant pads, not a better "
        "or a worse answer."
    )
    return [table, text, TRUTHS, Table("models-known", words, columns, sure)]
