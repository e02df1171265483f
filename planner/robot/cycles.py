"""A cycle on other systems: as a bag for ROS 2, and its throws in MuJoCo.

A cycle that is read back is judged again as a whole, since files can be edited.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array, ReadOnly
from ...problems import InputError, check_arguments, checked
from ...problems.files import filling, write_json
from ..cycle import Cycle, CycleStep, read_cycle
from ..show import SpaceCycle
from ..throw import TICK
from .controller_files import (
    ROS_FILES,
    WIDTHS,
    GripperCommand,
    joint_names,
    rate_mistakes,
    rest_mistakes,
    ros_typestore,
    write_ros,
)
from .gripper import OPEN_WIDTH
from .mujoco_replay import Replay, check_replay, simulate, throw_to_rest
from .mujoco_throw import HandPoses

#: Files of a replay's folder.
REPLAY_FILES = ("replay.json", "replay.csv")


def solved_cycle(cycle: Cycle | str | Path) -> Cycle:
    """A cycle with a motion; InputError for what `read_cycle` refuses, and without a motion."""
    found = cycle if isinstance(cycle, Cycle) else read_cycle(cycle)
    if found.refused:
        raise InputError(f"{found.name}: the cycle is not solved: {found.refused}")
    return found


def cycle_of(cycle: Cycle | str | Path) -> Cycle:
    """A solved cycle; of a cycle.json or its folder, judged again.

    InputError for what `read_cycle` refuses, and for a motion that breaks a limit, does not begin
    and end at rest, or misses a target.
    """
    place = cycle.name if isinstance(cycle, Cycle) else cycle
    cycle = solved_cycle(cycle)
    mistake = next(_mistakes(cycle), None)
    if mistake is not None:
        raise InputError(f"{place}: not sent, {mistake}")
    return cycle


def _mistakes(cycle: Cycle) -> Iterator[str]:
    """Reasons not to send the motion."""
    arm = cycle.steps[0].scene.arm
    assert arm is not None
    yield from rest_mistakes(arm, cycle.samples)
    yield from (finding.words for finding in cycle.verdict.broken)
    yield from rate_mistakes(arm, cycle.samples)
    for step in cycle.steps:
        early = TICK * step.held - step.command_time
        if early > 0:
            words = f"the opening command would come {1e3 * early:.1f} ms before it is held"
            yield f"{step.pick}: {words}"


@check_arguments
def export_cycle(
    cycle: Cycle | str | Path,
    *,
    ros: str | Path,
    names: Sequence[str] | None = None,
    open_width: float | None = None,
) -> Cycle:
    """Check a cycle again and write it for ROS 2 (extra `ros`); returns the cycle.

    cycle: a cycle, or the path of a cycle.json or of its folder. ros: folder of the bag: all joints
    at 1 kHz, a command that closes the gripper at each pick and one that opens it for each throw;
    names, open_width: see `export`. InputError for a cycle that must not be sent and for a folder
    that cannot be written.
    """
    width = OPEN_WIDTH if open_width is None else checked("--open-width", open_width, float, WIDTHS)
    ros_typestore()
    cycle = cycle_of(cycle)
    arm = cycle.steps[0].scene.arm
    assert arm is not None
    joints, commands = joint_names(arm, names), list[GripperCommand]()
    for step in cycle.steps:
        force = step.scene.gripper.profile().full
        commands.append(GripperCommand(TICK * step.reach, 0.0, force))
        commands.append(GripperCommand(step.command_time, width))
    with filling(Path(ros), ROS_FILES, "--ros") as folder:
        write_ros(folder, joints, cycle.samples, commands)
    return cycle


@dataclass(frozen=True, repr=False)
class CycleReplay(ReadOnly):
    """The throws of a cycle by MuJoCo, in their order, each on its own clock."""

    cycle: Cycle
    replays: tuple[Replay, ...]

    def _each(self) -> Iterator[tuple[CycleStep, Replay]]:
        return zip(self.cycle.steps, self.replays, strict=True)

    def to_dict(self) -> dict[str, Any]:
        """As JSON: `Replay.to_dict` of each throw, with the names of pick and bin."""
        steps = [
            {"pick": step.pick, "bin": step.bin, "inside": one.inside} | one.to_dict()
            for step, one in self._each()
        ]
        return {"jobs": self.cycle.name, "steps": steps}

    def summary(self) -> str:
        """Where each object lands, as lines for people."""
        good, count = sum(one.inside for one in self.replays), len(self.replays)
        lines = [f"{self.cycle.name}: in MuJoCo {good} of {count} land inside the tolerance"]
        lines.append(f"  {'object':16} {'bin':12} {'MuJoCo less target: dx':>23} {'dtheta':>11}")
        for step, one in self._each():
            dx, dtheta = one.off("target")
            angle = "open" if math.isnan(dtheta) else f"{math.degrees(dtheta):+.3f} deg"
            where = "inside" if one.inside else "OUTSIDE"
            off = f"{1e3 * dx:+20.3f} mm {angle:>11}  {where}"
            if not math.isfinite(dx):
                off = "never falls to the target's height"
            lines.append(f"  {step.pick:16} {step.bin:12} {off}")
            if one.hits:
                lines.append(f"    on its way it hits: {', '.join(one.hits)}")
            lines += [] if one.rest is None else [f"    {words}" for words in one.rest.words()]
        assumed = dict.fromkeys(one.assumed for one in self.replays if one.rest is not None)
        lines += [f"  assumed: {words}" for words in assumed]
        simulated, run = (
            sum(getattr(r, key) for r in self.replays) for key in ("simulated", "run")
        )
        return "\n".join([*lines, f"  {simulated:.2f} s simulated in {run:.1f} s"])

    def save(self, folder: str | Path) -> None:
        """Write replay.json and replay.csv; InputError if that fails.

        replay.csv: the CoM of each object, numbered from 1, in the base frame at 1 kHz from its
        opening on, on the cycle's clock.
        """
        rows = list[Array]()
        for number, (step, one) in enumerate(self._each(), start=1):
            places = one.throw.target.plane.points(one.com[0], one.com[1])
            times = TICK * step.join + one.times
            rows.append(np.column_stack([np.full(len(times), number), times, places, one.com[2]]))
        with filling(Path(folder), REPLAY_FILES) as scratch:
            write_json(scratch / "replay.json", self.to_dict())
            names = "object,t,x,y,z,theta"
            path = scratch / "replay.csv"
            np.savetxt(path, np.vstack(rows), delimiter=",", header=names, comments="", fmt="%.9g")


@check_arguments
def replay_cycle(
    cycle: Cycle | str | Path,
    step: float = 1e-5,
    flight_step: float = 1e-4,
    points: int = 12,
    restitution: float = 0.1,
) -> CycleReplay:
    """Throw a cycle's objects in MuJoCo, as `replay` does with one; needs the extra `mujoco`.

    cycle: a cycle, or the path of a cycle.json or of its folder. The hand, which a flying object
    may hit, goes on to the next pick as in the cycle. MuJoCo takes over in the last millisecond
    before the opening: until then the hand may be out of the throw's plane. Options and errors: see
    `replay`.
    """
    check_replay(step, flight_step, points, restitution)
    cycle = solved_cycle(cycle)
    options = step, flight_step, points, restitution
    each = zip(cycle.steps, cycle.throws, strict=True)
    return CycleReplay(
        cycle, tuple(simulate(throw, *options, _hand_at(cycle, one)) for one, throw in each)
    )


def _hand_at(cycle: Cycle, step: CycleStep) -> HandPoses:
    """The hand's motion on the clock of a step's throw."""
    return lambda times: cycle.arm_at(times + TICK * step.join)[1]


def cycle_in_space(cycle: Cycle | str | Path) -> tuple[SpaceCycle, str]:
    """A cycle over time until its last object lies, and why objects stop at their targets, if so.

    InputError for what `read_cycle` refuses, and for a throw that does not land.
    """
    cycle = solved_cycle(cycle)
    throws, reasons = zip(*(throw_to_rest(throw) for throw in cycle.throws), strict=True)
    begins = tuple(TICK * step.join for step in cycle.steps)
    ends = (begin + throw.line.times[-1] for begin, throw in zip(begins, throws, strict=True))
    times = np.arange(0.0, max(cycle.duration, *ends) + TICK / 2, TICK)
    names, held = zip(*((step.pick, TICK * step.held) for step in cycle.steps), strict=True)
    space = SpaceCycle(cycle.name, names, throws, begins, held, times, *cycle.arm_at(times))
    return space, next(filter(None, reasons), "")
