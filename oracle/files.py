"""Reads plans and sweeps from their files."""

from __future__ import annotations

import csv
import json
import tempfile
from pathlib import Path

import numpy as np
from throwplan import Plan
from throwplan.problems.scene_files import scene_from_table

from .judge import Oracle
from .motion import Array, Samples


def columns_of(path: Path) -> dict[str, Array]:
    """A CSV file's columns by name."""
    with path.open(encoding="utf-8") as file:
        names = next(csv.reader(file))
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2).T, strict=True))


def read_oracle(folder: Path) -> Oracle:
    """The oracle of a saved plan."""
    plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    scene, columns = scene_from_table(plan["definition"]), columns_of(folder / "motion.csv")
    kinds = (("x", "z", "theta"), ("vx", "vz", "omega"), ("ax", "az", "alpha"))
    if scene.robot is not None:
        joints = range(1, scene.arm.joints + 1)
        kinds = tuple(tuple(f"{k}{j}" for j in joints) for k in ("q", "dq", "ddq"))
    parts = (np.column_stack([columns[name] for name in names]) for names in kinds)
    return Oracle(scene, Samples(columns["t"], *parts), plan["release"]["opening_time"])


def oracle_of(plan: Plan) -> Oracle:
    """The oracle of a plan, by the files that it saves."""
    with tempfile.TemporaryDirectory() as folder:
        plan.save(folder)
        return read_oracle(Path(folder))


def read_rows(folder: Path) -> tuple[dict[str, Array], dict[str, Array]]:
    """The rows of a sweep saved in `folder`/sweep: parameters by name, and results (x, theta,
    flight_time, success, held)."""
    columns = columns_of(folder / "sweep" / "sweep.csv")
    columns.pop("sample")
    names = ("x", "theta", "flight_time", "success", "held")
    found = {name: columns.pop(name) for name in names}
    return columns, found
