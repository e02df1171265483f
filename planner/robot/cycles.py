"""A cycle's throws in MuJoCo, and the whole cycle until its last object lies."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array, ReadOnly
from ...problems import check_arguments
from ...problems.files import filling, write_json
from ..cycle import Cycle, CycleStep
from ..show import SpaceCycle
from ..throw import TICK
from .motions import solved_cycle
from .mujoco_replay import Replay, check_replay, simulate, throw_to_rest
from .mujoco_throw import HandPoses

#: Files of a replay's folder.
REPLAY_FILES = ("replay.json", "replay.csv")


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
