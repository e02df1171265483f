"""Commands on measured throws, `identify` and `calibrate`; and `replay` in MuJoCo."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from ..models import STEPPED_SURFACE
from ..planner import load_mujoco
from ..problems import Calibration, InputError, load_scene
from ..terminal import (
    DONE,
    Add,
    Progress,
    add_out,
    add_plan_or_cycle,
    integer,
    number,
    prepare_out,
    print_result,
    save_out,
    written,
)
from .calibration import FILES as CALIBRATE_FILES
from .calibration import calibrate
from .comparison import FITTED, compare
from .identification import FILES as IDENTIFY_FILES
from .identification import identify, one_surface, save_identified, summary_of
from .mujoco import replay as replay_motion
from .predict import check_model
from .throws import ThrowData, load_throws

DATA = "a folder with dataset.toml and throws.csv"


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
    add_out(add, "identify.json, contact.toml, a picture; for all: comparison.csv")


def _add_selection(add: Add) -> None:
    """The options that select throws, for `_selected`."""
    add("--throws", type=integer(1, 1_000_000), metavar="N", help="only the first N throws")
    look = {"nargs": "+", "action": "extend", "default": [], "metavar": "FACTOR=LABEL"}
    add("--only", help="only throws with this label", **look)


def identify_models(options: argparse.Namespace) -> int:
    """Fit friction and patch radius to measured throws; with --model all, compare release models.

    example: throwplan identify examples/throws --model all --out out/fit
    """
    if options.model not in ("", "all"):
        check_model(options.model)
    with Progress(f"{options.data}: reading"):
        data = _selected(load_throws(options.data), options)
    prior = None if options.prior is None else load_scene(options.prior)
    prepare_out(options, IDENTIFY_FILES)
    with Progress(data.name) as progress:
        settings = {"prior": prior, "delay": options.delay, "grip_scale": options.grip_scale}
        if options.model == "all":
            found, table = compare(data, progress.about, **settings)
        else:
            found = [identify(data, options.model, about=progress.about, **settings)]
            table = None
    save_out(options, data.name, partial(save_identified, found, table, scene=prior))
    text, answers = summary_of(found), [one.to_dict() for one in found]
    if table is not None:
        text += "\n\n" + "\n".join([f"{table.caption}:", "", *table.markdown()])
        for answer, cell in zip(answers, table.column("left out [mm]"), strict=True):
            answer["left_out"] = None
            if isinstance(cell, tuple):
                mean, low, high = (1e-3 * number for number in cell)
                answer["left_out"] = {"mean": mean, "interval": [low, high]}
    if options.out is not None:
        text += f"{written(options)}; contact.toml is for a scene, in place of its [contact] and "
        text += "[uncertainty]"
    print_result(options, answers, text)
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
        found = calibrate(data, scene, options.level, fit=options.fit, about=progress.about)
    save_out(options, scene.name, found.save)
    text = f"{found.summary()}\n\n{found.text()}" if options.out is None else found.summary()
    if options.out is not None:
        text += f"{written(options)}; calibration.toml is a section for the scene"
    print_result(options, found.to_dict(), text)
    return DONE


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


def replay_arguments(add: Add) -> None:
    """The options of `replay`."""
    add_plan_or_cycle(add)
    words = "coefficient of restitution of the bar, 0 to 0.99 (default: 0.1)"
    add("--restitution", type=number(), metavar="E", default=0.1, help=words)
    add_out(add, "replay.json, replay.csv and, of a plan, replay.png")


def replay(options: argparse.Namespace) -> int:
    """Simulate the motion of a plan or a cycle in MuJoCo.

    example: throwplan replay out/cup/plan.json
    """
    load_mujoco("replay")
    prepare_out(options)
    with Progress(f"{options.plan}: throwing in MuJoCo"):
        result = replay_motion(options.plan, restitution=options.restitution)
    save_out(options, options.plan, result.save)
    print_result(options, result.to_dict(), result.summary() + written(options))
    return DONE


#: The functions of each command.
COMMANDS = {
    "replay": (replay_arguments, replay),
    "identify": (identify_arguments, identify_models),
    "calibrate": (calibrate_arguments, calibrate_scene),
}
