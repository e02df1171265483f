"""What is sent: the motion of an arm or a hand from rest to rest, and the objects it throws."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models import Array, ReadOnly
from ...models.robot import Arm, PlanarArm, SpatialArm
from ...problems import Obstacle
from ..throw import TICK, Samples, Throw
from ..verdict import (
    Finding,
    SpatialScene,
    Verdict,
    approach_findings,
    flight_findings,
    motion_verdict,
    verdict_on,
)
from .plan_files import joint_samples


@dataclass(frozen=True, eq=False)
class Carry(ReadOnly):
    """An object that a motion carries and throws; its times are samples of the motion.

    throw: on a clock that begins at `join`. free: from there another motion may follow. pick, bin:
    names; pick is empty if the hand holds the object from the start. reach: the hand is at rest at
    the pick, and the gripper closes; held: the hand holds the object.
    """

    throw: Throw
    join: int = 0
    free: int = 0
    pick: str = ""
    bin: str = ""
    reach: int = 0
    held: int = 0

    @property
    def name(self) -> str:
        """The object, in messages."""
        return self.pick or "the object"

    @property
    def begin(self) -> float:
        """Time [s] on the motion's clock at which the throw's begins."""
        return TICK * self.join

    @property
    def command_time(self) -> float:
        """Time [s] on the motion's clock at which the opening command is sent."""
        return self.begin + self.throw.command_time

    @property
    def opening_time(self) -> float:
        """Time [s] on the motion's clock at which the grip force starts to fall."""
        return self.begin + self.throw.opening_time

    @property
    def detach_time(self) -> float:
        """Time [s] on the motion's clock at which the grip force is zero."""
        return self.begin + self.throw.detach_time

    @property
    def landing_time(self) -> float:
        """Time [s] on the motion's clock of the landing."""
        return self.begin + self.throw.landing_time

    @cached_property
    def space(self) -> SpatialScene:
        """Its scene with all joints of the arm."""
        return SpatialScene(self.throw.scene, self.throw.manipulator)


@dataclass(frozen=True, eq=False)
class SentMotion(ReadOnly):
    """A motion that is sent, from rest to rest: of a plan, which throws what the hand holds, or of
    a cycle, which picks its objects up.

    samples: all joints of an arm (N, joints) at 1 kHz, or the coordinates of a free hand. carries:
    the objects in turn.
    """

    name: str
    samples: Samples
    carries: tuple[Carry, ...]

    @classmethod
    def of(cls, throw: Throw) -> SentMotion:
        """The motion that a throw sends."""
        kinematics, samples = throw.manipulator.kinematics, throw.samples
        if isinstance(kinematics, PlanarArm):
            azimuth = throw.target.plane.azimuth
            samples = Samples(*joint_samples(kinematics, azimuth, samples))
        return cls(throw.scene.name, samples, (Carry(throw, free=len(samples.q) - 1),))

    @property
    def throw(self) -> Throw:
        """The throw, of a cycle the first one."""
        return self.carries[0].throw

    @property
    def picks(self) -> bool:
        """Whether the hand picks its objects up."""
        return bool(self.carries[0].pick)

    @property
    def arm(self) -> Arm | None:
        """The arm; None for a free hand."""
        return self.throw.scene.arm

    @property
    def times(self) -> Array:
        """Sample times (N,) [s]."""
        return self.samples.times

    @property
    def q(self) -> Array:
        """Samples (N, joints) of the joints [rad]."""
        return self.samples.q

    @property
    def duration(self) -> float:
        """Time [s] of the motion."""
        return TICK * (len(self.samples.q) - 1)

    @property
    def closed(self) -> Array:
        """1 for each sample (N,) at which the gripper is to be closed, 0 for open."""
        times, found = self.samples.times, np.zeros(len(self.samples.q))
        for one in self.carries:
            found[(times >= TICK * one.reach) & (times < one.command_time)] = 1.0
        return found

    def in_throws(self, *throws: Throw) -> SentMotion:
        """The motion with other throws, as of another scene."""
        each = zip(self.carries, throws, strict=True)
        carries = (dataclasses.replace(carry, throw=throw) for carry, throw in each)
        return dataclasses.replace(self, carries=tuple(carries))

    def poses_at(self, times: Array) -> tuple[Array, Array]:
        """Frames (N, joints, 4, 4) after each joint, and poses (N, 4, 4) of the hand.

        times (N,) [s]: at rest before and after the motion. hand: at the pads' centre, x the
        approach axis, z the normal of the plane that the pads hold the object in.
        """
        first, throw = self.carries[0], self.throw
        plane, at = throw.target.plane, np.clip(times, 0.0, self.duration)
        if self.arm is None:
            hand = plane.poses(throw.manipulator.hand(throw.path).at(at).pose)
            return np.empty((len(times), 0, 4, 4)), hand
        q = self.samples.path.at(np.append(at, first.begin)).pose.T
        frames = SpatialArm(self.arm).frames(q)[1:].swapaxes(0, 1)
        # The hand is fixed to the last frame: as it is where the first swing begins.
        held = plane.poses(throw.manipulator.hand(throw.path).at(np.zeros(1)).pose)
        hand = frames[:-1, -1] @ np.linalg.inv(frames[-1, -1]) @ held[0]
        return frames[:-1, :-1], hand

    def waiting(self, number: int) -> tuple[Obstacle, ...]:
        """The objects of the carries from this number on, at their picks."""
        found = (
            one.space.waiting_object(self.samples.q[one.held], one.pick)
            for one in self.carries[number:]
        )
        return tuple(itertools.chain(*found))

    @cached_property
    def spaces(self) -> tuple[SpatialScene, ...]:
        """The scene of each carry, with the objects that wait at their picks until it is thrown but
        for its own, which the hand comes for."""
        each = enumerate(self.carries, start=1)
        return tuple(one.space.among(self.waiting(number)) for number, one in each)

    @cached_property
    def verdict(self) -> Verdict:
        """All limits that the motion breaks, from rest to rest; times on its clock."""
        if not self.picks:
            return verdict_on(self.throw)
        return Verdict(tuple(self._findings()))

    def _findings(self) -> Iterator[Finding]:
        empty_from, rows = 0, self.samples
        for one, space in zip(self.carries, self.spaces, strict=True):
            # With an empty hand until the object is held, with the object until the pads open.
            opens = math.floor(one.opening_time / TICK)
            for begin, end, held in ((empty_from, one.held, False), (one.held, opens, True)):
                found = motion_verdict(space, rows[begin : end + 1], held=held)
                yield from _later(found.findings, begin)
            way = rows[empty_from : one.reach + 1]
            came = approach_findings(one.space, way, rows.q[one.held])
            yield from _later(came, empty_from)
            empty_from = math.ceil(one.detach_time / TICK)
            throw = one.throw.among(space.scene.obstacle)
            yield from _later(verdict_on(throw).findings, one.join)
            free = TICK * (one.free - one.join)
            flown = flight_findings(one.space, one.throw, rows[one.free :], free)
            yield from _later(flown, one.join)
        last = self.carries[-1].space
        found = motion_verdict(last, rows[empty_from:], held=False)
        yield from _later(found.findings, empty_from)
        # Limits of the joints from rest to rest, also where the pads open.
        for finding in motion_verdict(last, rows, held=False).findings:
            if finding.code.value.startswith("joint_"):
                yield finding


def _later(findings: tuple[Finding, ...], ticks: int) -> Iterator[Finding]:
    """Findings with their times on a clock that began some samples earlier."""
    for finding in findings:
        time = None if finding.time is None else finding.time + TICK * ticks
        yield dataclasses.replace(finding, time=time)
