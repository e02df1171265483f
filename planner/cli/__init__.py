"""The command line: `throwplan COMMAND`.

Each command is the file of its name (`import-robot` is import_robot.py), or a class of its name in
a file that it shares, with `EXAMPLE`, `arguments(parser)` and `run(options)`. Only the file of the
command that runs is imported.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from ...problems import InputError, hint_at
from .common import DONE, WRONG_INPUT, Parser

COMMANDS = {
    "scenes": "list the built-in scenes",
    "plan": "plan a throw and check it",
    "simulate": "throw a given hand motion by release models",
    "map": "show which landing poses are in reach",
    "prepare": "solve throws all over the reach, for plans to start from",
    "sweep": "throw a plan many times under uncertainty",
    "report": "measure error against run time, stability, and what scenes leave out",
    "view": "look at a plan in 3-D in the browser",
    "replay": "throw a plan's release in MuJoCo",
    "run": "throw a plan with a Franka robot, and record it",
    "correct": "learn from a recording what to send next",
    "export": "write a plan for a robot controller",
    "import-robot": "turn a robot's URDF into an arm data file",
    "make-throws": "make a synthetic batch of measured throws",
    "identify": "fit friction and patch radius to measured throws",
    "validate": "compare release models on measured throws",
}
#: Commands that share a file, where each is a class of its name.
SHARED = {"correct": "run", "make-throws": "measured", "identify": "measured"}
SHARED |= {"validate": "measured", "run": "run"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        options, unknown = parser_of(words[:1]).parse_known_args(words)
        if unknown:
            raise InputError(_unknown(options.parser, unknown[0]))
        status: int = options.run(options)
        return status
    except InputError as error:
        message = " ".join(str(error).split())
        if "--json" in words:
            print(json.dumps({"error": message}))
        print(f"throwplan: {message}", file=sys.stderr)
        return WRONG_INPUT
    except KeyboardInterrupt:
        print("throwplan: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return DONE


def parser_of(chosen: Iterable[str] = COMMANDS) -> Parser:
    """The parser of all commands; only those `chosen` know their arguments."""
    parser = Parser(
        prog="throwplan", description="Plan throws to a landing pose through the gripper's release."
    )
    try:
        number = version("throwplan")
    except PackageNotFoundError:  # run from a checkout that is not installed
        number = "0"
    parser.add_argument("--version", action="version", version=f"throwplan {number}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    for name, words in COMMANDS.items():
        command = commands.add_parser(
            name, help=words, description=f"{words[0].upper()}{words[1:]}."
        )
        if name in chosen:
            _add_arguments(command, name)
    return parser


def _add_arguments(parser: argparse.ArgumentParser, name: str) -> None:
    """What the command's file adds to its parser."""
    command: Any = import_module(f".{SHARED.get(name, name.replace('-', '_'))}", __name__)
    if name in SHARED:
        command = getattr(command, name.title().replace("-", ""))
    parser.epilog = f"example: {command.EXAMPLE}"
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
    command.arguments(parser)
    parser.set_defaults(run=command.run, parser=parser)


def _unknown(parser: argparse.ArgumentParser, word: str) -> str:
    """A word that a command does not take, and the nearest option that it does."""
    hint = hint_at(word, parser._option_string_actions)
    return f"unknown argument {word}{hint} (see '{parser.prog} --help')"


if __name__ == "__main__":
    sys.exit(main())
