"""Commands on plans: `view`, `play`, `replay`, `run`, `correct`, `export`."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import sys
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from ...problems import InputError, load_scene
from ...problems.files import filling, prepare_folder
from .. import robot
from ..planner import Planner
from ..play import PlayPage, first_plan
from ..rest import load_mujoco
from ..result import read_plan
from ..show import Panel, empty_page, open_browser, run_panel, save_in_space, serving
from ..throw import TICK
from ..verdict import outside_tolerance
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


def _add_plan(add: Add) -> None:
    add("plan", metavar="PLAN", help="a plan.json, or the folder that it is in")


def view_arguments(add: Add) -> None:
    """The options of `view`."""
    _add_plan(add)
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


def view(options: argparse.Namespace) -> int:
    """Show a plan in 3-D in the browser.

    example: throwplan view out/cup/plan.json
    """
    with Progress("reading and throwing the plan"):
        space, why = robot.throw_to_rest(options.plan)
    if why:
        report_step(f"the bar stops at the target: {why}")
    files = {kind: getattr(options, kind) for kind in ("png", "mp4")}
    files = {kind: name for kind, name in files.items() if name is not None}
    for kind, name in files.items():
        with Progress(f"writing {name}"):
            save_in_space(space, kind, Path(name))
    if files:
        print_result(options, files, "\n".join(f"written to {name}" for name in files.values()))
        return DONE
    with serving(space, options.port) as (address, panel):
        _show(options, {"address": address, "phases": space.phases()}, panel)
    return DONE


def play(options: argparse.Namespace) -> int:
    """Move the target on a page and see the throw follow.

    example: throwplan play cup
    """
    scene = load_scene(options.scene)
    planner = Planner(scene)
    with empty_page(scene.name, options.port) as (address, server):
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
    _add_plan(add)
    words = "coefficient of restitution of the bar, 0 to 0.99 (default: 0.1)"
    add("--restitution", type=number(), metavar="E", default=0.1, help=words)
    add_out(add, "replay.json, replay.csv and replay.png")


def replay(options: argparse.Namespace) -> int:
    """Simulate a plan's release in MuJoCo.

    example: throwplan replay out/cup/plan.json
    """
    load_mujoco("replay")
    prepare_out(options)
    with Progress("reading the plan") as progress:
        throw = read_plan(options.plan)
        progress.about(f"{throw.scene.name}: throwing in MuJoCo")
        result = robot.replay(throw, restitution=options.restitution)
    save_out(options, throw.scene.name, result.save)
    print_result(options, result.to_dict(), result.summary() + written(options))
    return DONE


def run_arguments(add: Add) -> None:
    """The options of `run`."""
    _add_plan(add)
    add("--robot", metavar="HOST", help="address of a Franka Research 3")
    add("--yes", action="store_true", help="move without confirmation")
    add("--dry", action="store_true", help="print the motion instead of sending it")
    words = "number of throws; each recording corrects the next throw (default: 1)"
    add("--repeat", type=integer(1, 100), metavar="N", default=1, help=words)
    words = "send the motion corrected by this recording of the plan"
    add("--after", metavar="RUN.CSV", help=words)
    words = "write run.csv there, or run1.csv, run2.csv, ... (default: out/run)"
    add("--out", metavar="DIR", default="out/run", help=words)


def run(options: argparse.Namespace) -> int:
    """Execute a plan on a Franka robot and record it.

    example: throwplan run out/fr3/plan.json --robot 172.16.0.2
    """
    plan = robot.joint_motion(options.plan)
    robot.check_arm(options.plan, plan.arm)
    sent = plan
    if options.after is not None:
        sent, _ = robot.corrected(plan, robot.read_recording(options.after, plan))
    if options.dry:
        return _print_motion(options, sent)
    if options.robot is None:
        raise InputError("--robot: is missing: give the robot's address, or --dry to move nothing")
    if not options.yes and not sys.stdin.isatty():
        raise InputError("--yes: is missing: there is no terminal to confirm the motion")
    folder, runs, lines = prepare_folder(Path(options.out), ("run.csv",)), [], []
    report_step(f"connecting to {options.robot}")
    with robot.connected(options.robot) as franka:
        recordings = robot.throws(franka, plan, sent, partial(_confirm, options.yes))
        for k, recording in enumerate(islice(recordings, options.repeat), start=1):
            name = "run.csv" if options.repeat == 1 else f"run{k}.csv"
            with filling(folder, (name,)) as scratch:
                recording.save(scratch / name)
            runs.append({"file": str(folder / name)} | recording.to_dict(plan.throw))
            lines.append(f"{folder / name}: {recording.summary(plan.throw)}")
            report_step(lines[-1])
    print_result(options, {"scene": plan.throw.scene.name, "runs": runs}, "\n".join(lines))
    return DONE


def _print_motion(options: argparse.Namespace, sent: robot.JointMotion) -> int:
    """Print the motion; with a robot, check that it is ready."""
    facts = robot.motion_facts(sent)
    lines = [
        f"{sent.throw.scene.name}: {facts['samples']} samples in {facts['duration']:.3f} s to "
        f"{sent.arm.name}, from q = [{', '.join(f'{angle:.4f}' for angle in facts['start'])}] rad",
        f"  the gripper's opening command {1e3 * facts['gripper']['command_time']:.1f} ms after "
        "the first",
    ]
    if options.robot is not None:
        with robot.connected(options.robot) as franka:
            start, _ = franka.check(sent.arm)
        seconds = (len(robot.approach(sent, start)) - 1) * TICK
        facts["approach"] = {"from": start.tolist(), "duration": seconds}
        lines.append(f"  {options.robot} is ready, {seconds:.1f} s from the start pose")
    print_result(options, facts, "\n".join(lines))
    return DONE


def _confirm(yes: bool, words: str) -> None:
    """Ask for confirmation before the robot moves; with `yes` only print the words."""
    print(words, file=sys.stderr)
    if yes:
        return
    question = "The robot moves. Is its way clear, and the object between the pads? [y/N] "
    print(question, end="", file=sys.stderr, flush=True)
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise InputError("not confirmed: nothing was moved")


def correct_arguments(add: Add) -> None:
    """The options of `correct`."""
    _add_plan(add)
    add("recording", metavar="RUN.CSV", help="a recording of the plan by `throwplan run`")
    add_out(add, "the corrected motion in the files of `export --franka`")


def correct(options: argparse.Namespace) -> int:
    """Correct a plan's motion by a recording of it.

    example: throwplan correct out/fr3/plan.json out/run/run.csv --out out/next
    """
    plan = robot.joint_motion(options.plan)
    recording = robot.read_recording(options.recording, plan)
    sent, expected = robot.corrected(plan, recording)
    if options.out is not None:
        with filling(Path(options.out), robot.FRANKA_FILES) as scratch:
            robot.write_franka(sent, scratch)
    dx, dtheta = map(abs, expected.miss())
    outside = outside_tolerance(expected.scene.tolerance, dx, dtheta)
    result = {
        "recorded": recording.to_dict(plan.throw),
        "expected": {"position": dx, "angle": dtheta},
        "motion": robot.motion_facts(sent),
    }
    text = (
        f"{plan.throw.scene.name}: {recording.summary(plan.throw)}\n"
        f"  the corrected motion: expected landing error {1e3 * dx:.1f} mm and "
        f"{math.degrees(dtheta):.2f} deg, {'outside' if outside else 'within'} the tolerance"
    )
    print_result(options, result, text + written(options))
    return DONE


def export_arguments(add: Add) -> None:
    """The options of `export`."""
    _add_plan(add)
    add("--franka", metavar="DIR", help="write CSV files at 1 kHz for libfranka to this folder")
    words = "write a rosbag2 (MCAP) with trajectory and gripper command to this folder"
    add("--ros", metavar="DIR", help=words)
    add("--joint-names", nargs="+", metavar="NAME", help="names of all joints in ROS")
    words = "width [m] of the open gripper in its ROS command (default: 0.08)"
    add("--open-width", type=number(0), metavar="M", help=words)


def export(options: argparse.Namespace) -> int:
    """Write a plan for a robot controller.

    example: throwplan export out/cup/plan.json --franka out/franka
    """
    folders = {"franka": options.franka, "ros": options.ros}
    with Progress("writing the plan for controllers"):
        motion = robot.export(
            options.plan, **folders, names=options.joint_names, open_width=options.open_width
        )
    throw, duration = motion.throw, float(motion.times[-1])
    result = folders | {
        "duration": duration,
        "command_time": throw.command_time,
        "cycle": motion.cycle,
        "fraction": motion.fraction,
    }
    lines = [
        f"{throw.scene.name}: {len(motion.times)} samples, {duration:.3f} s; gripper command "
        f"{throw.command_time:.3f} s after the first"
    ]
    lines += [f"  written to {name}" for name in folders.values() if name]
    print_result(options, result, "\n".join(lines))
    return DONE
