"""A sweep in some lines for people."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from .samples import unit_of

if TYPE_CHECKING:
    from .running import Sweep

#: Errors in the table: their unit, its size, and how the error is made up.
ERRORS = {
    "position": ("mm", 1e3, ""),
    "angle": ("deg", math.degrees(1.0), ""),
    "scaled": ("mm", 1e3, "  |dx| + |dtheta| l/2"),
}


def summary(found: Sweep) -> str:
    """Success, bias, quantiles, sensitivities."""
    result, tolerance = found.to_dict(), found.plan.scene.tolerance
    usual = " (no [uncertainty] in the scene: assumed)" if result["assumed"] else ""
    lines = [f"{found.label}: {found.samples:,} throws by {result['model']}"]
    lines += [f"  {line}{usual}" for line in found.uncertain()]
    box = f"within {1e3 * tolerance.position:g} mm"
    if found.plan.target.theta is not None:
        box += f", {math.degrees(tolerance.angle):g} deg"
    into_cup = result["in_cup"] is not None
    lines.append(f"  success {_percent(result['success'])} {'into the cup' if into_cup else box}")
    if into_cup:
        lines.append(f"  {'':7} {_percent(result['in_tolerance'])} {box}")
    if result["held"]["rate"] < 1.0:
        lines.append(f"  {'held':7} {_percent(result['held'])} the others slip in the full grip")
    bias = result["bias"]
    if bias["position"] is not None and bias["angle"] is not None:
        off = f"{1e3 * bias['position']:.3f} mm, {math.degrees(bias['angle']):.3f} deg"
        lines.append(f"  nominal landing {off} from the target; distances from it:")
    quantiles = result["quantiles"]
    lines.append(f"    {'':14}" + "".join(f"{key + ' %':>10}" for key in quantiles["position"]))
    for name, (unit, scale, note) in ERRORS.items():
        row = "".join(_cell(value, scale, 10, ".3f") for value in quantiles[name].values())
        lines.append(f"    {name + ' [' + unit + ']':14}{row}{note}")
    lines += _sensitivities(result["sensitivity"])
    inside = result["delay_inside"]
    early, late = (_delay(inside["early"], "-50"), _delay(inside["late"], "+50"))
    lines.append(
        f"  delays from {early} to {late} succeed, all else as planned; {result['time']:.1f} s"
    )
    return "\n".join(lines)


def _sensitivities(sensitivity: dict[str, Any]) -> list[str]:
    """How far a change of each parameter moves the landing, and its share of the variance."""
    heads = f"{'x [mm]':>9}{'theta [deg]':>12}{'of var(x)':>12}{'of var(theta)':>15}"
    lines = [f"    {'a change of':24}{heads}"]
    for name, slope in sensitivity.items():
        factor, unit = unit_of(name)
        amount, words = (1 / factor, f"1 {unit}") if unit else (0.1, "0.1")
        x = _cell(slope["x"], 1e3 * amount, 9, ".3g")
        theta = _cell(slope["theta"], math.degrees(amount), 12, ".3g")
        shares = (f"{100 * slope['share'][axis]:.1f} %" for axis in ("x", "theta"))
        first, second = shares
        lines.append(f"    {name + ' by ' + words:24}{x}{theta}{first:>12}{second:>15}")
    return lines


def _percent(rate: dict[str, float]) -> str:
    low, high = 100 * rate["low"], 100 * rate["high"]
    return f"{100 * rate['rate']:6.2f} % ({low:.2f} to {high:.2f})"


def _cell(value: float | None, scale: float, width: int, form: str) -> str:
    """A number for the table, a dash where there is none."""
    return f"{'-' if value is None else format(scale * value, form):>{width}}"


def _delay(value: float | None, beyond: str) -> str:
    return f"beyond {beyond} ms" if value is None else f"{1e3 * value:+.2f} ms"
