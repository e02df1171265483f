"""A plan under uncertainty: what is thrown, what comes of it, as JSON and as files."""

from __future__ import annotations

import math
import time
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models import BATCH_MODELS, MODELS, Array, Indices
from ...problems import USUAL_UNCERTAINTY, checked, filling, plain, write_json
from ..check import named_model
from ..result import Plan
from .pictures import draw_sweep
from .samples import Sampler, sampler_of, unit_of, words_of
from .statistics import (
    DelayScan,
    derivatives,
    quantiles,
    scaled_error,
    scan_delays,
    variance_shares,
)
from .throws import Flags, Outcomes, Thrower, thrower_of
from .workers import Progress, run_sweep

#: Most samples of one sweep: their parameters and landings stay in memory.
MOST = 10_000_000
#: What a sweep leaves in its folder.
SWEEP_FILES = ("landings.png", "delay.png", "tornado.png", "sweep.csv", "sweep.json")
#: Rows of sweep.csv that are put into words at a time.
ROWS = 8192
#: Errors in the table: their unit, its size, and how the error is made up.
ERRORS = {
    "position": ("mm", 1e3, ""),
    "angle": ("deg", math.degrees(1.0), ""),
    "scaled": ("mm", 1e3, "  |dx| + |dtheta| l/2"),
}


@dataclass(frozen=True)
class Sweep:
    """A plan's sent motion thrown with sampled parameters, by one release model.

    numbers (N,): places in the sequence of samples; values (N, P): their parameters,
    columns as `sampler.names`, SI units; landings: what came of them, and of the plan's
    own values in `nominal`. derivatives: (dx, dtheta) by the parameter, shares: of their
    variances. delays: landings over the delay alone. asked: samples that were asked for,
    N unless Ctrl-C came first. seconds: time of all that.
    """

    plan: Plan
    thrower: Thrower
    sampler: Sampler
    asked: int
    numbers: Indices
    values: Array
    landings: Outcomes
    nominal: Outcomes
    derivatives: dict[str, tuple[float, float]]
    shares: dict[str, tuple[float, float]]
    delays: DelayScan
    seconds: float

    @property
    def samples(self) -> int:
        """Throws that were made."""
        return len(self.numbers)

    def __repr__(self) -> str:
        """A line: its arrays would fill a screen."""
        rate = 100 * float(self.success.mean())
        return f"Sweep({self.label}: {self.samples:,} throws, {rate:.1f} % succeed)"

    @property
    def robust(self) -> bool:
        """Whether the plan was made against uncertainty."""
        return bool(self.plan.robust)

    @property
    def label(self) -> str:
        """The scene's name, and what made its plan robust."""
        name = self.plan.scene.name
        return f"{name}, robust ({self.plan.robust})" if self.plan.robust else name

    @property
    def success(self) -> Flags:
        """(N,): inside the tolerance, or into the cup; and held until the opening."""
        return self.thrower.succeeds(self.landings)

    @property
    def errors(self) -> dict[str, Array]:
        """Distances (N,) from the nominal landing: position [m], angle [rad], scaled [m]."""
        scene, target = self.plan.scene, self.plan.target
        dx, dtheta = (self.landings.pose - self.nominal.pose).T[:2]
        scaled = scaled_error(dx, dtheta, scene.object.length, target.theta is not None)
        return {"position": np.abs(dx), "angle": np.abs(dtheta), "scaled": scaled}

    def to_dict(self) -> dict[str, Any]:
        """The sweep as JSON: SI units, radians.

        bias: of the nominal landing from the target; position and angle are sizes, x and
        theta signed. quantiles: of the distances from the nominal landing. sensitivity:
        derivatives by the parameter, and shares of the variances. delay_inside: the
        largest delays [s] beyond the mean that still succeed, null beyond 50 ms.
        """
        scene, target = self.plan.scene, self.plan.goal
        x, theta = (float(value) for value in self.nominal.pose[0, :2])
        dx = x - target.plane_x
        dtheta = 0.0 if target.theta is None else theta - target.theta
        spread = np.nanstd(self.landings.pose[:, :2], axis=0) if self._lands else [math.nan] * 2
        found = {
            "scene": scene.name,
            "samples": self.samples,
            "asked": self.asked,
            "seed": self.sampler.seed,
            "model": self.thrower.model,
            "robust": self.robust,
            "uncertain": self.sampler.names,
            "assumed": scene.uncertainty is None,
            "success": _rate(self.success),
            "in_tolerance": _rate(self.landings.in_tolerance),
            "in_cup": None if scene.cup is None else _rate(self.landings.in_cup),
            "held": _rate(self.landings.held),
            "nominal": {"x": x, "theta": theta},
            "bias": {"position": abs(dx), "angle": abs(dtheta), "x": dx, "theta": dtheta},
            "deviation": {"x": spread[0], "theta": spread[1]},
            "quantiles": {name: quantiles(errors) for name, errors in self.errors.items()},
            "sensitivity": {
                name: dict(zip(("x", "theta"), self.derivatives[name], strict=True))
                | {"share": dict(zip(("x", "theta"), self.shares[name], strict=True))}
                for name in self.sampler.names
            },
            "delay_inside": {"early": self.delays.early, "late": self.delays.late},
            "time": self.seconds,
        }
        made: dict[str, Any] = plain(found)
        return made

    def summary(self) -> str:
        """The sweep in some lines for people."""
        return _summary(self)

    def save(self, folder: str | Path) -> None:
        """Write sweep.json, sweep.csv and three pictures; InputError if that cannot be done."""
        with filling(Path(folder), SWEEP_FILES) as scratch:
            draw_sweep(self, scratch)
            self._write_samples(scratch / "sweep.csv")
            write_json(scratch / "sweep.json", self.to_dict())

    def _write_samples(self, path: Path) -> None:
        """A row a sample: its number, parameters, landing and success (0 or 1)."""
        names, landings = self.sampler.names, self.landings
        header = ["sample", *names, "x", "theta", "flight_time", "success", "held"]
        columns = [self.numbers, *self.values.T, *landings.pose.T, self.success, landings.held]
        formats = ["%d", *["%.9g"] * (len(names) + 3), "%d", "%d"]
        with path.open("w", encoding="utf-8") as file:
            file.write(",".join(header) + "\n")
            for first in range(0, self.samples, ROWS):
                rows = np.column_stack([column[first : first + ROWS] for column in columns])
                np.savetxt(file, rows, delimiter=",", fmt=formats)

    @property
    def _lands(self) -> bool:
        return bool(np.isfinite(self.landings.pose[:, 0]).any())

    def uncertain(self) -> list[str]:
        """What was taken to be uncertain, in words."""
        return words_of(self.plan.scene.uncertainty or USUAL_UNCERTAINTY)


def sweep(
    plan: Plan,
    samples: int = 1000,
    seed: int = 0,
    model: str = "",
    executor: Executor | None = None,
) -> Sweep:
    """Throw a solved plan's sent motion under its scene's [uncertainty].

    Without that section: under an opening delay uniform in +-10 ms. model: of the release; the
    one that the scene's tolerance names if empty. The samples are a
    seeded Sobol sequence and the same for every executor, which spreads chunks of them.
    Raises InputError for a plan without a throw, an unknown model, numbers out of range.
    """
    found = sweep_until_stopped(plan, samples, seed, model, executor)
    if found is None or found.samples < samples:
        raise KeyboardInterrupt
    return found


def sweep_until_stopped(
    plan: Plan,
    samples: int = 1000,
    seed: int = 0,
    model: str = "",
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Sweep | None:
    """The same; after Ctrl-C the sweep of what was done until then, None if nothing was."""
    started = time.perf_counter()
    model = model or checked("plan", plan, Plan, {}).scene.tolerance.model
    check_sweep(samples, seed, model)
    sampler = sampler_of(plan.scene, seed)
    thrower = thrower_of(plan, model, sampler)
    thrown = run_sweep(thrower, sampler, samples, executor, progress)
    if thrown is None:
        return None
    numbers, values, landings = thrown
    shares = [variance_shares(values, landings.pose[:, column]) for column in (0, 1)]
    return Sweep(
        plan,
        thrower,
        sampler,
        asked=samples,
        numbers=numbers,
        values=values,
        landings=landings,
        nominal=thrower.throw(thrower.nominal()),
        derivatives=derivatives(thrower, sampler),
        shares=dict(zip(sampler.names, zip(*shares, strict=True), strict=True)),
        delays=scan_delays(thrower),
        seconds=time.perf_counter() - started,
    )


def check_sweep(samples: int, seed: int, model: str, prefix: str = "") -> None:
    """InputError for numbers out of range and unknown models; `prefix` as on the command line."""
    named_model(model, BATCH_MODELS, prefix=prefix)
    for name, value, low, high in (("samples", samples, 1, MOST), ("seed", seed, 0, 2**32 - 1)):
        checked(f"{prefix}{name}", value, int, {"least": low, "most": high})


def _rate(successes: Flags) -> dict[str, float]:
    """Share of the throws and its Wilson 95 % interval."""
    from scipy.stats import binomtest

    count, total = int(successes.sum()), successes.size
    interval = binomtest(count, total).proportion_ci(method="wilson")
    return {"rate": count / total, "low": float(interval.low), "high": float(interval.high)}


def _summary(found: Sweep) -> str:
    """Success, bias, quantiles, sensitivities."""
    result, tolerance = found.to_dict(), found.plan.scene.tolerance
    usual = " (no [uncertainty] in the scene: assumed)" if result["assumed"] else ""
    by = f"{result['model']} ({MODELS[result['model']].title})"
    lines = [f"{found.label}: {found.samples:,} throws by {by}"]
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
