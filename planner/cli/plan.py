"""`throwplan plan`: one throw, checked."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ...problems import Robust, load_scene
from ...problems.files import prepare_folder
from ..planner import MOST_ALTERNATIVES, Planner
from .common import (
    DONE,
    NO_THROW,
    Add,
    Progress,
    add_out,
    add_patience,
    add_scene,
    add_target,
    integer,
    print_result,
    target_of,
    written,
)


def arguments(add: Add) -> None:
    """The command's options."""
    add_scene(add)
    add_target(add)
    add(
        "--turns",
        choices=("exact", "any"),
        default="exact",
        help="exact: THETA_DEG counts full turns; any: it does not (default: exact)",
    )
    add(
        "--solver",
        choices=("auto", "fatrop", "ipopt"),
        default="auto",
        help="auto: FATROP, with IPOPT as fallback (default)",
    )
    add(
        "--robust",
        choices=Robust.METHODS,
        help="plan against the scene's [uncertainty] (default: an opening 10 ms early or late)",
    )
    words = "also list up to N different throws to the target"
    kind = integer(0, MOST_ALTERNATIVES)
    add("--alternatives", type=kind, metavar="N", default=0, help=words)
    add_patience(add, "3 s; 6 s for a robust one, 20 s for several")
    add_out(add, "plan.json, motion.csv, throw.png and throw.gif")


def run(options: argparse.Namespace) -> int:
    """Plan, write and print."""
    scene = load_scene(options.scene)
    target, alternatives = target_of(scene, options), options.alternatives
    with Progress(f"{scene.name}: building the problem"):
        planner = Planner(scene)
        planner.check(target)
    if options.out is not None:
        prepare_folder(Path(options.out))
    with Progress(f"{scene.name}: planning"):
        plan = planner.plan(
            target,
            solver=options.solver,
            turns=options.turns,
            robust=options.robust,
            alternatives=alternatives,
            patience=options.patience,
        )
    if options.out is not None:
        with Progress(f"{scene.name}: writing {options.out}"):
            plan = plan.save(options.out)
    text = plan.summary() + written(options)
    if plan.solved and len(plan.alternatives) < alternatives:
        text += f"\n  found no more of {alternatives} alternatives: all starts lead to these throws"
    print_result(options, plan.to_dict(), text)
    if plan.solved:
        return DONE
    print(f"throwplan: {plan.message}", file=sys.stderr)
    return NO_THROW
