"""The command line: `throwplan COMMAND`."""

from __future__ import annotations

import difflib
import json
import math
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

from ...problems import InputError
from .command import DONE, WRONG_INPUT, Parser
from .export import add_export
from .identify import add_identify
from .import_robot import add_import
from .make_throws import add_make_throws
from .map import add_map
from .plan import add_plan
from .replay import add_replay
from .report import add_report
from .scenes import add_scenes
from .simulate import add_simulate
from .sweep import add_sweep
from .validate import add_validate
from .view import add_view


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    words = [_plain(word) for word in (sys.argv[1:] if arguments is None else arguments)]
    as_json = "--json" in words
    try:
        options, rest = _parser().parse_known_args(words)
        if rest:
            raise InputError(_not_known(options.parser, rest[0]))
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


def _not_known(parser: Parser, word: str) -> str:
    """A word that a command does not take, and the nearest option that it does."""
    near = difflib.get_close_matches(word, parser._option_string_actions, 1, 0.6)
    hint = f", did you mean {near[0]}?" if near else ""
    return f"unknown argument {word}{hint} (see '{parser.prog} --help')"


def _plain(word: str) -> str:
    """Negative numbers with an exponent written out: argparse takes them for options."""
    if not word.startswith("-") or "e" not in word.lower():
        return word
    try:
        return f"{float(word):f}" if math.isfinite(float(word)) else word
    except ValueError:
        return word


def _parser() -> Parser:
    parser = Parser(
        prog="throwplan", description="Plan throws to a landing pose through the gripper's release."
    )
    parser.add_argument("--version", action="version", version=f"throwplan {_version()}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    for add in (
        *(add_scenes, add_plan, add_simulate, add_map, add_sweep, add_report),
        *(add_view, add_replay, add_export, add_import),
        *(add_make_throws, add_identify, add_validate),
    ):
        add(commands)
    return parser


def _version() -> str:
    try:
        return version("throwplan")
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "0"


if __name__ == "__main__":
    sys.exit(main())
