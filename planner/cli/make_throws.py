"""`throwplan make-throws`: a synthetic batch of measured throws."""

from __future__ import annotations

import argparse
import math
import statistics
import time
from pathlib import Path
from typing import Any

from ...problems import (
    THROW_DATA_FILES,
    InputError,
    ThrowData,
    filling,
    prepare_folder,
    read_text,
    toml_tables,
    write_throws,
)
from ..identify import Flown, Making, Noise, make_throws, object_names
from .common import DONE, Progress, add_out, answer, number, whole

EXAMPLE = "throwplan make-throws --out out/throws"
#: Stiffness of the bristles unless told otherwise [1/m].
SOFT = 1e6


def arguments(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    add = parser.add_argument
    words = "of the noise (default: 1)"
    add("--seed", type=whole(0, 2**32 - 1), metavar="N", default=1, help=words)
    laws = "what lets go of the bar: a rigid meshed patch (default) or LuGre bristles"
    add("--truth", choices=("patch", "lugre"), default="patch", help=laws)
    words = "of LuGre's bristles, 1/m (default: 1e6)"
    add("--stiffness", type=number(1e3, 1e9), metavar="NUMBER", help=words)
    words = "true friction (default: 0.8)"
    add("--friction", type=number(0.01, 10), metavar="NUMBER", default=0.8, help=words)
    words = "true patch radius, m (default: 0.0031)"
    add("--patch-radius", type=number(1e-4, 0.05), metavar="NUMBER", default=0.0031, help=words)
    words = "throws per condition (default: 5)"
    add("--repeats", type=whole(1, 100), metavar="N", default=5, help=words)
    add("--no-noise", action="store_true", help="all repeats alike, exact")
    add("--factors", action="store_true", help="and throws that vary surface, payload, inertia")
    add_out(parser, "dataset.toml, throws.csv and the recordings (needed)")


def run(options: argparse.Namespace) -> int:
    """Makes the throws, writes them and prints their ranges."""
    started = time.perf_counter()
    making = _making(options)
    if options.out is None:
        raise InputError("--out: needs a folder's name")
    folder = Path(options.out)
    _check_place(folder)
    with Progress("make-throws") as progress:
        data, flown = make_throws(making, progress)
    with filling(folder, THROW_DATA_FILES) as scratch:
        write_throws(data, scratch, object_names())
    found = _ranges(data, flown) | {"seconds": round(time.perf_counter() - started, 1)}
    x, theta, flight = found["landing"]["x"], found["landing"]["theta_deg"], found["flight_time"]
    text = (
        f"{folder}: {found['throws']} synthetic throws, {found['batch']} of them the batch\n"
        f"  {found['synthetic']}\n"
        f"  landings at z = {data.shared.landing_height:g} m: x {x[0]:.2f} to {x[1]:.2f} m, "
        f"theta {theta[0]:.0f} to {theta[1]:.0f} deg\n"
        f"  flight time of the batch: {flight['mean']:.3f} s, standard deviation "
        f"{flight['std']:.3f} s; made in {found['seconds']:.0f} s"
    )
    answer(options, {"folder": str(folder)} | found, text)
    return DONE


def _making(options: argparse.Namespace) -> Making:
    """What the options ask for."""
    lugre = options.truth == "lugre"
    if options.stiffness is not None and not lugre:
        raise InputError("--stiffness: only with --truth lugre")
    return Making(
        stiffness=options.stiffness or SOFT if lugre else None,
        friction=options.friction,
        patch_radius=options.patch_radius,
        repeats=options.repeats,
        factors=options.factors,
        noise=Noise.none() if options.no_noise else Noise(),
        seed=options.seed,
    )


def _check_place(folder: Path) -> None:
    """InputError for a folder that holds anything but a synthetic data set; makes it."""
    prepare_folder(folder)
    held = sorted(path.name for path in folder.iterdir())
    if not held:
        return
    other = [name for name in held if name not in THROW_DATA_FILES]
    if other:
        raise InputError(f"--out {folder}: holds {other[0]}, not overwritten; name a new folder")
    head = folder / "dataset.toml"
    if not head.is_file() or not toml_tables(read_text(head), str(head)).get("synthetic"):
        raise InputError(
            f"--out {folder}: holds throws that are not labelled synthetic, not overwritten"
        )


def _ranges(data: ThrowData, flown: list[Flown]) -> dict[str, Any]:
    """Counts, the true landings' ranges, and the batch's flight times [s]."""
    batch = [f for f, t in zip(flown, data.throws, strict=True) if t.factors["set"] == "batch"]
    times = [float(throw.landing[2]) for throw in batch]
    x = [float(throw.landing[0]) for throw in flown]
    theta = [math.degrees(throw.landing[1]) for throw in flown]
    return {
        "synthetic": data.shared.synthetic,
        "throws": len(flown),
        "batch": len(batch),
        "landing_height": data.shared.landing_height,
        "landing": {"x": [min(x), max(x)], "theta_deg": [min(theta), max(theta)]},
        "flight_time": {"mean": statistics.fmean(times), "std": statistics.pstdev(times)},
        "truth": data.truth,
    }
