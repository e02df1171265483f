"""Section `scenes`: every built-in scene, planned in a fresh process by both solvers."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time

from throwplan import load_scene, scene_names
from throwplan.pictures import Row, Table

from .page import Effort, Section

#: Time limit [s] of a process that plans once.
PATIENCE = 300.0


def make(effort: Effort) -> Section:
    """A row for each scene that has something to plan, and solver."""
    names = [name for name in scene_names() if load_scene(name).motion is None]
    jobs = [
        (name, solver)
        for name in effort.of(["cup", "hand-box"], names)
        for solver in ("fatrop", "ipopt")
    ]
    step, rows = effort.counter(len(jobs)), list[Row]()
    for name, solver in jobs:
        rows.append(_planned(name, solver))
        step()
    return Section(
        "Built-in scenes",
        "`throwplan plan SCENE --solver SOLVER` in a fresh process. The error is that of the "
        "motion that is sent, by the limit surface, which decides; *sliding pivot* is the position "
        "error by that release model. *Whole* is the time of the process, with imports.",
        [Table("scenes", "Built-in scenes", rows)],
    )


def _planned(name: str, solver: str) -> Row:
    """One scene by one solver; the errors are None without a throw."""
    command = [sys.executable, "-m", "throwplan", "plan", name, "--json", "--solver", solver]
    start = time.perf_counter()
    env = os.environ | {"THROWPLAN_CACHE": ""}
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=PATIENCE, env=env
    )
    seconds = time.perf_counter() - start
    result = json.loads(done.stdout)
    errors, free = result["error"], result["target"]["theta"] is None
    exact, pivot = (errors and errors[key] for key in (result["decides"], "sent"))
    return {
        "scene": name,
        "solver": solver,
        "status": result["status"],
        "error [mm]": exact and round(1e3 * exact["position"], 3),
        "[°]": None if free or not exact else round(math.degrees(exact["angle"]), 3),
        "sliding pivot [mm]": pivot and round(1e3 * pivot["position"], 2),
        "iterations": result["solver"]["iterations"],
        "solve [ms]": round(1e3 * result["time"]["solve"]),
        "whole [s]": round(seconds, 1),
    }
