"""Cycles as files: cycle.json, motion.csv, cycle.png."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array
from ...problems import InputError
from ...problems.files import filling, read_csv, read_json, write_json
from ...problems.scene_files import scene_from_table
from ..result import complete, read_samples, write_table
from ..throw import TICK
from .cycle import ORDERS, Cycle, CycleStep
from .picture import draw_cycle

#: Version of cycle.json; `read_cycle` refuses other versions.
FORMAT = 1
#: Files of a cycle's folder.
CYCLE_FILES = ("motion.csv", "cycle.png", "cycle.json")
#: Samples of a step, in their order in time, in cycle.json as `samples`.
MOMENTS = ("reach", "held", "join", "free")


def save_cycle(cycle: Cycle, folder: str | Path) -> None:
    """Write cycle.json and, if it is solved, motion.csv and cycle.png.

    motion.csv: all joints at 1 kHz, and `gripper`: 1 while it is to be closed, 0 open. InputError
    if the folder cannot be written, which then stays as it was.
    """
    with filling(Path(folder), CYCLE_FILES) as scratch:
        document: dict[str, Any] = {"format": FORMAT, **cycle.to_dict()}
        if cycle.solved:
            samples = cycle.samples
            columns = {"t": samples.times, "q": samples.q, "dq": samples.dq, "ddq": samples.ddq}
            write_table(scratch / "motion.csv", columns | {"gripper": gripper_commands(cycle)})
            draw_cycle(cycle, scratch / "cycle.png")
            tables = [step.scene.table() for step in cycle.steps]
            document["arm"] = tables[0]["arm"]
            for step, entry, table in zip(cycle.steps, document["steps"], tables, strict=True):
                entry["samples"] = [getattr(step, moment) for moment in MOMENTS]
                entry["definition"] = {k: v for k, v in table.items() if k != "arm"}
        write_json(scratch / "cycle.json", document)


def gripper_commands(cycle: Cycle) -> Array:
    """1 for each sample (N,) at which the gripper is to be closed, 0 for open."""
    times, closed = cycle.samples.times, np.zeros(len(cycle.samples.q))
    for step in cycle.steps:
        closed[(times >= TICK * step.reach) & (times < step.command_time)] = 1.0
    return closed


def is_cycle(path: str | Path) -> bool:
    """Whether a path names a cycle.json, or a folder with one and without a plan.json."""
    path = Path(path)
    if path.name == "cycle.json":
        return True
    return (path / "cycle.json").is_file() and not (path / "plan.json").exists()


def read_cycle(path: str | Path) -> Cycle:
    """The cycle of a cycle.json (or its folder) and its motion.csv, judged again when asked.

    InputError for a missing file, a file that is no cycle, another version, and a cycle that is not
    solved.
    """
    path = Path(path)
    path = path / "cycle.json" if path.is_dir() else path
    found = read_json(path)
    if not isinstance(found, dict) or "steps" not in found:
        raise InputError(f"{path}: is not a cycle file")
    if found.get("format") != FORMAT:
        version = found.get("format")
        raise InputError(f"{path}: a cycle file of version {version!r}, must be {FORMAT}")
    if found.get("status") != "solved":
        raise InputError(f"{path}: the cycle is not solved: it holds no motion")
    with complete(path, "is not a complete cycle file"):
        steps = tuple(
            _step(number, entry, found["arm"]) for number, entry in enumerate(found["steps"], 1)
        )
        # Null where some throw has no motion from rest to rest.
        stops = math.inf if found["with_stops"] is None else float(found["with_stops"])
        numbers = stops, {k: float(v) for k, v in found["time"].items()}
        name, order = str(found["jobs"]), str(found["order"])
    if not steps or order not in ORDERS or steps[0].scene.arm is None:
        raise InputError(f"{path}: is not a complete cycle file")
    joints = range(1, steps[0].scene.arm.joints + 1)
    names = [f"{kind}{j}" for kind in ("q", "dq", "ddq") for j in joints]
    samples = read_samples(path.parent / "motion.csv", names)
    moments = [getattr(step, moment) for step in steps for moment in MOMENTS]
    rising = all(a <= b for a, b in itertools.pairwise([0, *moments, len(samples.q) - 1]))
    if not rising or not all(TICK * s.join <= s.opening_time <= TICK * s.free for s in steps):
        raise InputError(f"{path}: its times must rise and be within motion.csv")
    cycle = Cycle(name, steps, samples, order, *numbers)
    for number, (step, throw) in enumerate(zip(steps, cycle.throws, strict=True), start=1):
        if step.detach_time > TICK * (len(samples.q) - 1) or not throw.lands:
            words = "its pads must be open before the motion ends, and its object must land"
            raise InputError(f"{path}: step {number}: {words}")
    gripper = read_csv("motion", str(path.parent / "motion.csv"), None, ("t", "gripper"))[:, 1]
    if (gripper != gripper_commands(cycle)).any():
        raise InputError(f"{path}: its steps do not fit the column gripper of motion.csv")
    return cycle


def _step(number: int, entry: dict[str, Any], arm: dict[str, Any]) -> CycleStep:
    try:
        scene = scene_from_table({**entry["definition"], "arm": arm})
    except InputError as error:
        raise error.within(f"step {number}") from None
    moments = [k for k in entry["samples"] if type(k) is int]
    if len(moments) != len(MOMENTS) or scene.robot is None:
        raise ValueError("samples")
    times = dict(zip(MOMENTS, moments, strict=True)), float(entry["opening_time"])
    return CycleStep(
        str(entry["pick"]), str(entry["bin"]), scene, **times[0], opening_time=times[1]
    )
