"""`throwplan run`: a plan on a Franka robot; `throwplan correct`: the next motion to send."""

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

#: File of the recording of one throw, and of each of several.
RECORDING, RECORDINGS = "run.csv", "run{}.csv"


def arguments(add: Add) -> None:
    """The options of `throwplan run`."""
    add_plan(add)
    add("--robot", metavar="HOST", help="address of a Franka Research 3")
    add("--yes", action="store_true", help="move without asking")
    add("--dry", action="store_true", help="move nothing, show what would be sent")
    words = "throws; each corrects the one before it (default: 1)"
    add("--repeat", type=integer(1, 100), metavar="N", default=1, help=words)
    words = "a recording of this plan: send the motion corrected by it"
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
        raise InputError("--robot: needs the robot's address (or give --dry)")
    if not options.yes and not sys.stdin.isatty():
        raise InputError("--yes: needed without a terminal to confirm")
    folder, runs, lines = prepare_folder(Path(options.out), (RECORDING,)), [], []
    report_step(f"connecting to {options.robot}")
    with connected(options.robot) as franka:
        found = throws(franka, plan, sent, _confirmation(options.yes))
        for k, recording in enumerate(islice(found, options.repeat), start=1):
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
    add("recording", metavar="RUN.CSV", help="what `throwplan run` recorded of it")
    add_out(add, "the motion to send next, as `export --franka` does,")


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
        f"  the motion to send next: {1e3 * dx:.1f} mm and {math.degrees(dtheta):.2f} deg off "
        f"are expected of it, {'outside' if outside else 'within'} the tolerance"
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
    """A function that asks before the robot moves; with `yes` it only prints what comes."""

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
