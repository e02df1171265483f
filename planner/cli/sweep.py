"""`throwplan sweep`: a plan under timing and other uncertainty."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ...models.release import BATCH_MODELS
from ...problems import Pose, Robust, Scene, load_scene
from ...problems.files import prepare_folder
from ..planner import Planner
from ..result import Plan
from ..sweep import SWEEP_FILES, check_sweep, sweep_until_stopped
from ..workers import executor_of
from .common import (
    DONE,
    INTERRUPTED,
    NO_THROW,
    Add,
    Progress,
    add_out,
    add_patience,
    add_scene,
    add_target,
    integer,
    notes,
    print_result,
    target_of,
    written,
)

#: Success rate below which the command recommends a robust plan.
MIN_RATE = 0.9


def arguments(add: Add) -> None:
    """The command's options."""
    add_scene(add)
    add_target(add)
    add("--robust", choices=Robust.METHODS, help="plan against the uncertainty")
    add_patience(add, "3 s; 6 s for a robust one")
    names = f"release model: {', '.join(BATCH_MODELS)} (default: the scene's [tolerance] model)"
    add("--model", default="", metavar="NAME", help=names)
    words = "processes on this machine (default: 1); they do not change the result"
    add(
        "--samples",
        type=integer(),
        metavar="N",
        default=1000,
        help="throws (default: 1000)",
    )
    add("--seed", type=integer(), metavar="N", default=0, help="seed of the samples (default: 0)")
    add("--workers", type=integer(), metavar="N", help=words)
    add("--scheduler", metavar="ADDRESS", help="address of a Dask scheduler to use instead")
    add_out(add, "sweep.json, sweep.csv and three pictures")


def run(options: argparse.Namespace) -> int:
    """Plan, sweep, write and print."""
    samples, seed = options.samples, options.seed
    scene = load_scene(options.scene)
    options.model = options.model or scene.tolerance.model
    check_sweep(samples, seed, options.model, "--")
    target = target_of(scene, options)
    with executor_of(options.workers, options.scheduler) as executor:
        plan = _make_plan(scene, target, options)
        if not plan.solved:
            print_result(options, plan.to_dict(), f"{scene.name}: {plan.status}")
            print(f"throwplan: {plan.message}", file=sys.stderr)
            return NO_THROW
        with Progress(scene.name) as progress:
            outcome = sweep_until_stopped(plan, samples, seed, options.model, executor, progress)
    if outcome is None:
        raise KeyboardInterrupt
    if options.out is not None:
        with Progress(f"{scene.name}: writing {options.out}"):
            outcome.save(options.out)
    result = outcome.to_dict()
    advice = ""
    if plan.target.at_rest and not plan.robust and result["success"]["rate"] < MIN_RATE:
        advice = "\n  plan with --robust auto to raise the success rate"
    print_result(options, result, outcome.summary() + advice + notes(scene) + written(options))
    if outcome.samples == samples:
        return DONE
    words = f"throwplan: interrupted: {outcome.samples:,} of {samples:,} samples"
    print(words, file=sys.stderr)
    return INTERRUPTED


def _make_plan(scene: Scene, target: Pose | None, options: argparse.Namespace) -> Plan:
    with Progress(f"{scene.name}: planning"):
        planner = Planner(scene)
        planner.check(target)
        if options.out is not None:
            prepare_folder(Path(options.out), SWEEP_FILES)
        return planner.plan(target, robust=options.robust, patience=options.patience)
