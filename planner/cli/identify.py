"""`throwplan identify`: contact parameters from measured throws."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...models import IDENTIFIED, MODELS, STEPPED_SURFACE
from ...problems import InputError, ThrowData, load_scene, load_throws, prepare_folder
from ..identify import (
    IDENTIFY_FILES,
    SURFACE,
    UNKNOWNS,
    Identified,
    check_model,
    identify,
    save_identified,
    usual_surface,
)
from .common import DONE, Progress, add_out, answer, whole

EXAMPLE = "throwplan identify out/throws --model ls-step --out out/fit"
MOST_THROWS = 1_000_000


def arguments(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    add = parser.add_argument
    add("data", metavar="DATA", help="a folder with dataset.toml and throws.csv")
    add(
        "--model",
        default=STEPPED_SURFACE,
        metavar="NAME",
        help=f"release model (default: ls-step), or all: {', '.join(IDENTIFIED)}",
    )
    add("--no-grid", action="store_true", help="only the fit, not the 20 x 20 grid")
    add("--delay", action="store_true", help="fit a delay of the opening, too")
    add("--grip-scale", action="store_true", help="and the grip force's scale")
    add("--prior", metavar="SCENE", help="its [contact] and [uncertainty]")
    add("--throws", type=whole(1, MOST_THROWS), metavar="N", help="only the first N throws")
    add(
        "--only",
        metavar="FACTOR=LABEL",
        nargs="+",
        action="extend",
        default=[],
        help="only throws with this label",
    )
    add_out(parser, "identify.json, contact.toml, the grids and pictures")


def run(options: argparse.Namespace) -> int:
    """Fits each model, writes and prints."""
    models: tuple[str, ...] = IDENTIFIED if options.model == "all" else (options.model,)
    if options.no_grid and len(models) > 1:
        # One that chatters has a grid only.
        models = tuple(model for model in models if not MODELS[model].chatters)
    for model in models:
        check_model(model)
    data = _chosen(load_throws(options.data), options)
    prior = None if options.prior is None else load_scene(options.prior)
    if options.out is not None:
        prepare_folder(Path(options.out), IDENTIFY_FILES)
    with Progress(data.name) as progress:
        found = [
            identify(
                data,
                model,
                prior=prior,
                delay=options.delay,
                grip_scale=options.grip_scale,
                grid=not options.no_grid,
                about=progress.about,
            )
            for model in models
        ]
    if options.out is not None:
        save_identified(found, Path(options.out))
    answer(options, [one.to_dict() for one in found], _text(found, options.out))
    return DONE


def _chosen(data: ThrowData, options: argparse.Namespace) -> ThrowData:
    """The throws that the options ask for; of several surfaces those on the usual one."""
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
    chosen = data.picked(numbers)
    return chosen.picked(usual_surface(chosen))


def _text(found: list[Identified], out: str | None) -> str:
    """The data's own lines, then what each model found."""
    data = found[0].data
    surface = data.factors.get(SURFACE, [""])[0]
    lines = [f"{data.name}: {len(data.throws)} throws" + (f" on {surface}" if surface else "")]
    if {"friction", "patch_radius"} <= set(data.truth):
        known = [f"{name} {data.truth[name]:g}" for name in UNKNOWNS if name in data.truth]
        product = data.truth["friction"] * data.truth["patch_radius"]
        lines.append(f"  truth: {', '.join(known)}; mu r_p {1e3 * product:.4g} mm")
    lines += [one.summary() for one in found]
    if out is not None:
        lines.append(
            f"  written to {out}; contact.toml is for a scene, "
            "in place of its [contact] and [uncertainty]"
        )
    return "\n".join(lines)
