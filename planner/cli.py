"""The command line: `throwplan scenes | plan | simulate`."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from ..problems.errors import InputError
from ..problems.load import load_scene, scene_names, scene_text
from ..problems.scene import Pose, Scene

DONE, WRONG_INPUT, NO_THROW = 0, 2, 3


class _Parser(argparse.ArgumentParser):
    """Wrong arguments as one line, like every other wrong input; no abbreviations."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see '{self.prog} --help')")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    words = [_plain(word) for word in (sys.argv[1:] if arguments is None else arguments)]
    as_json = "--json" in words
    try:
        options = _parser().parse_args(words)
        status: int = options.run(options)
        return status
    except InputError as error:
        message = " ".join(str(error).split())
        if as_json:
            print(json.dumps({"error": message}))
        print(f"throwplan: {message}", file=sys.stderr)
        return WRONG_INPUT
    except KeyboardInterrupt:
        print("throwplan: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return DONE


def _plain(word: str) -> str:
    """Negative numbers with an exponent written out: argparse takes them for options."""
    if not word.startswith("-") or "e" not in word.lower():
        return word
    try:
        return f"{float(word):f}" if math.isfinite(float(word)) else word
    except ValueError:
        return word


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="throwplan", description="Plan throws to a landing pose through the gripper's release."
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_Parser)
    _add_scenes(commands)
    _add_plan(commands)
    _add_simulate(commands)
    return parser


def _command(commands: Any, name: str, run: Any, words: str, example: str) -> _Parser:
    parser: _Parser = commands.add_parser(
        name,
        help=words,
        description=f"{words[0].upper()}{words[1:]}.",
        epilog=f"example: {example}",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    parser.set_defaults(run=run)
    return parser


# throwplan scenes


def _add_scenes(commands: Any) -> None:
    example = "throwplan scenes --write cup"
    parser = _command(commands, "scenes", _scenes, "list the built-in scenes", example)
    parser.add_argument("--write", metavar="NAME", help="copy that scene's file to NAME.toml here")


def _scenes(options: argparse.Namespace) -> int:
    if options.write is not None:
        from .files import copy_out

        path = Path(f"{options.write}.toml")
        copy_out(scene_text(options.write), path)
        print(json.dumps({"file": str(path)}) if options.json else f"wrote {path}")
        return DONE
    descriptions = {name: load_scene(name).description for name in scene_names()}
    if options.json:
        print(json.dumps({"scenes": descriptions}))
    else:
        for name, description in descriptions.items():
            print(f"{name:12} {description}")
    return DONE


# throwplan plan


def _add_plan(commands: Any) -> None:
    example = "throwplan plan cup --target 0.92 0.22 -90 --out out/cup"
    parser = _command(commands, "plan", _plan, "plan a throw and check it", example)
    _add_scene(parser)
    parser.add_argument(
        "--target",
        nargs=3,
        metavar=("X", "Z", "THETA_DEG"),
        help="landing pose instead of the scene's; THETA_DEG may be 'free'",
    )
    parser.add_argument(
        "--azimuth", metavar="DEG", help="turn the throw's plane about the arm's base axis"
    )
    parser.add_argument(
        "--turns",
        choices=("exact", "any"),
        default="exact",
        help="whether full turns of the object count (default: exact)",
    )
    parser.add_argument(
        "--solver",
        choices=("auto", "fatrop", "ipopt"),
        default="auto",
        help="auto: FATROP, with IPOPT as fallback (default)",
    )
    _add_out(parser, "plan.json, motion.csv, throw.png and throw.gif")


def _plan(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene)
    target = _target(scene, options.target, options.azimuth)
    from .planner import Planner

    _say(options, f"{scene.name}: building the problem")
    planner = Planner(scene)
    planner.check(target)
    if options.out is not None:
        from .files import prepare_folder

        prepare_folder(Path(options.out))
    _say(options, f"{scene.name}: planning")
    plan = planner.plan(target, solver=options.solver, turns=options.turns)
    if options.out is not None:
        _say(options, f"{scene.name}: writing {options.out}")
        plan.save(options.out)
    if options.json:
        print(plan.json())
    else:
        _print_plan(plan.to_dict(), options.out)
    if plan.solved:
        return DONE
    print(f"throwplan: {plan.message}", file=sys.stderr)
    return NO_THROW


def _target(scene: Scene, words: Sequence[str] | None, azimuth: str | None) -> Pose | None:
    """The target that --target and --azimuth ask for, None for the scene's own."""
    if words is None and azimuth is None:
        return None
    target = scene.target
    if words is not None:
        x, z = (_number("--target", word) for word in words[:2])
        free = words[2] == "free"
        theta = None if free else math.radians(_number("--target", words[2], " or 'free'"))
        target = Pose(x=x, z=z, theta=theta)
    if target is None:
        raise InputError(f"{scene.place}: section [target] is missing")
    if azimuth is None:
        return target
    if scene.robot is None:
        raise InputError("--azimuth: only for a scene with [robot]")
    turn = math.radians(_number("--azimuth", azimuth))
    x = target.plane_x
    if x < 0:
        raise InputError(f"--target {x:g}: must be above 0 with --azimuth")
    return dataclasses.replace(target, x=x * math.cos(turn), y=x * math.sin(turn))


def _number(option: str, word: str, more: str = "") -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{option} {word}: must be a finite number{more}")
    return value


def _print_plan(result: dict[str, Any], out: str | None) -> None:
    """A plan in a few lines."""
    print(f"{result['scene']}: {result['status']}, {result['message']}")
    for name, error in result["error"].items():
        if error is not None and error["position"] is not None:
            position, angle = 1e3 * error["position"], math.degrees(error["angle"])
            print(f"  {name:14} error {position:8.3f} mm {angle:8.3f} deg")
    surface, target = result["landing"]["limit_surface"], result["target"]
    if surface is not None and surface["x"] is not None:
        reach = math.hypot(surface["x"], surface.get("y", 0.0))
        position = 1e3 * abs(reach - math.hypot(target["x"], target["y"]))
        free = target["theta"] is None
        angle = 0.0 if free else math.degrees(abs(surface["theta"] - target["theta"]))
        print(f"  {'limit surface':14} error {position:8.3f} mm {angle:8.3f} deg (for comparison)")
    release, solver, times = result["release"], result["solver"], result["time"]
    if release["opening_time"] is not None:
        moments = ", ".join(
            f"{name.removesuffix('_time')} {1e3 * value:.0f} ms"
            for name, value in release.items()
            if value is not None
        )
        print(f"  {moments}")
    print(
        f"  {solver['name']}, {solver['iterations']} iterations in {solver['attempts']} solves, "
        f"{result['nlp']['variables']} variables, {result['nlp']['constraints']} constraints, "
        f"{times['total']:.2f} s"
    )
    if out is not None:
        print(f"  written to {out}")


# throwplan simulate


def _add_simulate(commands: Any) -> None:
    words = "throw a given hand motion by release models"
    parser = _command(commands, "simulate", _simulate, words, "throwplan simulate drop --model sp")
    _add_scene(parser)
    parser.add_argument("--model", default="all", metavar="NAME", help="a model's name, or all")
    _add_out(parser, "simulation.json and five pictures")


def _simulate(options: argparse.Namespace) -> int:
    from .simulate import simulate

    scene = load_scene(options.scene)
    results = {name: run.to_dict() for name, run in simulate(scene, options.model).items()}
    text = json.dumps({"scene": scene.name, "models": results}, indent=2, allow_nan=False)
    if options.out is not None:
        from .files import save_text

        save_text(text + "\n", Path(options.out), "simulation.json")
        from .release_pictures import draw_release_pictures

        _say(options, f"{scene.name}: drawing")
        draw_release_pictures(scene, Path(options.out))
    if options.json:
        print(text)
        return DONE
    _print_simulations(scene.name, results)
    return DONE


def _print_simulations(name: str, results: dict[str, Any]) -> None:
    """A table of detach states and events, landings where there is a height, and statuses."""
    keys = ("x", "z", "theta", "vx", "vz", "omega")
    print(f"{name}: object at detach, SI units")
    print(f"  {'model':10}" + "".join(f"{key:>12}" for key in keys) + "       pivot       slide")
    for model, result in results.items():
        numbers = "".join(_cell(result["detach"][key], 12, 5) for key in keys)
        events = (result["events"][event] for event in ("pivot", "slide"))
        onsets = "".join(_cell(None if e is None else 1e3 * e, 9, 2, " ms") for e in events)
        print(f"  {model:10}{numbers}{onsets}")
    for model, result in results.items():
        if result["landing"] is not None:
            x, theta = (_cell(result["landing"][key], 10, 4) for key in ("x", "theta"))
            print(f"  {model:10} lands at x{x} m, theta{theta} rad")
    for model, result in results.items():
        if result["status"] != "ok":
            print(f"  {model}: not to be trusted: {result['status']}")


def _cell(value: float | None, width: int, digits: int, unit: str = "") -> str:
    """A number for a table, a dash where there is none."""
    if value is None:
        return f"{'-':>{width + len(unit)}}"
    return f"{value:{width}.{digits}f}{unit}"


# Shared.


def _add_scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="a built-in scene's name or a TOML file")


def _add_out(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument("--out", metavar="DIR", help=f"write {what} there")


def _say(options: argparse.Namespace, words: str) -> None:
    """Progress, where somebody watches."""
    if sys.stderr.isatty():
        print(words, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
