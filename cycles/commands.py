"""The command `cycle`."""

from __future__ import annotations

import argparse
from functools import partial

from ..pictures import save as save_pictures
from ..terminal import (
    DONE,
    Add,
    Progress,
    add_out,
    add_patience,
    fail,
    prepare_out,
    print_result,
    save_out,
    written,
)
from .cycle import CYCLE_FILES
from .job_files import load_jobs
from .planning import plan_cycle


def cycle_arguments(add: Add) -> None:
    """The options of `cycle`."""
    add("jobs", metavar="JOBS", help="a shipped job file's name or a TOML file of picks and bins")
    add_patience(add, "10 s for each throw that is planned")
    add_out(add, "cycle.json, motion.csv and cycle.png")


def cycle(options: argparse.Namespace) -> int:
    """Plan many picks and bins as one motion in the least time.

    example: throwplan cycle six-parts --out out/cycle
    """
    jobs = load_jobs(options.jobs)
    prepare_out(options, CYCLE_FILES)
    patience = {} if options.patience is None else {"patience": options.patience}
    with Progress(jobs.name) as progress:
        found = plan_cycle(jobs, progress=progress.about, **patience)
    drawn = [partial(save_pictures, found)] if found.solved else []
    save_out(options, jobs.name, found.save, *drawn)
    if not found.solved:
        print_result(options, found.to_dict(), f"{jobs.name}: not solved")
        return fail(found.message)
    print_result(options, found.to_dict(), found.summary() + written(options))
    return DONE


#: The functions of the command.
COMMANDS = {"cycle": (cycle_arguments, cycle)}
