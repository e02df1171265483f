"""Commands for robots: `run`, `correct`, `export`, and those that import arms and objects."""

from __future__ import annotations

import argparse
import math
import sys
from functools import partial
from itertools import islice
from pathlib import Path

from ..planner import TICK, SentMotion, is_cycle, outside_tolerance
from ..problems import InputError, filling, prepare_folder
from ..terminal import (
    DONE,
    Add,
    Progress,
    add_nearest,
    add_out,
    add_plan,
    add_plan_or_cycle,
    check_nearest,
    integer,
    number,
    print_result,
    report_step,
    written,
)
from .controller_files import FRANKA_FILES, motion_facts, write_motion
from .controller_files import export as export_motion
from .expectations import Expectations
from .franka import approach, check_motion, connected, rehearse, throws
from .learning import corrected
from .meshes import COMMANDS as MESH_COMMANDS
from .motions import arm_of, commands_of, joint_motion
from .recording import read_recording
from .urdf import COMMANDS as URDF_COMMANDS

#: Questions before a throw and its rehearsal, and before those of a cycle.
QUESTIONS = (
    (
        "The robot moves. Is its way clear, and the object between the pads? [y/N] ",
        "The robot moves slowly. Is its way clear, and the hand empty? [y/N] ",
    ),
    (
        "The robot moves. Is its way clear, and each object at its pick? [y/N] ",
        "The robot moves slowly. Is its way clear, and are hand and all picks empty? [y/N] ",
    ),
)


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
        motion = export_motion(
            options.plan, **folders, names=options.joint_names, open_width=options.open_width
        )
    commands = [
        {"time": one.time, "command": "grasp" if one.force else "open", "cycle": one.cycle}
        | {"fraction": one.fraction}
        for one in commands_of(motion)
    ]
    result = folders | {"duration": motion.duration, "commands": commands}
    words = ", ".join(f"{one['command']} {one['time']:.3f} s" for one in commands)
    count = len(motion.times)
    lines = [f"{motion.name}: {count} samples, {motion.duration:.3f} s; gripper: {words}"]
    lines += [f"  written to {name}" for name in folders.values() if name]
    print_result(options, result, "\n".join(lines))
    return DONE


def run_arguments(add: Add) -> None:
    """The options of `run`."""
    add_plan_or_cycle(add)
    add("--robot", metavar="HOST", help="address of a Franka Research 3")
    add("--yes", action="store_true", help="move without confirmation")
    add("--dry", action="store_true", help="print the motion instead of sending it")
    words = "send the motion slowly, with an empty hand that does not move"
    add("--rehearse", action="store_true", help=words)
    words = (
        "number of throws, each corrected by the last recording; of runs of a cycle (default: 1)"
    )
    add("--repeat", type=integer(1, 100), metavar="N", default=1, help=words)
    words = "send the motion corrected by this recording of the plan"
    add("--after", metavar="RUN.CSV", help=words)
    add_nearest(add)
    words = "write run.csv there, or run1.csv, run2.csv, ... (default: out/run)"
    add("--out", metavar="DIR", default="out/run", help=words)


def run(options: argparse.Namespace) -> int:
    """Execute a plan or a cycle on a Franka robot and record it.

    example: throwplan run out/fr3/plan.json --robot 172.16.0.2
    """
    if is_cycle(options.plan) and options.after is not None:
        raise InputError("--after: not with a cycle: it is not corrected by a recording")
    check_nearest(options)
    plan = joint_motion(options.plan)
    check_motion(options.plan, plan)
    sent = plan
    if options.after is not None:
        sent, _ = corrected(plan, read_recording(options.after, plan))
    if options.rehearse and (options.dry or options.repeat > 1):
        raise InputError("--rehearse: not with --dry or --repeat")
    if options.dry and (options.yes or options.repeat > 1):
        raise InputError("--dry: moves nothing, so neither --yes nor --repeat")
    if options.dry:
        return _print_motion(options, sent)
    if options.robot is None:
        raise InputError("--robot: is missing: give the robot's address, or --dry to move nothing")
    _check_terminal(options)
    if options.rehearse:
        return _rehearse(options, plan, sent)
    folder, runs, lines = prepare_folder(Path(options.out), ("run.csv",)), [], []
    report_step(f"connecting to {options.robot}")
    with connected(options.robot) as franka:
        question = QUESTIONS[plan.picks][0]
        recordings = throws(franka, plan, sent, partial(_confirm, options.yes, question))
        for k, recording in enumerate(islice(recordings, options.repeat), start=1):
            name = "run.csv" if options.repeat == 1 else f"run{k}.csv"
            with filling(folder, (name,)) as scratch:
                recording.save(scratch / name)
            if recording.trouble:
                where = f"recorded in {folder / name}"
                raise InputError(f"{options.robot}: {recording.trouble} ({where})")
            runs.append({"file": str(folder / name)} | recording.to_dict(plan))
            lines.append(f"{folder / name}: {recording.summary(plan)}")
            report_step(lines[-1])
    print_result(options, {"scene": plan.name, "runs": runs}, "\n".join(lines))
    return DONE


def _rehearse(options: argparse.Namespace, plan: SentMotion, sent: SentMotion) -> int:
    """Send the motion slowly, without an opening."""
    report_step(f"connecting to {options.robot}")
    question = QUESTIONS[plan.picks][1]
    with connected(options.robot) as franka:
        found = rehearse(franka, plan, sent, partial(_confirm, options.yes, question))
    assert found.width is not None
    name, duration = plan.name, float(found.times[-1])
    lag, widths = float(abs(found.q - found.sent).max()), found.width[[0, -1]].tolist()
    text = (
        f"{name}: rehearsed in {duration:.1f} s; joints lag by {lag:.3f} rad; the gripper stayed "
        f"{1e3 * widths[1]:.0f} mm open"
    )
    result = {"scene": name, "duration": duration, "lag": lag, "width": widths}
    print_result(options, result, text)
    return DONE


def _print_motion(options: argparse.Namespace, sent: SentMotion) -> int:
    """Print the motion; with a robot, check that it is ready."""
    facts = motion_facts(sent)
    count = f"{len(sent.carries)} picks and throws, " if sent.picks else ""
    first = ", ".join(f"{angle:.4f}" for angle in facts["start"])
    lines = [
        f"{sent.name}: {count}{facts['samples']} samples in {facts['duration']:.3f} s "
        f"to {facts['robot']}, from q = [{first}] rad"
    ]
    for one in sent.carries:
        closes = f"command to close {1e3 * TICK * one.reach:.1f} ms, " if one.pick else ""
        opens = f"opening command {1e3 * one.command_time:.1f} ms after the first"
        lines.append(f"  {one.name}: the gripper's {closes}{opens}")
    way = None
    if options.robot is not None:
        with connected(options.robot) as franka:
            start, _ = franka.check(arm_of(sent))
        way = approach(sent, start)
        seconds = (len(way) - 1) * TICK
        facts["approach"] = {"from": start.tolist(), "duration": seconds}
        lines.append(f"  {options.robot} is ready, {seconds:.1f} s from the start pose")
    expected = Expectations(sent, way)
    facts["expects"] = expected.to_dict()
    lines.append(expected.words)
    print_result(options, facts, "\n".join(lines))
    return DONE


def _check_terminal(options: argparse.Namespace) -> None:
    """InputError if nobody can confirm the motion."""
    if not options.yes and not sys.stdin.isatty():
        raise InputError("--yes: is missing: there is no terminal to confirm the motion")


def _confirm(yes: bool, question: str, words: str) -> None:
    """Ask for confirmation before the robot moves; with `yes` only print the words."""
    print(words, file=sys.stderr)
    if yes:
        return
    print(question, end="", file=sys.stderr, flush=True)
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise InputError("not confirmed: nothing was moved")


def correct_arguments(add: Add) -> None:
    """The options of `correct`."""
    add_plan(add)
    words = "the joints sent and measured: t, sent1, ..., q1, ... [s, rad], or run.csv of `run`"
    add("recording", metavar="RUN.CSV", help=words)
    add_out(add, "the corrected motion: joints.csv, gripper.csv, of a Franka as `export --franka`")


def correct(options: argparse.Namespace) -> int:
    """Correct a plan's motion by a recording of it.

    example: throwplan correct out/fr3/plan.json out/run/run.csv --out out/next
    """
    if is_cycle(options.plan):
        raise InputError(f"{options.plan}: is a cycle, must be a plan: cycles are not corrected")
    plan = joint_motion(options.plan)
    recording = read_recording(options.recording, plan)
    sent, expected = corrected(plan, recording)
    if options.out is not None:
        with filling(Path(options.out), FRANKA_FILES) as scratch:
            write_motion(sent, scratch)
    dx, dtheta = map(abs, expected.miss())
    outside = outside_tolerance(expected.scene.tolerance, dx, dtheta)
    result = {
        "recorded": recording.to_dict(plan),
        "expected": {"position": dx, "angle": dtheta},
        "motion": motion_facts(sent),
    }
    text = (
        f"{plan.name}: {recording.summary(plan)}\n"
        f"  the corrected motion: expected landing error {1e3 * dx:.1f} mm and "
        f"{math.degrees(dtheta):.2f} deg, {'outside' if outside else 'within'} the tolerance"
    )
    print_result(options, result, text + written(options))
    return DONE


#: The functions of each command.
COMMANDS = {
    "run": (run_arguments, run),
    "correct": (correct_arguments, correct),
    "export": (export_arguments, export),
    **URDF_COMMANDS,
    **MESH_COMMANDS,
}
