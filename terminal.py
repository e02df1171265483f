"""Parser, options, progress and printed results of all commands."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import math
import re
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from .interrupts import interrupts_deferred
from .planner import check_hits, is_cycle
from .problems import InputError, Pose, Region, Scene, prepare_folder

#: Type of a parser's `add_argument`.
Add = Callable[..., argparse.Action]
#: Interval [s] between updates of the seconds in a progress line.
COUNT = 1.0
#: Exit status of a command that did its work.
DONE = 0
#: Exit status after wrong input.
WRONG_INPUT = 2
#: Exit status of a command that found no throw.
NO_THROW = 3


class Parser(argparse.ArgumentParser):
    """A parser without abbreviations whose errors are one line, as for any wrong input."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)
        # Negative numbers with an exponent, and ranges from one, are values, not options.
        size = r"(\d+\.?\d*|\.\d+)(e[-+]?\d+)?"
        self._negative_number_matcher = re.compile(rf"-{size}(:-?{size})?$", re.I)

    def error(self, message: str) -> NoReturn:
        """Raise InputError for wrong arguments."""
        words = re.sub(r"^argument (-\S+): (.*: must )", r"\1 \2", message)
        raise InputError(f"{words} (see '{self.prog} --help')")


def add_scene(add: Add) -> None:
    """The argument SCENE."""
    add("scene", metavar="SCENE", help="a built-in scene's name or a TOML file")


def add_plan(add: Add) -> None:
    """The argument PLAN."""
    add("plan", metavar="PLAN", help="a plan.json, or the folder that it is in")


def add_plan_or_cycle(add: Add) -> None:
    """The argument PLAN, which may be a cycle."""
    add("plan", metavar="PLAN", help="a plan.json or cycle.json, or the folder that it is in")


def add_nearest(add: Add) -> None:
    """The option `--nearest`."""
    words = "also a throw that lands beside its target, as near as one was found"
    add("--nearest", action="store_true", help=words)


def check_nearest(options: argparse.Namespace) -> None:
    """InputError for a plan of a throw that lands beside its target, without `--nearest`."""
    if not options.nearest and not is_cycle(options.plan):
        check_hits(options.plan)


def add_out(add: Add, what: str) -> None:
    """The option --out; `what` is written there."""
    add("--out", metavar="DIR", help=f"write {what} to this folder")


def toml_out(options: argparse.Namespace) -> Path:
    """The TOML file of --out; InputError for another file, or without its folder."""
    out = Path(options.out)
    if out.suffix != ".toml":
        raise InputError(f"--out {out}: must end in .toml")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: its folder does not exist")
    return out


def new_toml_out(options: argparse.Namespace) -> Path:
    """`toml_out`; InputError for a file that exists, unless --force is given."""
    out = toml_out(options)
    if out.exists() and not options.force:
        raise InputError(f"{out}: exists already, not overwritten; --force does it")
    return out


def add_workers(add: Add, words: str) -> None:
    """The options --workers, with this help, and --scheduler."""
    add("--workers", type=integer(), metavar="N", help=words)
    add("--scheduler", metavar="ADDRESS", help="address of a Dask scheduler to use instead")


def add_patience(add: Add, words: str) -> None:
    """The option --patience; words: its default."""
    words = f"time [s] of the search for a throw (default: {words})"
    add("--patience", type=number(0.001, 3600.0), metavar="S", help=words)


def add_target(add: Add) -> None:
    """The options --target, --azimuth, --velocity and --arrival, for `target_of`."""
    words = "landing pose instead of the scene's; X and THETA_DEG may be ranges, as 1.28:1.42, and "
    words += "THETA_DEG 'free'"
    form = ("X", "Z", "THETA_DEG")
    add("--target", nargs=3, type=number_or_range, metavar=form, help=words)
    words = "turn the throw's plane about the arm's base axis"
    add("--azimuth", type=number(-180, 180), metavar="DEG", help=words)
    words = "velocity [m/s] of the target along x; it has its pose when the motion starts"
    add("--velocity", type=number(), metavar="VX", help=words)
    words = "landing time [s] from the start of the motion, or the earliest and the latest"
    add("--arrival", nargs="+", type=number(), metavar="T", help=words)


def target_of(scene: Scene, options: argparse.Namespace) -> Pose | None:
    """The target of the options of `add_target`, None for the scene's own."""
    given, azimuth, target = options.target, options.azimuth, scene.target
    velocity, arrival = options.velocity, options.arrival
    if given is azimuth is velocity is arrival is None:
        return None
    if given is not None:
        target = _target_from(given, target)
    if target is None:
        raise InputError(f"{scene.place}: section [target] is missing")
    moves: dict[str, Any] = {} if velocity is None else {"velocity": (velocity,)}
    if arrival is not None:
        if len(arrival) > 2:
            raise InputError("--arrival: must be one time, or the earliest and the latest")
        moves["arrival"] = tuple(arrival) if arrival[1:] else arrival[0]
    try:
        target = dataclasses.replace(target, **moves)
    except InputError as error:
        raise error.within("--", "") from None
    if azimuth is None:
        return target
    if scene.robot is None:
        raise InputError("--azimuth: only for a scene with [robot]")
    turn, x = math.radians(azimuth), target.away
    if x < 0:
        raise InputError(f"--target {x:g}: must be above 0 with --azimuth")
    return dataclasses.replace(target, x=x * math.cos(turn), y=x * math.sin(turn))


# Types of options, for argparse, which puts the option's name before the message.


def integer(low: float = -math.inf, high: float = math.inf) -> Callable[[str], int]:
    """A whole number from `low` to `high`, if they are given."""
    allowed = "" if math.isinf(low) else f", {low} to {high}"

    def value(word: str) -> int:
        with contextlib.suppress(ValueError):
            if low <= int(word) <= high:
                return int(word)
        raise argparse.ArgumentTypeError(f"{word}: must be a whole number{allowed}")

    return value


def _target_from(given: list[Any], own: Pose | None) -> Pose:
    """The target of --target, with velocity and arrival of the scene's own."""
    x, z, theta = given
    if x is None or not isinstance(z, float):
        raise InputError(
            "--target: X must be a number or a range, Z a number; only THETA_DEG may be 'free'"
        )
    if theta is not None:
        theta = tuple(map(math.radians, theta)) if isinstance(theta, tuple) else math.radians(theta)
    kind = Region if tuple in {type(x), type(theta)} else Pose
    try:
        target = kind(x=x, z=z, theta=theta)
    except InputError as error:
        raise error.within("--target") from None
    return target if own is None else target.changed(velocity=own.velocity, arrival=own.arrival)


def number_or_range(word: str) -> float | tuple[float, ...] | None:
    """A finite number, two of them as LOWEST:HIGHEST, or the word 'free', which is None."""
    if word.count(":") != 1:
        return number(other="free")(word)
    low, high = (number()(part) for part in word.split(":"))
    return low or 0.0, high or 0.0


def number(
    low: float = -math.inf, high: float = math.inf, other: str = ""
) -> Callable[[str], float | None]:
    """A finite number from `low` to `high`, or the word `other`, which is None."""

    def value(word: str) -> float | None:
        if other and word == other:
            return None
        try:
            result = float(word)
        except ValueError:
            result = math.nan
        if math.isfinite(result) and low <= result <= high:
            return result
        if math.isfinite(result):
            allowed = f"at least {low:g}" if high == math.inf else f"from {low:g} to {high:g}"
        else:
            allowed = "a finite number" + (f" or '{other}'" if other else "")
        raise argparse.ArgumentTypeError(f"{word}: must be {allowed}")

    return value


def print_result(options: argparse.Namespace, result: object, text: str) -> None:
    """Print the command's result: `result` as JSON with --json, else `text`."""
    print(json.dumps(result, indent=2, allow_nan=False) if options.json else text)


def fail(message: str, status: int = NO_THROW) -> int:
    """Print on stderr why the command failed; returns its exit status."""
    print(f"throwplan: {message}", file=sys.stderr)
    return status


def prepare_out(options: argparse.Namespace, files: tuple[str, ...] = ()) -> None:
    """Check, before the work, that these files can be written to the folder of --out."""
    if options.out is not None:
        prepare_folder(Path(options.out), files)


def save_out(options: argparse.Namespace, name: str, *saves: Callable[[Path], object]) -> None:
    """Call each of `saves` with the folder of --out; nothing without the option.

    Ctrl-C waits for all of them: the files are whole or none is there.
    """
    if options.out is None:
        return
    with Progress(f"{name}: writing {options.out}"), interrupts_deferred():
        for save in saves:
            save(Path(options.out))


def written(options: argparse.Namespace) -> str:
    """A last line of text with the folder of --out."""
    return "" if options.out is None else f"\n  written to {options.out}"


def notes(scene: Scene) -> str:
    """Lines about defaults of keys that the scene leaves out."""
    return "".join(f"\n  note: {words}" for words in scene.notes)


def report_step(words: str) -> None:
    """Print a step of the work on stderr, if that is a terminal."""
    if sys.stderr.isatty():
        print(words, file=sys.stderr)


class Progress:
    """A line on a terminal's stderr: share of the work done, and the seconds left.

    An unchanged line counts seconds.
    """

    def __init__(self, name: str = "", unit: str = "throws") -> None:
        self._name, self._unit, self._words = name, unit, name
        self._first: tuple[float, int] | None = None
        self._over, self._shown = threading.Event(), time.monotonic()
        self._counting = threading.Thread(target=self._count, daemon=True)

    def __call__(self, done: int, total: int) -> None:
        """Show `done` of `total`."""
        words = f"{self._name}: {done:,} of {total:,} {self._unit}, {100 * done / total:.0f} %"
        now = time.perf_counter()
        # The time before the first call is start-up: it does not count.
        started, before = self._first = self._first or (now, done)
        if done > before:
            words += f", {(now - started) * (total - done) / (done - before):.0f} s left"
        self._show(words)

    def about(self, name: str) -> Callable[[int, int], None]:
        """Begin other work called `name`; returns the progress of it."""
        self._name, self._first = name, None
        self._show(name)
        return self

    def _show(self, words: str) -> None:
        self._words, self._shown = words, time.monotonic()
        _rewrite(words)

    def _count(self) -> None:
        while not self._over.wait(COUNT):
            seconds = time.monotonic() - self._shown
            if seconds > COUNT:
                _rewrite(f"{self._words} ({seconds:.0f} s)")

    def __enter__(self) -> Progress:
        if sys.stderr.isatty():
            self._show(self._name)
            self._counting.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._over.set()
        if self._counting.is_alive():
            self._counting.join()
        self._show("")


def _rewrite(words: str) -> None:
    if sys.stderr.isatty():
        print(f"\r\033[K{words}", end="", file=sys.stderr, flush=True)
