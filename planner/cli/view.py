"""`throwplan view` and `throwplan play`: a plan in 3-D in the browser, and a target to move."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from pathlib import Path
from typing import Any

from ...problems import load_scene
from ..planner import Planner
from ..play import PlayPage, first_plan
from ..robot import throw_to_rest
from ..show import (
    Panel,
    empty_page,
    open_browser,
    run_panel,
    save_in_space,
    serving,
)
from .common import (
    DONE,
    NO_THROW,
    Add,
    Progress,
    add_plan,
    add_scene,
    integer,
    number,
    print_result,
    report_step,
)


def arguments(add: Add) -> None:
    """The command's options."""
    add_plan(add)
    _add_page(add)
    add("--png", metavar="FILE", help="write the scene at detach as a picture instead")
    add("--mp4", metavar="FILE", help="write the throw as a film instead (needs ffmpeg)")


def play_arguments(add: Add) -> None:
    """The options of `play`."""
    add_scene(add)
    _add_page(add)


def _add_page(add: Add) -> None:
    """The options of a page."""
    words = "port of the page, on this machine (default: 8080)"
    add("--port", type=integer(1, 65535), metavar="N", default=8080, help=words)
    add("--no-browser", action="store_true", help="do not open a browser")
    words = "end after this time (default: when interrupted)"
    add("--hold", type=number(0.001), metavar="SECONDS", help=words)


def run(options: argparse.Namespace) -> int:
    """Serve the view until interrupted, or write picture and film."""
    with Progress("reading and throwing the plan"):
        space, why = throw_to_rest(options.plan)
    if why:
        report_step(f"the bar stops at the target: {why}")
    written = {}
    for kind in ("png", "mp4"):
        if (name := getattr(options, kind)) is not None:
            with Progress(f"writing {name}"):
                save_in_space(space, kind, Path(name))
            written[kind] = name
    if written:
        print_result(options, written, "\n".join(f"written to {name}" for name in written.values()))
        return DONE
    with contextlib.suppress(KeyboardInterrupt), serving(space, options.port) as (address, panel):
        _show(options, {"address": address, "phases": space.phases()}, panel)
    return DONE


def run_play(options: argparse.Namespace) -> int:
    """Plan, and serve the page until interrupted."""
    scene = load_scene(options.scene)
    planner = Planner(scene)
    with (
        contextlib.suppress(KeyboardInterrupt),
        empty_page(scene.name, options.port) as (address, server),
    ):
        with Progress(f"{scene.name}: planning"):
            plan = first_plan(planner)
        if not plan.solved:
            print_result(options, plan.to_dict(), plan.summary())
            print(f"throwplan: {plan.message}", file=sys.stderr)
            return NO_THROW
        page = PlayPage(server, planner, plan)
        try:
            _show(options, {"address": address, "scene": scene.name}, page.panel)
        finally:
            page.end()
    return DONE


def _show(options: argparse.Namespace, facts: dict[str, Any], panel: Panel) -> None:
    """Print the address of the page, open it, and play its panel."""
    print(json.dumps(facts) if options.json else facts["address"], flush=True)
    if not options.no_browser and not open_browser(facts["address"]):
        print("throwplan: found no browser; open the address in one", file=sys.stderr)
    if options.hold is None:
        report_step("Ctrl-C ends it")
    run_panel(panel, options.hold)
