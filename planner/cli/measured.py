"""Commands on measured throws: `make-throws`, `identify`, `calibrate`, `validate`."""

from __future__ import annotations

import argparse
import math
import statistics
import time
from functools import partial
from pathlib import Path
from typing import Any

from ...models.release import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems import Calibration, InputError
from ...problems.files import prepare_folder, read_text, toml_tables
from ...problems.scene_files import load_scene
from ...problems.throws import THROW_DATA_FILES, ThrowData, load_throws, write_throws
from ..identify import (
    CALIBRATE_FILES,
    IDENTIFY_FILES,
    calibrate,
    check_model,
    identify,
    one_surface,
    save_identified,
    summary_of,
)
from ..validation import (
    BARS,
    PAPER_MODELS,
    VALIDATION_FILES,
    Flown,
    Noise,
    SynthesisConfig,
    as_dict,
    as_text,
    make_throws,
    save_validation,
    validate,
)
from .common import (
    DONE,
    Add,
    Progress,
    add_out,
    integer,
    number,
    prepare_out,
    print_result,
    save_out,
    written,
)

DATA = "a folder with dataset.toml and throws.csv"
#: The models of `--model all`.
FITTED = (SLIDING_PIVOT, STEPPED_SURFACE)


def make_throws_arguments(add: Add) -> None:
    """The options of `make-throws`."""
    words = "of the noise (default: 1)"
    add("--seed", type=integer(0, 2**32 - 1), metavar="N", default=1, help=words)
    laws = "true release law: a rigid meshed patch (default) or LuGre bristles"
    add("--truth", choices=("patch", "lugre"), default="patch", help=laws)
    words = "of LuGre's bristles, 1/m (default: 1e6)"
    add("--stiffness", type=number(1e3, 1e9), metavar="NUMBER", help=words)
    words = "true friction (default: 0.8)"
    add("--friction", type=number(0.01, 10), metavar="NUMBER", default=0.8, help=words)
    words = "true patch radius, m (default: 0.0031)"
    add("--patch-radius", type=number(1e-4, 0.05), metavar="NUMBER", default=0.0031, help=words)
    words = "throws per condition (default: 5)"
    add("--repeats", type=integer(1, 100), metavar="N", default=5, help=words)
    add("--no-noise", action="store_true", help="no scatter, exact measurements")
    add("--factors", action="store_true", help="and throws that vary surface, payload, inertia")
    add_out(add, "dataset.toml, throws.csv and the recordings (needed)")


def make_synthetic(options: argparse.Namespace) -> int:
    """Make a synthetic data set of measured throws.

    example: throwplan make-throws --out out/throws
    """
    started = time.perf_counter()
    lugre = options.truth == "lugre"
    if options.stiffness is not None and not lugre:
        raise InputError("--stiffness: only with --truth lugre")
    config = SynthesisConfig(
        stiffness=options.stiffness or 1e6 if lugre else None,
        friction=options.friction,
        patch_radius=options.patch_radius,
        repeats=options.repeats,
        factors=options.factors,
        noise=Noise.none() if options.no_noise else Noise(),
        seed=options.seed,
    )
    if options.out is None:
        raise InputError("--out: needs a folder's name")
    folder = Path(options.out)
    _check_place(folder)
    with Progress("make-throws") as progress:
        data, flown = make_throws(config, progress)
    write_throws(data, folder, {bar: name for name, bar in BARS.items()})
    found = _ranges(data, flown) | {"seconds": round(time.perf_counter() - started, 1)}
    x, theta = found["landing"].values()
    flight = found["flight_time"]
    text = (
        f"{folder}: {found['throws']} synthetic throws, {found['batch']} of them the batch\n"
        f"  {found['synthetic']}\n"
        f"  landings at z = {data.shared.landing_height:g} m: x {x[0]:.2f} to {x[1]:.2f} m, "
        f"theta {theta[0]:.0f} to {theta[1]:.0f} deg\n"
        f"  flight time of the batch: {flight['mean']:.3f} s, standard deviation "
        f"{flight['std']:.3f} s; made in {found['seconds']:.0f} s"
    )
    print_result(options, {"folder": str(folder)} | found, text)
    return DONE


def identify_arguments(add: Add) -> None:
    """The options of `identify`."""
    add("data", metavar="DATA", help=DATA)
    allowed = f"release model (default: the prior's, or {STEPPED_SURFACE}), or all: "
    add("--model", default="", metavar="NAME", help=allowed + ", ".join(FITTED))
    add("--delay", action="store_true", help="fit a delay of the opening, too")
    add("--grip-scale", action="store_true", help="and the grip force's scale")
    add(
        "--prior",
        metavar="SCENE",
        help="scene whose [contact] and [uncertainty] say what is believed before",
    )
    _add_selection(add)
    add_out(add, "identify.json, contact.toml, a picture")


def _add_selection(add: Add) -> None:
    """The options that select throws, for `_selected`."""
    add("--throws", type=integer(1, 1_000_000), metavar="N", help="only the first N throws")
    look = {"nargs": "+", "action": "extend", "default": [], "metavar": "FACTOR=LABEL"}
    add("--only", help="only throws with this label", **look)


def identify_models(options: argparse.Namespace) -> int:
    """Fit friction and patch radius to measured throws.

    example: throwplan identify out/throws --model ls-step --out out/fit
    """
    models: tuple[str, ...] = FITTED if options.model == "all" else (options.model,)
    for model in filter(None, models):
        check_model(model)
    with Progress(f"{options.data}: reading"):
        data = _selected(load_throws(options.data), options)
    prior = None if options.prior is None else load_scene(options.prior)
    prepare_out(options, IDENTIFY_FILES)
    with Progress(data.name) as progress:
        fit = partial(identify, data, prior=prior, delay=options.delay, about=progress.about)
        found = [fit(model, grip_scale=options.grip_scale) for model in models]
    save_out(options, data.name, partial(save_identified, found))
    text = summary_of(found)
    if options.out is not None:
        text += f"{written(options)}; contact.toml is for a scene, in place of its [contact] and "
        text += "[uncertainty]"
    print_result(options, [one.to_dict() for one in found], text)
    return DONE


def calibrate_arguments(add: Add) -> None:
    """The options of `calibrate`."""
    words = f"{DATA}, or a CSV file with plan, x [m] and theta [rad] of each landing"
    add("data", metavar="DATA", help=words)
    add("--scene", metavar="SCENE", required=True, help="the scene to calibrate")
    low, high = Calibration.LEVEL["least"], Calibration.LEVEL["most"]
    words = "share of new throws in the region (default: 0.9, from 9 throws on)"
    add("--level", type=number(low, high), metavar="SHARE", default=0.9, help=words)
    words = "fit friction and radius to these throws too; for each throw to the others"
    add("--fit", action="store_true", help=words)
    _add_selection(add)
    add_out(add, "calibration.toml, calibrate.json and a picture")


def calibrate_scene(options: argparse.Namespace) -> int:
    """Learn bias and scatter of a scene's landings from measured throws.

    example: throwplan calibrate out/throws --scene my.toml --out out/calibration
    """
    scene = load_scene(options.scene)
    data: ThrowData | str = options.data
    if Path(options.data).is_dir():
        with Progress(f"{options.data}: reading"):
            data = _selected(load_throws(options.data), options)
    elif options.fit or options.only or options.throws is not None:
        raise InputError("--fit, --only, --throws: only for a folder of measured throws")
    prepare_out(options, CALIBRATE_FILES)
    with Progress(f"{scene.name}: calibrating") as progress:
        found = calibrate(data, scene, options.level, fit=options.fit, progress=progress)
    save_out(options, scene.name, found.save)
    text = f"{found.summary()}\n\n{found.text()}" if options.out is None else found.summary()
    if options.out is not None:
        text += f"{written(options)}; calibration.toml is a section for the scene"
    print_result(options, found.to_dict(), text)
    return DONE


def validate_arguments(add: Add) -> None:
    """The options of `validate`."""
    add("data", metavar="DATA", help=DATA)
    words = f"release models, with commas (default: {','.join(PAPER_MODELS)})"
    add("--models", metavar="A,B,C", help=words)
    add_out(add, "validation.md, tables as CSV and two pictures")


def validate_models(options: argparse.Namespace) -> int:
    """Compare release models on measured throws.

    example: throwplan validate out/throws --out out/validation
    """
    models = PAPER_MODELS if options.models is None else _models(options.models)
    with Progress(f"{options.data}: reading"):
        data = load_throws(options.data)
    prepare_out(options, VALIDATION_FILES)
    with Progress() as progress:
        found = validate(data, models, progress.about)
    save_out(options, data.name, partial(save_validation, found))
    text = f"{as_text(found)}\n\n{found.seconds:.0f} s" + written(options)
    print_result(options, as_dict(found), text)
    return DONE


def _check_place(folder: Path) -> None:
    """InputError for a folder that holds anything but a synthetic data set."""
    prepare_folder(folder)
    names = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    if not names:
        return
    other = [name for name in names if name not in THROW_DATA_FILES]
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


def _selected(data: ThrowData, options: argparse.Namespace) -> ThrowData:
    """The throws of the options; of several surfaces those on the most frequent one."""
    numbers = list(range(len(data.throws)))
    for word in options.only:
        name, found, label = word.partition("=")
        labels = data.factors.get(name)
        if not found or labels is None:
            allowed = ", ".join(data.factors) or "this data set has none"
            raise InputError(f"--only {word}: must be FACTOR=LABEL (factors: {allowed})")
        if label not in labels:
            raise InputError(f"--only {word}: {name} must be one of {', '.join(labels)}")
        numbers = [i for i in numbers if data.throws[i].factors.get(name) == label]
    numbers = numbers[: options.throws]
    if not numbers:
        raise InputError(f"--only {' '.join(options.only)}: no throw has all these labels")
    return one_surface(data.picked(numbers))


def _models(words: str) -> tuple[str, ...]:
    """The models of `--models a,b,c`, checked."""
    names = tuple(dict.fromkeys(word.strip() for word in words.split(",") if word.strip()))
    if not names:
        raise InputError(f"--models {words!r}: names no model")
    for name in names:
        try:
            check_model(name)
        except InputError as error:
            raise error.within("--models") from None
    return names
