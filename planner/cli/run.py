"""`throwplan run`: a plan on a Franka robot; `throwplan correct`: its corrected motion."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from itertools import islice
from pathlib import Path

from ...problems import InputError
from ...problems.files import filling, prepare_folder
from ..robot import (
    FRANKA_FILES,
    JointMotion,
    approach,
    check_arm,
    connected,
    corrected,
    joint_motion,
    motion_facts,
    read_recording,
    throws,
    write_franka,
)
from ..throw import TICK
from ..verdict import outside_tolerance
from .common import DONE, Add, add_out, add_plan, integer, print_result, report_step, written

#: File of a single recording.
RECORDING = "run.csv"
#: File of recording k with --repeat.
RECORDINGS = "run{}.csv"


def arguments(add: Add) -> None:
    """The options of `throwplan run`."""
    add_plan(add)
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
    """Check, ask, throw, record."""
    plan = joint_motion(options.plan)
    check_arm(options.plan, plan.arm)
    sent = plan
    if options.after is not None:
        sent, _ = corrected(plan, read_recording(options.after, plan))
    if options.dry:
        return _print_motion(options, sent)
    if options.robot is None:
        raise InputError("--robot: is missing: give the robot's address, or --dry to move nothing")
    if not options.yes and not sys.stdin.isatty():
        raise InputError("--yes: is missing: there is no terminal to confirm the motion")
    folder, runs, lines = prepare_folder(Path(options.out), (RECORDING,)), [], []
    report_step(f"connecting to {options.robot}")
    with connected(options.robot) as franka:
        recordings = throws(franka, plan, sent, _confirmation(options.yes))
        for k, recording in enumerate(islice(recordings, options.repeat), start=1):
            name = RECORDING if options.repeat == 1 else RECORDINGS.format(k)
            with filling(folder, (name,)) as scratch:
                recording.save(scratch / name)
            runs.append({"file": str(folder / name)} | recording.to_dict(plan.throw))
            lines.append(f"{folder / name}: {recording.summary(plan.throw)}")
            report_step(lines[-1])
    print_result(options, {"scene": plan.throw.scene.name, "runs": runs}, "\n".join(lines))
    return DONE


def correct_arguments(add: Add) -> None:
    """The options of `throwplan correct`."""
    add_plan(add)
    add("recording", metavar="RUN.CSV", help="a recording of the plan by `throwplan run`")
    add_out(add, "the corrected motion in the files of `export --franka`")


def run_correct(options: argparse.Namespace) -> int:
    """Correct, write and print."""
    plan = joint_motion(options.plan)
    recording = read_recording(options.recording, plan)
    sent, expected = corrected(plan, recording)
    if options.out is not None:
        with filling(Path(options.out), FRANKA_FILES) as scratch:
            write_franka(sent, scratch)
    dx, dtheta = map(abs, expected.miss())
    outside = outside_tolerance(expected.scene.tolerance, dx, dtheta)
    result = {
        "recorded": recording.to_dict(plan.throw),
        "expected": {"position": dx, "angle": dtheta},
        "motion": motion_facts(sent),
    }
    text = (
        f"{plan.throw.scene.name}: {recording.summary(plan.throw)}\n"
        f"  the corrected motion: expected landing error {1e3 * dx:.1f} mm and "
        f"{math.degrees(dtheta):.2f} deg, {'outside' if outside else 'within'} the tolerance"
    )
    print_result(options, result, text + written(options))
    return DONE


def _print_motion(options: argparse.Namespace, sent: JointMotion) -> int:
    """Print the motion; with a robot, check that it is ready."""
    facts = motion_facts(sent)
    lines = [
        f"{sent.throw.scene.name}: {facts['samples']} samples in {facts['duration']:.3f} s to "
        f"{sent.arm.name}, from q = [{', '.join(f'{angle:.4f}' for angle in facts['start'])}] rad",
        f"  the gripper's opening command {1e3 * facts['gripper']['command_time']:.1f} ms after "
        "the first",
    ]
    if options.robot is not None:
        with connected(options.robot) as franka:
            start, _ = franka.check(sent.arm)
        seconds = (len(approach(sent, start)) - 1) * TICK
        facts["approach"] = {"from": start.tolist(), "duration": seconds}
        lines.append(f"  {options.robot} is ready, {seconds:.1f} s from the start pose")
    print_result(options, facts, "\n".join(lines))
    return DONE


def _confirmation(yes: bool) -> Callable[[str], None]:
    """A function that asks for confirmation before the robot moves; with `yes` it only prints."""

    def ask(words: str) -> None:
        print(words, file=sys.stderr)
        if yes:
            return
        print(
            "The robot moves. Is its way clear, and the object between the pads? [y/N] ",
            end="",
            file=sys.stderr,
            flush=True,
        )
        if sys.stdin.readline().strip().lower() not in ("y", "yes"):
            raise InputError("not confirmed: nothing was moved")

    return ask
