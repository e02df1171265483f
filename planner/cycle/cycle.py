"""A planned cycle: one motion through all picks and throws, and the verdict on all of it."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...models import Array, ReadOnly
from ...models.robot import PlanarArm
from ...problems import Obstacle, Scene
from ...problems.files import plain
from ..clearance import SpatialScene
from ..throw import NO_SAMPLES, TICK, Manipulator, Samples, State, Throw, braked, make_manipulator
from ..uncertainty import warnings
from ..verdict import (
    Finding,
    Verdict,
    approach_findings,
    calibrated_landing,
    flight_findings,
    motion_verdict,
    verdict,
)
from .waiting import among, waiting_object

#: What is known of the order of picks, in words.
ORDERS = {
    "given": "as given",
    "exact": "the fastest of all",
    "insertion": "by insertion and reversals, perhaps not the fastest",
}


class UnsolvedError(Exception):
    """Why a job file has no cycle."""


@dataclass(frozen=True, eq=False)
class CycleStep(ReadOnly):
    """One object of a cycle, with times as samples of the cycle's motion.

    pick, bin: names. scene: of the throw, its target where it is at the landing. reach: the hand is
    at rest at the pick; held: it holds the object; join: the swing begins; free: the motion to the
    next pick begins. opening_time [s] on the cycle's clock.
    """

    pick: str
    bin: str
    scene: Scene
    reach: int
    held: int
    join: int
    free: int
    opening_time: float

    @cached_property
    def manipulator(self) -> Manipulator:
        """The arm in the throw's plane."""
        return make_manipulator(self.scene)

    @cached_property
    def space(self) -> SpatialScene:
        """The scene with all joints of the arm."""
        return SpatialScene(self.scene, self.manipulator)

    @property
    def detach_time(self) -> float:
        """Time [s] on the cycle's clock at which the grip force is zero."""
        return self.opening_time + self.scene.gripper.profile().opening

    @property
    def command_time(self) -> float:
        """Time [s] on the cycle's clock at which the opening command is sent."""
        return self.opening_time - self.scene.gripper.profile().dwell - self.scene.mean_delay

    def throw(self, samples: Samples) -> Throw:
        """The throw in the cycle's samples: from `join` to `free`, then a brake of its own, for
        what follows may leave the throw's plane. Its clock begins at `join`."""
        part = self.join, self.free, self.opening_time
        return part_thrown(self.scene, self.manipulator, samples, *part)


def part_thrown(
    scene: Scene,
    manipulator: Manipulator,
    samples: Samples,
    begin: int,
    end: int,
    opening_time: float,
) -> Throw:
    """The throw by a part of a motion of all joints, then a brake of its own.

    opening_time [s]: on the motion's clock; the throw's begins at sample `begin`.
    """
    kinematics = manipulator.kinematics
    assert isinstance(kinematics, PlanarArm)
    own = samples[begin : end + 1, [j - 1 for j in kinematics.throwing_joints]]
    arm = manipulator.from_state(State(own.q[0], own.dq[0], own.ddq[0]))
    sent = braked(arm.hard, own)
    return Throw.sent(scene, arm, sent.path, sent, opening_time - TICK * begin)


@dataclass(frozen=True, eq=False)
class Cycle(ReadOnly):
    """The result of `plan_cycle`: its steps in turn, and all joints (N, joints) at 1 kHz, from rest
    to rest.

    name: of the jobs. order: "given", "exact" if all orders were compared, else "insertion". stops
    [s]: time of the same throws, each from rest to rest. time [s]: of planning. refused: why there
    is no motion; empty if there is one.
    """

    name: str
    steps: tuple[CycleStep, ...] = ()
    samples: Samples = NO_SAMPLES
    order: str = "given"
    stops: float = math.nan
    time: dict[str, float] = field(default_factory=dict)
    refused: str = ""

    @property
    def solved(self) -> bool:
        """Whether there is a motion, and the verdict on it has no broken limit."""
        return not self.refused and self.verdict.ok

    @property
    def message(self) -> str:
        """Why the cycle is not solved, or what it takes."""
        if self.refused or not self.verdict.ok:
            return self.refused or self.verdict.words
        count = len(self.steps)
        return f"{count} object{'s' if count > 1 else ''} in {self.duration:.2f} s"

    @property
    def duration(self) -> float:
        """Time [s] of the whole motion."""
        return TICK * max(len(self.samples.q) - 1, 0)

    @cached_property
    def throws(self) -> tuple[Throw, ...]:
        """The throws, each on its own clock, which begins at the step's `join`."""
        return tuple(step.throw(self.samples) for step in self.steps)

    @cached_property
    def verdict(self) -> Verdict:
        """All limits that the motion breaks, from rest to rest; times on the cycle's clock."""
        return Verdict(tuple(self._findings()))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the throws, each a sentence after the names of its objects."""
        found = dict[str, list[str]]()
        for step, throw in zip(self.steps, self.throws, strict=True):
            claim = calibrated_landing(throw, throw.target)
            unlike = () if claim is None else claim.findings
            for finding in (*warnings(throw.deciding, throw.target), *unlike):
                found.setdefault(finding.words, []).append(step.pick)
        return tuple(f"{', '.join(names)}: {words}" for words, names in found.items())

    def waiting(self, number: int) -> tuple[Obstacle, ...]:
        """The objects of a step and of all later ones at their picks, as obstacles."""
        found = (
            waiting_object(step.space, self.samples.q[step.held], step.pick)
            for step in self.steps[number:]
        )
        return tuple(itertools.chain(*found))

    def _findings(self) -> Iterator[Finding]:
        empty_from = 0
        for number, (step, throw) in enumerate(zip(self.steps, self.throws, strict=True)):
            # The hand may touch the object that it comes for, and later ones wait.
            space = among(step.space, self.waiting(number + 1))
            # With an empty hand until the object is held, with the object until the pads open.
            opens = math.floor(step.opening_time / TICK)
            for begin, end, held in ((empty_from, step.held, False), (step.held, opens, True)):
                found = motion_verdict(space, self.samples[begin : end + 1], held=held)
                yield from _later(found.findings, begin)
            way = self.samples[empty_from : step.reach + 1]
            came = approach_findings(step.space, way, self.samples.q[step.held])
            yield from _later(came, empty_from)
            empty_from = math.ceil(step.detach_time / TICK)
            yield from _later(verdict(throw.among(space.scene.obstacle)).findings, step.join)
            flown = flight_findings(
                step.space, throw, self.samples[step.free :], TICK * (step.free - step.join)
            )
            yield from _later(flown, step.join)
        if self.steps:
            step = self.steps[-1]
            found = motion_verdict(step.space, self.samples[empty_from:], held=False)
            yield from _later(found.findings, empty_from)
            # Limits of the joints from rest to rest, also where the pads open.
            yield from self._joint_findings(step)

    def _joint_findings(self, step: CycleStep) -> Iterator[Finding]:
        found = motion_verdict(step.space, self.samples, held=False)
        yield from (f for f in found.findings if f.code.value.startswith("joint_"))

    def arm_at(self, times: Array) -> tuple[Array, Array]:
        """Frames (N, joints, 4, 4) after each joint, and poses (N, 4, 4) of the hand.

        times (N,) [s]: on the cycle's clock, at rest before and after it. hand: at the pads'
        centre, x the approach axis, z the normal of the plane that the pads hold the object in.
        """
        first, throw = self.steps[0], self.throws[0]
        at = np.append(np.clip(times, 0.0, self.duration), TICK * first.join)
        frames = first.space.spatial.frames(self.samples.path.at(at).pose.T)[1:].swapaxes(0, 1)
        # The hand is fixed to the last frame: as it is where the first swing begins.
        held = throw.target.plane.poses(throw.manipulator.hand(throw.to_rest).at(np.zeros(1)).pose)
        hand = frames[:-1, -1] @ np.linalg.inv(frames[-1, -1]) @ held[0]
        return frames[:-1, :-1], hand

    def to_dict(self) -> dict[str, Any]:
        """The cycle as JSON: SI units, radians, poses in the base frame, times on its clock."""
        count = len(self.steps)
        each = [_step_entries(s, t) for s, t in zip(self.steps, self.throws, strict=True)]
        found: dict[str, Any] = plain(
            {
                "jobs": self.name,
                "status": "solved" if self.solved else "not_solved",
                "message": self.message,
                "duration": self.duration,
                "per_object": self.duration / count if count else math.nan,
                "with_stops": self.stops,
                "ratio": self.duration / self.stops if math.isfinite(self.stops) else math.nan,
                "order": self.order,
                "steps": each,
                "findings": [finding.to_dict() for finding in self.verdict.findings],
                "warnings": self.warnings if self.solved else (),
                "time": self.time,
            }
        )
        return found

    def summary(self) -> str:
        """The cycle as lines for people."""
        name = self.name
        if not self.solved:
            return f"{name}: not solved: {self.message}"
        count = len(self.steps)
        lines = [f"{name}: solved, {self.message}; order {ORDERS[self.order]}"]
        lines.append(
            f"  {'object':16} {'bin':12} {'at pick':>8} {'thrown':>8} {'lands':>8}   error"
        )
        for step, throw in zip(self.steps, self.throws, strict=True):
            dx, dtheta = throw.miss()
            lands = TICK * step.join + throw.landing_time
            times = (f"{time:7.3f}s" for time in (TICK * step.reach, step.opening_time, lands))
            error = f"{1e3 * abs(dx):.2f} mm {math.degrees(abs(dtheta)):.2f} deg"
            lines.append(f"  {step.pick:16} {step.bin:12} {' '.join(times)}   {error}")
        lines += [
            f"  {'':29} {'all':>8} {'an object':>10}",
            f"  {'one motion':29} {self.duration:7.2f}s {self.duration / count:9.2f}s",
            f"  {'same throws, rest to rest':29} {self.stops:7.2f}s {self.stops / count:9.2f}s",
            f"  ratio {self.duration / self.stops:.2f}; planned in {self.time['total']:.1f} s",
        ]
        return "\n".join(lines + [f"  warning: {words}" for words in self.warnings])


def _later(findings: tuple[Finding, ...], ticks: int) -> Iterator[Finding]:
    """Findings with their times on a clock that began some samples earlier."""
    for finding in findings:
        time = None if finding.time is None else finding.time + TICK * ticks
        yield dataclasses.replace(finding, time=time)


def _step_entries(step: CycleStep, throw: Throw) -> dict[str, Any]:
    dx, dtheta = throw.miss()
    x, z, theta = throw.landing.pose
    target = step.scene.aim
    return {
        "pick": step.pick,
        "bin": step.bin,
        "reach_time": TICK * step.reach,
        "held_time": TICK * step.held,
        "join_time": TICK * step.join,
        "command_time": step.command_time,
        "opening_time": step.opening_time,
        "detach_time": step.detach_time,
        "free_time": TICK * step.free,
        "landing_time": TICK * step.join + throw.landing_time,
        "target": target.table,
        "landing": dict(zip("xyz", target.plane.points(x, z), strict=True)) | {"theta": theta},
        "error": {"position": abs(dx), "angle": abs(dtheta)},
    }
