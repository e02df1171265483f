"""A sweep as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ...problems import Distribution, Uncertainty
from ..result import Plan
from ..throw import release_model
from ..uncertainty import DelayScan
from ..verdict import INTO, Code

#: Errors in the table by their JSON key: label, unit, factor from SI, definition.
ERRORS = {
    "position": ("position", "mm", 1e3, ""),
    "angle": ("angle", "deg", math.degrees(1.0), ""),
    "scaled": ("pose error", "mm", 1e3, "  position plus angle times half the length"),
}
#: Names of parameters with their factor from SI and unit; all others are lengths or angles.
UNITS = (
    (("hand_vx", "hand_vz"), 1e3, "mm/s"),
    (("hand_omega",), math.degrees(1.0), "deg/s"),
    (("delay", "opening"), 1e3, "ms"),
    (("friction",), 1.0, ""),
    (("mass",), 1e3, "g"),
    (("inertia",), 1e6, "kg mm²"),
)


def sweep_summary(plan: Plan, label: str, result: dict[str, Any]) -> str:
    """Success, bias, quantiles and sensitivities of a sweep of `plan`, from its `to_dict`."""
    tolerance, scene = plan.scene.tolerance, plan.scene
    title = release_model(scene, result["model"]).title
    model = title if title == result["model"] else f"the {title}"
    lines = [f"{label}: {result['samples']:,} throws by {model}"]
    lines += [f"  {line}" for line in _words_of(scene.uncertain, scene.assumed_spreads)]
    box = "in the region, " if plan.target.is_region else ""
    box += f"within {1e3 * tolerance.position:g} mm"
    if plan.target.theta is not None:
        box += f", {math.degrees(tolerance.angle):g} deg"
    into_cup = result["in_cup"] is not None
    into = f"into the {scene.opening.KIND}" if scene.opening is not None else ""
    lines.append(f"  success {_percent(result['success'])} {into if into_cup else box}")
    if into_cup:
        lines.append(f"  {'':7} {_percent(result['in_tolerance'])} {box}")
    if "rests" in result:
        rests = result["rests"]
        words = f"rest {rests['place']}, of the first {rests['of']}"
        lines.append(f"  {'':7} {_percent(rests)} {words}")
    counted = {Code.LANDING, *(INTO if into_cup else ())}
    for code in Code:
        if code.value in result["broken"] and code not in counted:
            lines.append(f"  {'':7} {100 * result['broken'][code.value]:6.2f} % {code.fate}")
    bias = result["bias"]
    if bias["position"] is not None and bias["angle"] is not None:
        off = f"{1e3 * bias['position']:.3f} mm, {math.degrees(bias['angle']):.3f} deg"
        lines.append(f"  nominal landing {off} from the target; distances from it:")
    quantiles = result["quantiles"]
    lines.append(f"    {'':15}" + "".join(f"{key + ' %':>10}" for key in quantiles["position"]))
    for name, (title, unit, scale, note) in ERRORS.items():
        row = "".join(_cell(value, scale, 10, ".3f") for value in quantiles[name].values())
        lines.append(f"    {title + ' [' + unit + ']':15}{row}{note}")
    lines += _sensitivities(result["sensitivity"])
    mean = 1e3 * plan.scene.mean_delay
    about = f" of the mean of {mean:g} ms" if mean else ""
    inside = DelayScan(**result["delay_inside"])
    words = f"it succeeds {inside.words}"
    if not inside.fails:
        words += f"{about}, all else as planned"
    lines.append(f"  {words}; {result['time']:.1f} s")
    return "\n".join(lines)


def _sensitivities(sensitivity: dict[str, Any]) -> list[str]:
    """Changes of the landing by each parameter, and its shares of the variances."""
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
    """A number for the table, a dash for None."""
    return f"{'-' if value is None else format(scale * value, form):>{width}}"


def _words_of(section: Uncertainty, assumed: Sequence[str]) -> list[str]:
    """The uncertain parameters as text: one line each, in the units of the file."""
    lines = []
    for name in section.names:
        spread: Distribution = getattr(section, name)
        unit = math.degrees(1.0) if Uncertainty.PARAMETERS[name].degrees else 1.0
        times = " x the scene's" if spread.relative else ""
        about = "" if spread.mean is None else f" about {unit * spread.mean:g}"
        if spread.uniform == 0.0:
            words, about = f"exactly {unit * spread.expected:g}{times}", ""
        elif spread.uniform is not None:
            words = f"uniform +-{unit * spread.uniform:g}{times}"
        elif spread.normal is not None:
            words = f"normal, deviation {unit * spread.normal:g}{times}"
        else:
            words = f"{len(spread.samples)} given values{times}"
        given = " (assumed: [uncertainty] does not have it)" if name in assumed else ""
        lines.append(f"{Uncertainty.PARAMETERS[name].key}: {words}{about}{given}")
    return lines


def unit_of(name: str) -> tuple[float, str]:
    """Factor and unit in which people read a parameter."""
    for names, factor, unit in UNITS:
        if name in names:
            return factor, unit
    return (math.degrees(1.0), "deg") if Uncertainty.PARAMETERS[name].degrees else (1e3, "mm")
