"""A cycle in MuJoCo, and over time until its last object lies."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array, ReadOnly
from ...problems import checked
from ...problems.files import filling, write_json
from ..cycle import Cycle, CycleStep
from ..rest import CUP_WALL, is_still, plane_poses
from ..show import SpaceCycle
from ..throw import TICK, Throw
from ..verdict import outside_tolerance
from .motions import solved_cycle
from .mujoco_cycle import ObjectMotion, simulate_cycle, states_in_plane
from .mujoco_replay import Replay, check_replay, landing_of, throw_to_rest
from .mujoco_throw import SimulatedFlight, end_in_cup

#: Files of a replay's folder.
REPLAY_FILES = ("replay.json", "replay.csv")


@dataclass(frozen=True, repr=False)
class ObjectReplay(Replay):
    """An object of a cycle by MuJoCo, from its pick on: a `Replay` on the clock of its throw.

    slip [m], turn [rad]: of the object in the pads as these begin to open, from where they grasped
    it. aside [m]: of the landing, left of the throw's plane. collisions: bodies that it touches
    while it is "waiting", "carried", and "flying" until it has landed, without its bin. places
    (K, 3) [m]: its CoM at `times`, in the base frame.
    """

    slip: float
    turn: float
    aside: float
    collisions: dict[str, tuple[str, ...]]
    places: Array

    @property
    def inside(self) -> bool:
        """Whether it lands within the scene's tolerance of the target."""
        dx, dtheta = self.off("target")
        way, turn = math.hypot(dx, self.aside), float(np.nan_to_num(dtheta))
        return math.isfinite(dx) and not outside_tolerance(self.throw.scene.tolerance, way, turn)

    @property
    def hits(self) -> list[str]:
        """Bodies that it touches before it has landed, with what it does then."""
        return [f"{name} ({phase})" for phase, names in self.collisions.items() for name in names]

    def to_dict(self) -> dict[str, Any]:
        """As `Replay.to_dict`, with slip, landing aside, and hits."""
        slip = {"position": self.slip, "angle": self.turn}
        collisions = {phase: list(names) for phase, names in self.collisions.items()}
        aside = self.aside if math.isfinite(self.aside) else None
        return super().to_dict() | {"slip": slip, "aside": aside, "hits": collisions}


@dataclass(frozen=True, repr=False)
class CycleReplay(ReadOnly):
    """A cycle by MuJoCo: its objects in the order of their throws. simulated [s]: from the first
    sample of the motion until the last object lies; run [s]: run time."""

    cycle: Cycle
    replays: tuple[ObjectReplay, ...]
    simulated: float
    run: float

    def _each(self) -> Iterator[tuple[CycleStep, ObjectReplay]]:
        return zip(self.cycle.steps, self.replays, strict=True)

    def to_dict(self) -> dict[str, Any]:
        """As JSON: `ObjectReplay.to_dict` of each object, with the names of pick and bin."""
        steps = [
            {"pick": step.pick, "bin": step.bin, "inside": one.inside} | one.to_dict()
            for step, one in self._each()
        ]
        times = {"simulated": self.simulated, "run": self.run}
        return {"jobs": self.cycle.name, "steps": steps, "time": times}

    def summary(self) -> str:
        """How each object is held and where it lands, as lines for people."""
        good, count = sum(one.inside for one in self.replays), len(self.replays)
        lines = [f"{self.cycle.name}: in MuJoCo {good} of {count} land inside the tolerance"]
        heads = f"{'slip while carried':>23} {'MuJoCo less target: dx':>23} {'dtheta':>11}"
        lines.append(f"  {'object':16} {'bin':12} {heads}")
        for step, one in self._each():
            dx, dtheta = one.off("target")
            angle = "open" if math.isnan(dtheta) else f"{math.degrees(dtheta):+.3f} deg"
            where = "inside" if one.inside else "OUTSIDE"
            off = f"{1e3 * dx:+20.3f} mm {angle:>11}  {where}"
            if not math.isfinite(dx):
                off = "never falls to the target's height"
            slip = f"{1e3 * one.slip:8.3f} mm {math.degrees(one.turn):7.3f} deg"
            lines.append(f"  {step.pick:16} {step.bin:12} {slip} {off}")
            if one.hits:
                lines.append(f"    on its way it hits: {', '.join(one.hits)}")
            lines += [] if one.rest is None else [f"    {words}" for words in one.rest.words()]
        assumed = dict.fromkeys(one.assumed for one in self.replays if one.rest is not None)
        lines += [f"  assumed: {words}" for words in assumed]
        return "\n".join([*lines, f"  {self.simulated:.2f} s simulated in {self.run:.1f} s"])

    def save(self, folder: str | Path) -> None:
        """Write replay.json and replay.csv; InputError if that fails.

        replay.csv: the CoM of each object, numbered from 1, in the base frame at 1 kHz from its
        opening on, on the cycle's clock.
        """
        rows = list[Array]()
        for number, (step, one) in enumerate(self._each(), start=1):
            times = TICK * step.join + one.times
            columns = np.full(len(times), number), times, one.places, one.com[2]
            rows.append(np.column_stack(columns))
        with filling(Path(folder), REPLAY_FILES) as scratch:
            write_json(scratch / "replay.json", self.to_dict())
            names = "object,t,x,y,z,theta"
            path = scratch / "replay.csv"
            np.savetxt(path, np.vstack(rows), delimiter=",", header=names, comments="", fmt="%.9g")


def replay_cycle(
    cycle: Cycle | str | Path, step: float = 1e-4, restitution: float = 0.1
) -> CycleReplay:
    """Simulate a cycle in MuJoCo, from the first sample of its motion until each object lies in its
    cup or has landed; needs the extra `mujoco`.

    cycle: a cycle, or the path of a cycle.json or of its folder. The hand follows the motion; all
    objects, cups, obstacles and the arm's links are in one world. Two pads close on each object at
    its pick with the gripper's force and carry it by friction alone: as far from each other as it
    is thick, each with one contact, whose limits are the limit surface's ellipsoid. Until it is
    held, an object stands fixed. step [s]: the largest, at most 0.2 ms; restitution: see `replay`.
    InputError for what is no cycle, and without MuJoCo.
    """
    # With 0.5 ms contacts lose what the verdict's grip holds.
    checked("step", step, float, {"least": 1e-7, "most": 2e-4})
    check_replay(restitution)
    begin, cycle = time.perf_counter(), solved_cycle(cycle)
    motions = simulate_cycle(cycle, step, restitution)
    run = time.perf_counter() - begin
    each = zip(cycle.steps, cycle.throws, motions, strict=True)
    replays = tuple(_object_replay(*one, restitution, run / len(motions)) for one in each)
    return CycleReplay(cycle, replays, float(motions[0].states[-1, 0]), run)


def _object_replay(
    step: CycleStep, throw: Throw, motion: ObjectMotion, restitution: float, run: float
) -> ObjectReplay:
    """What a simulated object did."""
    scene, begin = step.scene, TICK * step.join
    theta = float(throw.hand(np.array([throw.opening_time])).pose[2, 0]) + scene.grasp.angle
    opened = motion.states[motion.states[:, 0] >= step.opening_time]
    states = states_in_plane(step, throw, opened)
    times, com = states[:, 0], plane_poses(states, theta)
    flying = times >= throw.detach_time
    landing, landed = landing_of(SimulatedFlight(times[flying], com[:, flying]), throw.target.z)
    touched, rest, own = motion.touched["flying"], None, f" of {step.bin}"
    if scene.cup is not None:
        at_rest = bool(is_still(states[-round(0.1 / TICK) :]))
        wall_name = CUP_WALL + own
        walls = [at - begin for name, at in touched.items() if name == wall_name]
        flown, wall = states[flying], min(walls, default=math.inf)
        rest = end_in_cup(scene, scene.cup, flown, wall, at_rest, com[2, flying][0])
    elif math.isfinite(landed):
        # Nothing is known of what catches it.
        keep = times <= landed + TICK
        times, com, opened = times[keep], com[:, keep], opened[keep]
        touched = {name: at for name, at in touched.items() if at - begin <= landed}
    collisions = {phase: tuple(names) for phase, names in motion.touched.items()}
    collisions["flying"] = tuple(
        name
        for name, at in touched.items()
        if not name.startswith("floor")
        and not (name.startswith("cup ") and name.endswith(own))
        and not at - begin > landed
    )
    return ObjectReplay(
        throw,
        landing,
        times,
        com,
        tuple(touched),
        rest,
        restitution,
        simulated=float(times[-1] - times[0]),
        run=run,
        slip=motion.slip,
        turn=motion.turn,
        aside=float(np.interp(landed, states[:, 0], states[:, 2])),
        collisions=collisions,
        places=opened[:, 1:4],
    )


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
