"""Commands on plans and cycles: `view`, `play`, `replay`, `export`."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from pathlib import Path
from typing import Any

from .. import robots
from ..planner.planner import Planner
from ..planner.play import PlayPage, first_plan
from ..planner.rest import load_mujoco
from ..planner.result import check_hits, is_cycle
from ..planner.show import Panel, empty_page, open_browser, run_panel, save_in_space, serving
from ..problems import InputError
from ..problems.scene_files import load_scene
from .common import (
    DONE,
    Add,
    Progress,
    add_out,
    add_scene,
    fail,
    integer,
    number,
    prepare_out,
    print_result,
    report_step,
    save_out,
    written,
)

#: Port of a page.
PORT = 8080


def add_plan(add: Add) -> None:
    """The argument PLAN."""
    add("plan", metavar="PLAN", help="a plan.json, or the folder that it is in")


def add_plan_or_cycle(add: Add) -> None:
    """The argument PLAN, which may be a cycle."""
    add("plan", metavar="PLAN", help="a plan.json or cycle.json, or the folder that it is in")


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
        space, why = robots.motion_to_rest(options.plan)
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


def replay_arguments(add: Add) -> None:
    """The options of `replay`."""
    add_plan_or_cycle(add)
    words = "coefficient of restitution of the bar, 0 to 0.99 (default: 0.1)"
    add("--restitution", type=number(), metavar="E", default=0.1, help=words)
    add_out(add, "replay.json, replay.csv and, of a plan, replay.png")


def replay(options: argparse.Namespace) -> int:
    """Simulate the motion of a plan or a cycle in MuJoCo.

    example: throwplan replay out/cup/plan.json
    """
    load_mujoco("replay")
    prepare_out(options)
    with Progress(f"{options.plan}: throwing in MuJoCo"):
        result = robots.replay(options.plan, restitution=options.restitution)
    save_out(options, options.plan, result.save)
    print_result(options, result.to_dict(), result.summary() + written(options))
    return DONE


def add_nearest(add: Add) -> None:
    """The option `--nearest`."""
    words = "also a throw that lands beside its target, as near as one was found"
    add("--nearest", action="store_true", help=words)


def check_nearest(options: argparse.Namespace) -> None:
    """InputError for a plan of a throw that lands beside its target, without `--nearest`."""
    if not options.nearest and not is_cycle(options.plan):
        check_hits(options.plan)


def export_arguments(add: Add) -> None:
    """The options of `export`."""
    add_plan_or_cycle(add)
    add("--franka", metavar="DIR", help="write CSV files at 1 kHz for libfranka to this folder")
    words = "write a rosbag2 (MCAP) with trajectory and gripper command to this folder"
    add("--ros", metavar="DIR", help=words)
    add("--joint-names", nargs="+", metavar="NAME", help="names of all joints in ROS")
    words = "width [m] of the open gripper in its ROS command, at most 0.5 (default: the arm's)"
    add("--open-width", type=number(), metavar="M", help=words)
    add_nearest(add)


def export(options: argparse.Namespace) -> int:
    """Write a plan or a cycle for a robot controller.

    example: throwplan export out/cup/plan.json --franka out/franka
    """
    check_nearest(options)
    folders = {"franka": options.franka, "ros": options.ros}
    with Progress("writing the motion for controllers"):
        motion = robots.export(
            options.plan, **folders, names=options.joint_names, open_width=options.open_width
        )
    commands = [
        {"time": one.time, "command": "grasp" if one.force else "open", "cycle": one.cycle}
        | {"fraction": one.fraction}
        for one in robots.commands_of(motion)
    ]
    result = folders | {"duration": motion.duration, "commands": commands}
    words = ", ".join(f"{one['command']} {one['time']:.3f} s" for one in commands)
    count = len(motion.times)
    lines = [f"{motion.name}: {count} samples, {motion.duration:.3f} s; gripper: {words}"]
    lines += [f"  written to {name}" for name in folders.values() if name]
    print_result(options, result, "\n".join(lines))
    return DONE
