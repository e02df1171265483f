"""`throwplan sweep`: a plan under timing and other uncertainty."""

from __future__ import annotations

import argparse
import inspect
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...problems import ROBUST_METHODS, InputError, Pose, Scene, load_scene
from ..sweep import unit_of
from .command import DONE, NO_THROW, add_out, add_scene, add_target, command, say, target_of
from .progress import ProgressLine

if TYPE_CHECKING:
    from ..result import Plan
    from ..sweep import Sweep

INTERRUPTED = 130


def add_sweep(commands: Any) -> None:
    """Adds `throwplan sweep`."""
    words = "throw a plan many times under uncertainty"
    example = "throwplan sweep delay --samples 10000 --out out/sweep"
    parser = command(commands, "sweep", _sweep, words, example)
    add_scene(parser)
    add_target(parser)
    parser.add_argument("--robust", choices=ROBUST_METHODS, help="plan against the uncertainty")
    parser.add_argument("--model", default="sp", metavar="NAME", help="release model (default: sp)")
    numbers = (
        ("--samples", "1000", "throws (default: 1000)"),
        ("--seed", "0", "of the samples (default: 0)"),
        ("--workers", None, "processes on this machine (default: 1); the result is the same"),
    )
    for option, default, what in numbers:
        parser.add_argument(option, metavar="N", default=default, help=what)
    parser.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler that spreads them")
    add_out(parser, "sweep.json, sweep.csv and four pictures")


def _sweep(options: argparse.Namespace) -> int:
    from ..sweep import check_sweep, executor_of, sweep_until_stopped

    samples, seed = _whole("--samples", options.samples), _whole("--seed", options.seed)
    workers = None if options.workers is None else _whole("--workers", options.workers)
    check_sweep(samples, seed, options.model, "--")
    scene = load_scene(options.scene)
    target = target_of(scene, options.target, options.azimuth)
    with executor_of(workers, options.scheduler) as executor:
        plan = _planned(scene, target, options)
        if not plan.solved:
            print(plan.json() if options.json else f"{scene.name}: {plan.status}")
            print(f"throwplan: {plan.message}", file=sys.stderr)
            return NO_THROW
        with ProgressLine(scene.name) as show:
            found = sweep_until_stopped(plan, samples, seed, options.model, executor, show)
    if found is None:
        raise KeyboardInterrupt
    if options.out is not None:
        say(options, f"{scene.name}: writing {options.out}")
        found.save(options.out)
    if options.json:
        print(json.dumps(found.to_dict(), indent=2, allow_nan=False))
    else:
        _print_sweep(found, options.out)
    if found.samples == samples:
        return DONE
    words = f"interrupted: {found.samples:,} of {samples:,} samples"
    print(f"throwplan: {words}", file=sys.stderr)
    return INTERRUPTED


def _planned(scene: Scene, target: Pose | None, options: argparse.Namespace) -> Plan:
    from ..plan import Planner

    more = {} if options.robust is None else {"robust": options.robust}
    if more and "robust" not in inspect.signature(Planner.plan).parameters:
        raise InputError("--robust: not available")
    say(options, f"{scene.name}: planning")
    planner = Planner(scene)
    planner.check(target)
    if options.out is not None:
        from ...problems import prepare_folder
        from ..sweep import FILES

        prepare_folder(Path(options.out), FILES)
    return planner.plan(target, **more)


def _whole(option: str, word: str) -> int:
    """`word` as a whole number; InputError naming `option`."""
    try:
        return int(word)
    except ValueError:
        raise InputError(f"{option} {word}: must be a whole number") from None


def _print_sweep(found: Sweep, out: str | None) -> None:
    """A sweep in some lines."""
    result, tolerance = found.to_dict(), found.plan.scene.tolerance
    usual = " (no [uncertainty] in the scene: assumed)" if result["assumed"] else ""
    print(f"{found.label}: {found.samples:,} throws by {result['model']}")
    for line in found.uncertain():
        print(f"  {line}{usual}")
    box = f"within {1e3 * tolerance.position:g} mm"
    if found.plan.target.theta is not None:
        box += f", {math.degrees(tolerance.angle):g} deg"
    where = "into the cup" if result["in_cup"] is not None else box
    print(f"  success {_percent(result['success'])} {where}")
    if result["in_cup"] is not None:
        print(f"  {'':7} {_percent(result['in_tolerance'])} {box}")
    if result["held"]["rate"] < 1.0:
        print(f"  {'held':7} {_percent(result['held'])} the others slip in the full grip")
    bias = result["bias"]
    if bias["position"] is not None and bias["angle"] is not None:
        off = f"{1e3 * bias['position']:.3f} mm, {math.degrees(bias['angle']):.3f} deg"
        print(f"  nominal landing {off} from the target; distances from it:")
    keys = list(result["quantiles"]["position"])
    print(f"    {'':14}" + "".join(f"{key + ' %':>10}" for key in keys))
    for name, unit, scale in (
        ("position", "mm", 1e3),
        ("angle", "deg", math.degrees(1.0)),
        ("scaled", "mm", 1e3),
    ):
        row = (_cell(result["quantiles"][name][key], scale) for key in keys)
        note = "  |dx| + |dtheta| l/2" if name == "scaled" else ""
        print(f"    {name + ' [' + unit + ']':14}" + "".join(row) + note)
    _print_sensitivity(result["sensitivity"])
    inside = result["delay_inside"]
    early, late = _delay(inside["early"], "-50"), _delay(inside["late"], "+50")
    print(f"  delays from {early} to {late} succeed, all else as planned; {result['time']:.1f} s")
    if out is not None:
        print(f"  written to {out}")


def _print_sensitivity(sensitivity: dict[str, Any]) -> None:
    """What a change of each parameter moves, and its share of the variance."""
    print(
        f"    {'a change of':24}{'x [mm]':>9}{'theta [deg]':>12}{'of var(x)':>12}"
        f"{'of var(theta)':>15}"
    )
    for name, slope in sensitivity.items():
        factor, unit = unit_of(name)
        amount, words = (1 / factor, f"1 {unit}") if unit else (0.1, "0.1")
        cells = [f"    {name + ' by ' + words:24}"]
        for axis, scale, width in (("x", 1e3, 9), ("theta", math.degrees(1.0), 12)):
            value = slope[axis]
            cells.append(
                f"{'-' if value is None else format(amount * scale * value, '.3g'):>{width}}"
            )
        first, second = (f"{100 * slope['share'][axis]:.1f} %" for axis in ("x", "theta"))
        print("".join(cells) + f"{first:>12}{second:>15}")


def _percent(rate: dict[str, float]) -> str:
    low, high = 100 * rate["low"], 100 * rate["high"]
    return f"{100 * rate['rate']:6.2f} % ({low:.2f} to {high:.2f})"


def _cell(value: float | None, scale: float) -> str:
    return f"{'-' if value is None else format(scale * value, '.3f'):>10}"


def _delay(value: float | None, beyond: str) -> str:
    return f"beyond {beyond} ms" if value is None else f"{1e3 * value:+.2f} ms"
