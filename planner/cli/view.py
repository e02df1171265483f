"""`throwplan view`: a plan in 3-D in the browser."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...problems import InputError
from .command import DONE, command, number, say, whole

if TYPE_CHECKING:
    from ..check import SentThrow

PORT = "8080"


def add_view(commands: Any) -> None:
    """Adds `throwplan view`."""
    example = "throwplan view out/cup/plan.json"
    parser = command(commands, "view", _view, "look at a plan in 3-D in the browser", example)
    parser.add_argument("plan", metavar="PLAN", help="a plan.json or its folder")
    parser.add_argument(
        "--port", metavar="N", default=PORT, help=f"of the page, on this machine (default: {PORT})"
    )
    parser.add_argument("--no-browser", action="store_true", help="open no browser")
    parser.add_argument(
        "--hold", metavar="SECONDS", help="end after that time (default: when interrupted)"
    )
    parser.add_argument(
        "--mp4", metavar="FILE", help="write throw.gif's picture as a film instead (needs ffmpeg)"
    )


def _view(options: argparse.Namespace) -> int:
    port = whole("--port", options.port, 1, 65535)
    hold = None if options.hold is None else number("--hold", options.hold)
    if hold is not None and hold <= 0:
        raise InputError(f"--hold {options.hold}: must be above 0")
    from ..result import read_plan

    say(options, "reading and throwing the plan")
    throw = read_plan(options.plan)
    if not math.isfinite(throw.landing_time):
        raise InputError(f"{options.plan}: thrown again, it does not land")
    if options.mp4 is not None:
        return _film(throw, options)
    return _serve(throw, options, port, hold)


def _film(throw: SentThrow, options: argparse.Namespace) -> int:
    """Writes the MP4."""
    from ..show import save_film

    say(options, f"writing {options.mp4}")
    save_film(throw, Path(options.mp4))
    print(json.dumps({"mp4": options.mp4}) if options.json else f"written to {options.mp4}")
    return DONE


def _serve(throw: SentThrow, options: argparse.Namespace, port: int, hold: float | None) -> int:
    """Serves the view until it is interrupted."""
    from ..show import open_browser, run, serving, space_throw

    space = space_throw(throw)
    try:
        with serving(space, port) as (address, panel):
            answer = {"address": address, "phases": space.phases()}
            print(json.dumps(answer) if options.json else address, flush=True)
            if not options.no_browser and not open_browser(address):
                print("throwplan: no browser to open here; open the address", file=sys.stderr)
            if hold is None:
                say(options, "Ctrl-C ends it")
            run(panel, hold)
    except KeyboardInterrupt:
        pass
    return DONE
