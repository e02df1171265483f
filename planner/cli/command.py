"""What the commands share: their parser, options, and words on the way."""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from ...problems import InputError, Pose, Scene

DONE, WRONG_INPUT, NO_THROW = 0, 2, 3


class Parser(argparse.ArgumentParser):
    """Wrong arguments as one line, like every other wrong input; no abbreviations."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)

    def error(self, message: str) -> NoReturn:
        """Wrong arguments are wrong input."""
        raise InputError(f"{message} (see '{self.prog} --help')")


def command(commands: Any, name: str, run: Any, words: str, example: str) -> Parser:
    """The parser of a command: `words` say what it does, `run(options)` does it."""
    parser: Parser = commands.add_parser(
        name,
        help=words,
        description=f"{words[0].upper()}{words[1:]}.",
        epilog=f"example: {example}",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    parser.set_defaults(run=run, parser=parser)
    return parser


def add_scene(parser: argparse.ArgumentParser) -> None:
    """The argument SCENE."""
    parser.add_argument("scene", metavar="SCENE", help="a built-in scene's name or a TOML file")


def add_target(parser: argparse.ArgumentParser) -> None:
    """The options --target and --azimuth, for `target_of`."""
    parser.add_argument(
        "--target",
        nargs=3,
        metavar=("X", "Z", "THETA_DEG"),
        help="landing pose instead of the scene's; THETA_DEG may be 'free'",
    )
    parser.add_argument(
        "--azimuth", metavar="DEG", help="turn the throw's plane about the arm's base axis"
    )


def add_out(parser: argparse.ArgumentParser, what: str) -> None:
    """The option --out; `what` is written there."""
    parser.add_argument("--out", metavar="DIR", help=f"write {what} there")


def say(options: argparse.Namespace, words: str) -> None:
    """Progress, where somebody watches."""
    if sys.stderr.isatty():
        print(words, file=sys.stderr)


def target_of(scene: Scene, words: Sequence[str] | None, azimuth: str | None) -> Pose | None:
    """The target that --target and --azimuth ask for, None for the scene's own."""
    if words is None and azimuth is None:
        return None
    target = scene.target
    if words is not None:
        x, z = (number("--target", word) for word in words[:2])
        free = words[2] == "free"
        theta = None if free else math.radians(number("--target", words[2], " or 'free'"))
        target = Pose(x=x, z=z, theta=theta)
    if target is None:
        raise InputError(f"{scene.place}: section [target] is missing")
    if azimuth is None:
        return target
    if scene.robot is None:
        raise InputError("--azimuth: only for a scene with [robot]")
    degrees = number("--azimuth", azimuth)
    if abs(degrees) > 180:
        raise InputError(f"--azimuth {azimuth}: must be from -180 to 180")
    turn = math.radians(degrees)
    x = target.plane_x
    if x < 0:
        raise InputError(f"--target {x:g}: must be above 0 with --azimuth")
    return dataclasses.replace(target, x=x * math.cos(turn), y=x * math.sin(turn))


def whole(option: str, word: str, low: int, high: int) -> int:
    """`word` as a whole number from `low` to `high`; InputError naming `option`."""
    try:
        value = int(word)
    except ValueError:
        value = low - 1
    if not low <= value <= high:
        raise InputError(f"{option} {word}: must be a whole number, {low} to {high}")
    return value


def number(option: str, word: str, more: str = "") -> float:
    """`word` as a finite number; InputError naming `option`."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{option} {word}: must be a finite number{more}")
    return value
