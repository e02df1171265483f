"""The command line: `throwplan COMMAND`.

Each command has a file of its name (`import-robot`: import_robot.py) with `arguments(add)` and
`run(options)`. Only the file of the running command is imported.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import logging
import os
import sys
import warnings
from collections.abc import Iterable, Sequence
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

from ...core import CoreError
from ...problems import InputError
from .common import DONE, WRONG_INPUT, Interrupts, Parser, Progress

#: The help line of each command, and the arguments of an example.
COMMANDS = {
    "scenes": ("list the built-in scenes", "--write cup"),
    "plan": ("plan a throw and check it", "cup --target 0.92 0.22 -90 --out out/cup"),
    "simulate": (
        "simulate the release of a given hand motion by release models",
        "drop --model sp",
    ),
    "map": ("show the reachable landing poses", "pose --out out/map"),
    "prepare": ("build a library of solved throws, from which plans start", "pose --throws 5000"),
    "sweep": (
        "simulate a plan many times under uncertainty",
        "delay --samples 10000 --out out/sweep",
    ),
    "view": ("show a plan in 3-D in the browser", "out/cup/plan.json"),
    "play": ("move the target on a page and see the throw follow", "cup"),
    "replay": ("simulate a plan's release in MuJoCo", "out/cup/plan.json"),
    "run": (
        "execute a plan on a Franka robot and record it",
        "out/fr3/plan.json --robot 172.16.0.2",
    ),
    "correct": (
        "correct a plan's motion by a recording of it",
        "out/fr3/plan.json out/run/run.csv --out out/next",
    ),
    "export": ("write a plan for a robot controller", "out/cup/plan.json --franka out/franka"),
    "import-robot": (
        "turn a robot's URDF into an arm data file",
        "my.urdf --joints j1 j2 j3 j4 j5 j6 --tool gripper --tcp 0.12 "
        "--acceleration 10 --jerk 1000 --out my-arm.toml",
    ),
    "make-throws": ("make a synthetic data set of measured throws", "--out out/throws"),
    "identify": (
        "fit friction and patch radius to measured throws",
        "out/throws --model ls-step --out out/fit",
    ),
    "validate": ("compare release models on measured throws", "out/throws --out out/validation"),
}
#: Commands by the file that they share; their functions there have the command's name.
SHARED = {"correct": "run", "play": "view"} | dict.fromkeys(
    ("make-throws", "identify", "validate"), "measured"
)
#: Longest word [characters] of a printed message; longer words are cut.
LONGEST = 160


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    interrupts = Interrupts()
    if arguments is None:
        _set_up_process(interrupts)
    try:
        try:
            return _run_command(words, interrupts)
        finally:  # After --help and errors in JSON as well.
            sys.stdout.flush()
    except BrokenPipeError:
        _discard_output()
        return DONE
    except OSError as error:
        _discard_output()
        return _print_error(InputError(f"standard output: {error.strerror or error}"), words)


def _run_command(words: list[str], interrupts: Interrupts) -> int:
    """Runs the command line; returns the exit status, and prints the error if it is not 0."""
    try:
        return _run_parsed(words)
    except (Exception, KeyboardInterrupt) as error:
        if interrupts.ended_by(error):
            return interrupts.status("throwplan")
        if isinstance(error, InputError | CoreError):
            return _print_error(error, words)
        # Errors outside the commands' own checks, such as a too long file name.
        if isinstance(error, OSError) and error.filename is not None:
            return _print_error(InputError(f"{error.filename}: {error.strerror or error}"), words)
        raise


def _run_parsed(words: list[str]) -> int:
    """Parses and runs the command line; raises its errors."""
    with Progress("starting"):
        parser = parser_of(words[:1])
    options, unknown = parser.parse_known_args(words)
    if unknown:
        raise InputError(_unknown(options.parser, unknown[0]))
    options.words = words
    status: int = options.run(options)
    return status


def _print_error(error: InputError | CoreError, words: list[str]) -> int:
    """Prints an input error; returns its exit status."""
    lines = [_printable(line) for line in str(error).splitlines()]
    if "--json" in words:
        print(json.dumps({"error": "\n".join(lines)}))
    for line in lines:
        print(f"throwplan: {line}", file=sys.stderr)
    return WRONG_INPUT


def _discard_output() -> None:
    """Discards the rest of standard output: closing it would fail again."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _set_up_process(interrupts: Interrupts) -> None:
    """Sets up a process of its own: signals act as Ctrl-C, pictures go to files."""
    interrupts.listen()
    os.environ["MPLBACKEND"] = "agg"
    # Warnings of libraries are hidden: commands print their own messages.
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    logging.getLogger("matplotlib").setLevel(logging.CRITICAL)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A terminal may lack a character: it is replaced.
            stream.reconfigure(errors="replace")


def _printable(line: str) -> str:
    """A line of a message with long words shortened."""
    parts = (w if len(w) <= LONGEST else f"{w[:LONGEST]}..." for w in line.split())
    words = " ".join(parts)
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in words)


def parser_of(names: Iterable[str] = COMMANDS) -> Parser:
    """The parser of all commands; only those in `names` get their arguments."""
    parser = Parser(
        prog="throwplan", description="Plan throws to a landing pose through the gripper's release."
    )
    try:
        number = version("throwplan")
    except PackageNotFoundError:  # run from a checkout that is not installed
        number = "0"
    parser.add_argument("--version", action="version", version=f"throwplan {number}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    for name, (words, example) in COMMANDS.items():
        command = commands.add_parser(
            name,
            help=words,
            description=f"{words[0].upper()}{words[1:]}.",
            epilog=f"example: throwplan {name} {example}",
        )
        if name in names:
            _add_arguments(command, name)
    return parser


def _add_arguments(parser: argparse.ArgumentParser, name: str) -> None:
    """Add the command's own arguments to its parser."""
    word = name.replace("-", "_")
    file = import_module(f".{SHARED.get(name, word)}", __name__)
    before, after = (f"{word}_", f"_{word}") if name in SHARED else ("", "")
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    getattr(file, f"{before}arguments")(parser.add_argument)
    parser.set_defaults(run=getattr(file, f"run{after}"), parser=parser)


def _unknown(parser: argparse.ArgumentParser, word: str) -> str:
    """The message for an unknown word, with the most similar option."""
    hint = InputError.hint(word, parser._option_string_actions)
    return f"unknown argument {word}{hint} (see '{parser.prog} --help')"


if __name__ == "__main__":
    sys.exit(main())
