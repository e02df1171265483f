"""`throwplan view`: a plan in 3-D in the browser."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path

from ...problems import InputError
from ..result import read_plan
from ..show import open_browser, run_panel, save_film, serving, space_throw
from .common import DONE, Add, add_plan, answer, number, say, whole


def arguments(add: Add) -> None:
    """The command's options."""
    add_plan(add)
    words = "of the page, on this machine (default: 8080)"
    add("--port", type=whole(1, 65535), metavar="N", default=8080, help=words)
    add("--no-browser", action="store_true", help="open no browser")
    words = "end after that time (default: when interrupted)"
    add("--hold", type=number(0.001), metavar="SECONDS", help=words)
    add("--mp4", metavar="FILE", help="write throw.gif's picture as a film instead (needs ffmpeg)")


def run(options: argparse.Namespace) -> int:
    """Serves the view until it is interrupted, or writes the film."""
    say("reading and throwing the plan")
    throw = read_plan(options.plan)
    if not math.isfinite(throw.landing_time):
        raise InputError(f"{options.plan}: thrown again, it does not land")
    if options.mp4 is not None:
        say(f"writing {options.mp4}")
        save_film(throw, Path(options.mp4))
        answer(options, {"mp4": options.mp4}, f"written to {options.mp4}")
        return DONE
    space = space_throw(throw)
    try:
        with serving(space, options.port) as (address, panel):
            found = {"address": address, "phases": space.phases()}
            print(json.dumps(found) if options.json else address, flush=True)
            if not options.no_browser and not open_browser(address):
                print("throwplan: no browser to open here; open the address", file=sys.stderr)
            if options.hold is None:
                say("Ctrl-C ends it")
            run_panel(panel, options.hold)
    except KeyboardInterrupt:
        pass
    return DONE
