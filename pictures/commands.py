"""The commands `view` and `play`."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from pathlib import Path
from typing import Any

from ..planner import Planner
from ..problems import InputError, load_scene
from ..terminal import (
    DONE,
    Add,
    Progress,
    add_plan_or_cycle,
    add_scene,
    fail,
    integer,
    number,
    print_result,
    report_step,
)
from .space import (
    Panel,
    PlayPage,
    empty_page,
    first_plan,
    motion_to_rest,
    open_browser,
    run_panel,
    save_in_space,
    serving,
)

#: Port of a page.
PORT = 8080


def view_arguments(add: Add) -> None:
    """The options of `view`."""
    add_plan_or_cycle(add)
    _add_page(add)
    add("--png", metavar="FILE", help="write the scene at detach as a picture instead")
    add("--mp4", metavar="FILE", help="write the throw as a film instead")


def play_arguments(add: Add) -> None:
    """The options of `play`."""
    add_scene(add)
    _add_page(add)


def _add_page(add: Add) -> None:
    """The options of a page."""
    words = f"port of the page, on this machine (default: {PORT})"
    add("--port", type=integer(1, 65535), metavar="N", help=words)
    add("--no-browser", action="store_true", help="do not open a browser")
    words = "end after this time (default: when interrupted)"
    add("--hold", type=number(0.001), metavar="SECONDS", help=words)


def view(options: argparse.Namespace) -> int:
    """Show a plan or a cycle in 3-D in the browser.

    example: throwplan view out/cup/plan.json
    """
    files = {kind: getattr(options, kind) for kind in ("png", "mp4")}
    files = {kind: name for kind, name in files.items() if name is not None}
    if files and (options.port or options.no_browser or options.hold):
        raise InputError(
            "--port, --no-browser, --hold: not with --png or --mp4, which open no page"
        )
    with Progress("reading and throwing the plan"):
        space, why = motion_to_rest(options.plan)
    if why:
        report_step(f"the bar stops at the target: {why}")
    for kind, name in files.items():
        with Progress(f"writing {name}"):
            save_in_space(space, kind, Path(name))
    if files:
        print_result(options, files, "\n".join(f"written to {name}" for name in files.values()))
        return DONE
    with serving(space, options.port or PORT) as (address, panel):
        _show(options, {"address": address, "phases": space.phases()}, panel)
    return DONE


def play(options: argparse.Namespace) -> int:
    """Move the target on a page and see the throw follow.

    example: throwplan play cup
    """
    scene = load_scene(options.scene)
    planner = Planner(scene)
    with empty_page(scene.name, options.port or PORT) as (address, server):
        with Progress(f"{scene.name}: planning"):
            plan = first_plan(planner)
        if not plan.solved:
            print_result(options, plan.to_dict(), plan.summary())
            return fail(plan.message)
        page = PlayPage(server, planner, plan)
        try:
            _show(options, {"address": address, "scene": scene.name}, page.panel)
        finally:
            page.end()
    return DONE


def _show(options: argparse.Namespace, facts: dict[str, Any], panel: Panel) -> None:
    """Print the address of the page, open it, and play its panel until a signal comes."""
    with contextlib.suppress(KeyboardInterrupt):
        print(json.dumps(facts) if options.json else facts["address"], flush=True)
        if not options.no_browser and not open_browser(facts["address"]):
            print("throwplan: found no browser; open the address in one", file=sys.stderr)
        if options.hold is None:
            report_step("Ctrl-C ends it")
        run_panel(panel, options.hold)


#: The functions of each command.
COMMANDS = {"view": (view_arguments, view), "play": (play_arguments, play)}
