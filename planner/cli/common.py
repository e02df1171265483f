"""What the commands share: their parser, options, progress and answers."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
import time
from collections.abc import Callable
from typing import Any, NoReturn

from ...problems import InputError, Pose, Scene

DONE, WRONG_INPUT, NO_THROW, INTERRUPTED = 0, 2, 3, 130


class Parser(argparse.ArgumentParser):
    """Wrong arguments as one line, like every other wrong input; no abbreviations."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)

    def error(self, message: str) -> NoReturn:
        """Wrong arguments are wrong input."""
        raise InputError(f"{message} (see '{self.prog} --help')")


def add_scene(parser: argparse.ArgumentParser) -> None:
    """The argument SCENE."""
    parser.add_argument("scene", metavar="SCENE", help="a built-in scene's name or a TOML file")


def add_out(parser: argparse.ArgumentParser, what: str) -> None:
    """The option --out; `what` is written there."""
    parser.add_argument("--out", metavar="DIR", help=f"write {what} there")


def add_target(parser: argparse.ArgumentParser) -> None:
    """The options --target and --azimuth, for `target_of`."""
    add = parser.add_argument
    add(
        "--target",
        nargs=3,
        metavar=("X", "Z", "THETA_DEG"),
        help="landing pose instead of the scene's; THETA_DEG may be 'free'",
    )
    add("--azimuth", metavar="DEG", help="turn the throw's plane about the arm's base axis")


def target_of(scene: Scene, options: argparse.Namespace) -> Pose | None:
    """The target that --target and --azimuth ask for, None for the scene's own."""
    words, azimuth = options.target, options.azimuth
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
    turn, x = math.radians(degrees), target.plane_x
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


def answer(options: argparse.Namespace, result: object, text: str) -> None:
    """The command's result on stdout: `result` as JSON if asked for, `text` for people if not."""
    print(json.dumps(result, indent=2, allow_nan=False) if options.json else text)


def written(options: argparse.Namespace) -> str:
    """A last line of the text that says where --out went."""
    return "" if options.out is None else f"\n  written to {options.out}"


def say(words: str) -> None:
    """A step of the work, on a terminal's stderr."""
    if sys.stderr.isatty():
        print(words, file=sys.stderr)


class Progress:
    """A line on a terminal's stderr: how far long work is, and the seconds left."""

    def __init__(self, name: str = "", unit: str = "throws") -> None:
        self._name, self._unit = name, unit
        self._first: tuple[float, int] | None = None

    def __call__(self, done: int, total: int) -> None:
        """Show that `done` of `total` are done."""
        words = f"{self._name}: {done:,} of {total:,} {self._unit}, {100 * done / total:.0f} %"
        now = time.perf_counter()
        # The time before the first call is start-up and says nothing about the rest.
        started, before = self._first = self._first or (now, done)
        if done > before:
            words += f", {(now - started) * (total - done) / (done - before):.0f} s left"
        self._show(words)

    def about(self, name: str) -> Callable[[int, int], None]:
        """Begin other work, called `name`."""
        self._name, self._first = name, None
        self._show(name)
        return self

    def _show(self, words: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{words}", end="", file=sys.stderr, flush=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        self._show("")
