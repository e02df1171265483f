"""The command line: `throwplan COMMAND`.

A command is two functions: one adds its arguments to a parser, one runs it and returns the exit
status. The docstring of the second is the command's help and example.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import json
import logging
import os
import signal
import sys
import threading
import warnings
from collections.abc import Sequence

from .. import __version__, cycles, lab, pictures, robots
from ..core import CoreError
from ..interrupts import INTERRUPTED
from ..problems import InputError
from ..terminal import DONE, WRONG_INPUT, Parser, Progress, fail
from . import scenes

#: The functions of each command, in the order of the help.
COMMANDS = scenes.COMMANDS | cycles.COMMANDS | pictures.COMMANDS | robots.COMMANDS | lab.COMMANDS
#: Longest time [s] of functions that are registered for the exit.
EXIT_TIME = 2.0
#: Longest word [characters] of a printed message; longer words are cut.
LONGEST = 1000


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    if arguments is None:
        _set_up_process()
        leave(main(sys.argv[1:]))
    words = list(arguments or ())
    try:
        try:
            return _run_command(words)
        finally:  # After --help and errors in JSON as well.
            sys.stdout.flush()
    except KeyboardInterrupt:
        return fail("interrupted", INTERRUPTED)
    except BrokenPipeError:
        _discard_output()
        return DONE
    except OSError as error:
        _discard_output()
        return _print_error(InputError(f"standard output: {error.strerror or error}"), words)


def _run_command(words: list[str]) -> int:
    """Runs the command line; returns the exit status, and prints the error if it is not 0."""
    try:
        options, unknown = _parser().parse_known_args(words)
        if unknown:
            parser = options.parser
            hint = InputError.hint(unknown[0], parser._option_string_actions)
            raise InputError(f"unknown argument {unknown[0]}{hint} (see '{parser.prog} --help')")
        options.words = words
        status: int = options.run(options)
        return status
    except Exception as error:
        if isinstance(error, InputError | CoreError):
            return _print_error(error, words)
        # Errors outside the commands' own checks, such as a too long file name.
        if isinstance(error, OSError) and error.filename is not None:
            return _print_error(InputError(f"{error.filename}: {error.strerror or error}"), words)
        raise


def _print_error(error: InputError | CoreError, words: list[str]) -> int:
    """Prints an input error; returns its exit status."""
    lines = [_printable(line) for line in str(error).splitlines()]
    if "--json" in words:
        print(json.dumps({"error": "\n".join(lines)}))
    with contextlib.suppress(OSError):  # Nobody reads them: the status says it.
        for line in lines:
            print(f"throwplan: {line}", file=sys.stderr)
    return WRONG_INPUT


def _discard_output() -> None:
    """Discards the rest of standard output: closing it would fail again."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _set_up_process() -> None:
    """Sets up a process of its own: SIGTERM ends the work as Ctrl-C does, pictures go to files."""
    # Streams that are closed, as under some daemons, read nothing and write nowhere. Opened in this
    # order they take their own numbers, which no other file may have.
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode))
    # As Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    os.environ["MPLBACKEND"] = "agg"
    # MuJoCo, which only simulates here, would start a process to look for a window system.
    os.environ["MUJOCO_GL"] = "disable"
    # Warnings of libraries are hidden: commands print their own messages.
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    logging.getLogger("matplotlib").setLevel(logging.CRITICAL)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A terminal may lack a character: it is replaced.
            stream.reconfigure(errors="replace")


def leave(status: int) -> None:
    """End the process as `sys.exit` does, but without Python's own clean-up.

    A thread that comes back from C++ during that clean-up aborts the process. Functions that are
    registered for the exit have `EXIT_TIME`: those of a broken process pool wait forever.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ending = threading.Thread(target=atexit._run_exitfuncs, daemon=True)
    ending.start()
    ending.join(EXIT_TIME)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def _printable(line: str) -> str:
    """A line of a message with long words shortened."""
    words = " ".join(w if len(w) <= LONGEST else f"{w[:LONGEST]}..." for w in line.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in words)


def _parser() -> Parser:
    """The parser of all commands."""
    parser = Parser(
        prog="throwplan", description="Plan throws to a landing pose through the gripper's release."
    )
    parser.add_argument("--version", action="version", version=f"throwplan {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    for name, (arguments, run) in COMMANDS.items():
        description, example = (run.__doc__ or "\n").split("\n", 1)
        words = description[:1].lower() + description[1:-1]
        command = commands.add_parser(name, help=words, description=description, epilog=example)
        json_words = "print one JSON object, nothing else"
        command.add_argument("--json", action="store_true", help=json_words)
        arguments(command.add_argument)
        command.set_defaults(run=run, parser=command)
    return parser
