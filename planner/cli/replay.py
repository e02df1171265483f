"""`throwplan replay`: a plan thrown in MuJoCo."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...problems.files import prepare_folder
from ..result import read_plan
from ..robot import load_mujoco, replay
from .common import DONE, Add, Progress, add_out, add_plan, number, print_result, written


def arguments(add: Add) -> None:
    """The command's options."""
    add_plan(add)
    words = "coefficient of restitution of the bar, 0 to 0.99 (default: 0.1)"
    add("--restitution", type=number(), metavar="E", default=0.1, help=words)
    add_out(add, "replay.json, replay.csv and replay.png")


def run(options: argparse.Namespace) -> int:
    """Throw, write and print."""
    load_mujoco()
    if options.out is not None:
        prepare_folder(Path(options.out))
    with Progress("reading the plan") as progress:
        throw = read_plan(options.plan)
        progress.about(f"{throw.scene.name}: throwing in MuJoCo")
        result = replay(throw, restitution=options.restitution)
        if options.out is not None:
            progress.about(f"{throw.scene.name}: writing {options.out}")
            result.save(options.out)
    print_result(options, result.to_dict(), result.summary() + written(options))
    return DONE
