"""`throwplan identify`: contact parameters from measured throws."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...problems import InputError, load_scene
from .command import DONE, add_out, command, whole
from .progress import ProgressLine

if TYPE_CHECKING:
    from ...problems import ThrowData
    from ..identify import Belief, Identified

#: What `--model all` stands for.
ALL = ("ls", "sp", "ls-step")
MOST_THROWS = 1_000_000


def add_identify(commands: Any) -> None:
    """Adds `throwplan identify`."""
    example = "throwplan identify out/throws --model ls-step --out out/fit"
    words = "fit friction and patch radius to measured throws"
    parser = command(commands, "identify", _identify, words, example)
    parser.add_argument("data", metavar="DATA", help="a folder with dataset.toml and throws.csv")
    parser.add_argument(
        "--model",
        default="ls-step",
        metavar="NAME",
        help=f"release model (default: ls-step), or all: {', '.join(ALL)}",
    )
    parser.add_argument("--no-grid", action="store_true", help="only the fit, not the 20 x 20 grid")
    parser.add_argument("--delay", action="store_true", help="fit a delay of the opening, too")
    parser.add_argument("--grip-scale", action="store_true", help="and the grip force's scale")
    parser.add_argument("--prior", metavar="SCENE", help="its [contact] and [uncertainty]")
    parser.add_argument("--throws", metavar="N", help="only the first N throws")
    parser.add_argument(
        "--only",
        metavar="FACTOR=LABEL",
        nargs="+",
        action="extend",
        default=[],
        help="only throws with this label",
    )
    parser.add_argument("--workers", metavar="N", default="1", help="processes (default: 1)")
    add_out(parser, "identify.json, contact.toml, the grids and pictures")


def _identify(options: argparse.Namespace) -> int:
    from ...problems import load_throws
    from ..identify import IDENTIFY_FILES as FILES
    from ..identify import check_model, identify, save_identified
    from ..sweep import executor_of

    models: tuple[str, ...] = ALL if options.model == "all" else (options.model,)
    if options.no_grid and len(models) > 1:
        models = tuple(model for model in models if model != "ls")  # it has a grid only
    for model in models:
        check_model(model)
    workers = whole("--workers", options.workers, 1, 256)
    data = _chosen(load_throws(options.data), options)
    prior = None if options.prior is None else load_scene(options.prior)
    if options.out is not None:
        from ...problems import prepare_folder

        prepare_folder(Path(options.out), FILES)
    found = []
    with executor_of(workers, None) as executor, ProgressLine(data.name) as show:
        line = show.__self__  # type: ignore[attr-defined]
        for model in models:
            one = identify(
                data,
                model,
                prior=prior,
                delay=options.delay,
                grip_scale=options.grip_scale,
                grid=not options.no_grid,
                executor=executor,
                workers=workers,
                about=line.about,
            )
            found.append(one)
    if options.out is not None:
        save_identified(found, Path(options.out))
    if options.json:
        print(json.dumps([one.to_dict() for one in found], indent=2, allow_nan=False))
    else:
        _print(found, options.out)
    if all(one.fit is None and one.model != "ls" for one in found):
        print("throwplan: no fit: too slow, see above; give fewer --throws", file=sys.stderr)
    return DONE


def _chosen(data: ThrowData, options: argparse.Namespace) -> ThrowData:
    """The throws that the options ask for; of several surfaces those on the usual one."""
    from ..identify import usual_surface

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
    if options.throws is not None:
        numbers = numbers[: whole("--throws", options.throws, 1, MOST_THROWS)]
    if not numbers:
        raise InputError(f"--only {' '.join(options.only)}: no throw has all these labels")
    chosen = data.picked(numbers)
    return chosen.picked(usual_surface(chosen))


def _print(found: list[Identified], out: str | None) -> None:
    """What was found, in some lines a model."""
    from ..identify import SURFACE, UNKNOWNS

    data = found[0].data
    surface = data.factors.get(SURFACE, [""])[0]
    print(f"{data.name}: {len(data.throws)} throws" + (f" on {surface}" if surface else ""))
    if {"friction", "patch_radius"} <= set(data.truth):
        known = [name for name in UNKNOWNS if name in data.truth]
        truth = ", ".join(f"{name} {data.truth[name]:g}" for name in known)
        product = data.truth["friction"] * data.truth["patch_radius"]
        print(f"  truth: {truth}; mu r_p {1e3 * product:.4g} mm")
    for one in found:
        print(f"  {one.model}:")
        _print_grid(one)
        if one.fit is not None:
            _print_fit(one, one.posterior)
        elif one.model == "ls":
            print("    no fit: its landings are no smooth function of the parameters")
    if out is not None:
        print(f"  written to {out}; contact.toml is for a scene,", end=" ")
        print("in place of its [contact] and [uncertainty]")


def _print_grid(one: Identified) -> None:
    """The grid's lines, and what a slow model would take."""
    if one.each is not None and one.whole is not None:
        print(
            f"    {1e3 * one.each:.3g} ms a throw, timed on a subset; the grid of "
            f"{400 * len(one.data.throws):,} predictions would take {one.whole / 60:.3g} min "
            "(extrapolated)" + ("" if one.grid is not None else ", not run")
        )
    if one.grid is None:
        return
    told = one.grid.to_dict()
    print(
        f"    grid: least mean error {100 * told['least_error']:.3f} cm (most "
        f"{100 * told['most_error']:.3f}) at friction {told['friction']:.3g}, patch_radius "
        f"{1e3 * told['patch_radius']:.3g} mm, mu r_p {1e3 * told['product']:.3g} mm"
    )
    lost = f", {told['missed']} do not land" if told["missed"] else ""
    print(
        f"    {told['predictions']:,} predictions in {told['seconds']:.1f} s, "
        f"{1e3 * told['time_per_throw']:.3g} ms a throw{lost}"
    )


def _print_fit(one: Identified, belief: Belief) -> None:
    """The fit's lines."""
    fit = one.fit
    assert fit is not None and one.error is not None
    parts = []
    for name, value in belief.values().items():
        deviation = belief.deviation(name)
        if name == "delay":
            parts.append(f"delay {1e3 * value:.2f} +- {1e3 * deviation:.2f} ms")
            continue
        unit, factor = (" mm", 1e3) if name == "patch_radius" else ("", 1.0)
        parts.append(f"{name} {factor * value:.4g}{unit} +- {100 * deviation:.2g} %")
    print(f"    fit: {', '.join(parts)}")
    print(
        f"    mu r_p {1e3 * belief.product:.4g} mm +- {100 * belief.product_deviation:.2g} %, "
        f"mean error {100 * one.error:.3f} cm; {fit.derivatives}, {fit.evaluations} evaluations, "
        f"{fit.seconds:.1f} s"
    )
    if max(fit.scatter) > 1.0:
        print(
            f"    residuals are {fit.scatter[0]:.1f} (x) and {fit.scatter[1]:.1f} (theta) times "
            "the measurement's noise: the model errs, or the noise is larger"
        )
    if fit.at_bound:
        print(f"    {', '.join(fit.at_bound)}: at the edge of what is searched")
