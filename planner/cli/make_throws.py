"""`throwplan make-throws`: a synthetic batch of measured throws."""

from __future__ import annotations

import argparse
import json
import math
import shutil
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...problems import InputError
from .command import DONE, add_out, command, number, whole
from .progress import ProgressLine

if TYPE_CHECKING:
    from ...problems import ThrowData
    from ..identify import Flown, Making

#: Options with a number: what is allowed, and what they say.
NUMBERS = {
    "stiffness": (1e3, 1e9, "of LuGre's bristles, 1/m (default: 1e6)"),
    "friction": (0.01, 10.0, "true friction (default: 0.8)"),
    "patch-radius": (1e-4, 0.05, "true patch radius, m (default: 0.0031)"),
}


def add_make_throws(commands: Any) -> None:
    """Adds `throwplan make-throws`."""
    example = "throwplan make-throws --out out/throws"
    words = "make a synthetic batch of measured throws"
    parser = command(commands, "make-throws", _make_throws, words, example)
    parser.add_argument("--seed", metavar="N", default="1", help="of the noise (default: 1)")
    laws = "what lets go of the bar: a rigid meshed patch (default) or LuGre bristles"
    parser.add_argument("--truth", choices=("patch", "lugre"), default="patch", help=laws)
    for option, (_, _, what) in NUMBERS.items():
        parser.add_argument(f"--{option}", metavar="NUMBER", help=what)
    parser.add_argument(
        "--repeats", metavar="N", default="5", help="throws per condition (default: 5)"
    )
    parser.add_argument("--no-noise", action="store_true", help="all repeats alike, exact")
    parser.add_argument(
        "--factors", action="store_true", help="and throws that vary surface, payload, inertia"
    )
    add_out(parser, "dataset.toml, throws.csv and the recordings (needed)")


def _make_throws(options: argparse.Namespace) -> int:
    from ...problems import write_throws
    from ..identify import make_throws, object_names

    started = time.perf_counter()
    making = _making(options)
    if options.out is None:
        raise InputError("--out: needs a folder's name")
    folder = Path(options.out)
    _check_place(folder)
    with ProgressLine("make-throws") as show:
        data, flown = make_throws(making, show)
    _put(folder, lambda place: write_throws(data, place, object_names()))
    found = _summary(data, flown) | {"seconds": round(time.perf_counter() - started, 1)}
    if options.json:
        print(json.dumps({"folder": str(folder)} | found, indent=2, allow_nan=False))
        return DONE
    landing, flight = found["landing"], found["flight_time"]
    print(f"{folder}: {found['throws']} synthetic throws, {found['batch']} of them the batch")
    print(f"  {found['synthetic']}")
    print(
        f"  landings at z = {data.shared.landing_height:g} m: x {landing['x'][0]:.2f} to "
        f"{landing['x'][1]:.2f} m, theta {landing['theta_deg'][0]:.0f} to "
        f"{landing['theta_deg'][1]:.0f} deg"
    )
    print(f"  flight time of the batch: {flight['mean']:.3f} s, standard deviation ", end="")
    print(f"{flight['std']:.3f} s; made in {found['seconds']:.0f} s")
    return DONE


def _making(options: argparse.Namespace) -> Making:
    """What the options ask for."""
    from ..identify import Law, Making, Noise

    given = {}
    for option, (low, high, _) in NUMBERS.items():
        word = getattr(options, option.replace("-", "_"))
        if word is None:
            continue
        value = number(f"--{option}", word)
        if not low <= value <= high:
            raise InputError(f"--{option} {word}: must be from {low:g} to {high:g}")
        given[option.replace("-", "_")] = value
    stiffness = given.pop("stiffness", None)
    if stiffness is not None and options.truth != "lugre":
        raise InputError("--stiffness: only with --truth lugre")
    law = Law(options.truth) if stiffness is None else Law(options.truth, stiffness)
    return Making(
        law=law,
        repeats=whole("--repeats", options.repeats, 1, 100),
        factors=options.factors,
        noise=Noise.none() if options.no_noise else Noise(),
        seed=whole("--seed", options.seed, 0, 2**32 - 1),
        **given,
    )


def _check_place(folder: Path) -> None:
    """InputError for a folder that holds anything but a synthetic data set; makes it."""
    from ...problems import THROW_DATA_FILES, prepare_folder, read_text, toml_tables

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


def _put(folder: Path, write: Any) -> None:
    """Writes beside what is there, then puts it in its place; the head goes last."""
    from ...problems import THROW_DATA_FILES

    try:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            write(Path(scratch))
            for name in THROW_DATA_FILES:
                old = folder / name
                shutil.rmtree(old) if old.is_dir() else old.unlink(missing_ok=True)
            for name in reversed(THROW_DATA_FILES):
                shutil.move(Path(scratch) / name, folder / name)
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror or error}") from None


def _summary(data: ThrowData, flown: list[Flown]) -> dict[str, Any]:
    """Counts, the true landings' ranges, and the batch's flight times [s]."""
    batch = [f for f, t in zip(flown, data.throws, strict=True) if t.factors["set"] == "batch"]
    times = [float(throw.landing[2]) for throw in batch]
    mean = sum(times) / len(times)
    x = [float(throw.landing[0]) for throw in flown]
    theta = [math.degrees(throw.landing[1]) for throw in flown]
    return {
        "synthetic": data.shared.synthetic,
        "throws": len(flown),
        "batch": len(batch),
        "landing_height": data.shared.landing_height,
        "landing": {"x": [min(x), max(x)], "theta_deg": [min(theta), max(theta)]},
        "flight_time": {
            "mean": mean,
            "std": math.sqrt(sum((t - mean) ** 2 for t in times) / len(times)),
        },
        "truth": data.truth,
    }
