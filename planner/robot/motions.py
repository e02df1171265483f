"""What is sent to an arm and its gripper: a plan's motion, or a cycle's, checked again."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from ...models import Array, ReadOnly
from ...models.robot import Arm, PlanarArm
from ...problems import InputError
from ...problems.arms import load_arm
from ..clearance import SpatialScene
from ..cycle import Cycle, is_cycle, read_cycle
from ..result import Plan, joint_samples, throw_of
from ..throw import TICK, Samples, Throw
from ..verdict import JOINT_LIMITS, verdict
from .gripper import GRASP_TOLERANCE, MOVED, OPEN_WIDTH

#: An instant is on a tick if it is within this distance of it [ticks].
ON_TICK = 1e-6
#: Time [s] after a throw in which the gripper must have reported that it is open, if the arm goes
#: on to another pick: two reports of a Franka Hand, and a spare one.
OPENED = 0.3


@dataclass(frozen=True)
class GripperCommand:
    """A command to the gripper: time [s] on the motion's clock, width [m] of the gap, force [N] at
    most. With a force it closes on an object; tolerance [m] of the object's width."""

    time: float
    width: float
    force: float = 0.0
    tolerance: float = 0.0

    @property
    def cycle(self) -> int:
        """The last sample at or before the command, which is sent in its cycle."""
        return math.floor(self.time / TICK + ON_TICK)

    @property
    def fraction(self) -> float:
        """Share of that cycle before the command is due, 0 to 1."""
        return max(self.time / TICK - self.cycle, 0.0)


@dataclass(frozen=True, eq=False)
class Carry(ReadOnly):
    """An object that a motion carries and throws.

    throw: on its own clock, which begins at sample `begin` of the motion; objects that wait at
    their picks are obstacles of its scene. pick: name of the object and its number in the motion;
    empty if the hand holds it from the start. reach: sample at which the gripper closes on it;
    held: from which the hand holds it; due: at which the gripper must be open, None where nothing
    follows.
    """

    throw: Throw
    begin: int = 0
    pick: str = ""
    reach: int = 0
    held: int = 0
    due: int | None = None

    @property
    def name(self) -> str:
        """The object, in messages."""
        return self.pick or "the object"

    @property
    def close(self) -> GripperCommand:
        """The command that closes the gripper on the object at its pick.

        How thick an outlined object is between the pads is not known: any width will do.
        """
        bar, force = self.throw.scene.object, self.throw.scene.gripper.profile().full
        width, tolerance = bar.width, GRASP_TOLERANCE
        if bar.outline or not bar.width:
            width, tolerance = OPEN_WIDTH / 2, OPEN_WIDTH / 2 - MOVED
        return GripperCommand(TICK * self.reach, width, force, tolerance)

    @property
    def open(self) -> GripperCommand:
        """The command that opens the gripper for the throw."""
        return GripperCommand(TICK * self.begin + self.throw.command_time, OPEN_WIDTH)

    @cached_property
    def space(self) -> SpatialScene:
        """Its scene with all joints of the arm."""
        return SpatialScene(self.throw.scene, self.throw.manipulator)


@dataclass(frozen=True)
class JointMotion(ReadOnly):
    """A motion to send to an arm: all joints at 1 kHz from rest to rest, and what it throws.

    q, dq, ddq (N, joints); carries: the objects in turn, of a plan one.
    """

    arm: Arm = field(repr=False)
    carries: tuple[Carry, ...]
    q: Array = field(repr=False)
    dq: Array = field(repr=False)
    ddq: Array = field(repr=False)

    @classmethod
    def of(cls, throw: Throw) -> JointMotion:
        """The motion that a throw by an arm sends."""
        kinematics = throw.manipulator.kinematics
        assert isinstance(kinematics, PlanarArm)
        values = joint_samples(kinematics, throw.target.plane.azimuth, throw.samples)
        return cls(kinematics.arm, (Carry(throw),), *values)

    @property
    def throw(self) -> Throw:
        """The throw, of a cycle the first one."""
        return self.carries[0].throw

    @property
    def picks(self) -> bool:
        """Whether the hand picks its objects up, as in a cycle."""
        return bool(self.carries[0].pick)

    def parts(self) -> Iterator[tuple[Carry, slice]]:
        """Each object and its samples of the motion: from the opening for the one before, when the
        hand may come to its pick, to its own."""
        begins = [0, *(one.open.cycle + 1 for one in self.carries[:-1]), len(self.q)]
        for carry, begin, end in zip(self.carries, begins, begins[1:], strict=False):
            yield carry, slice(begin, end)

    @property
    def samples(self) -> Samples:
        """All joints."""
        return Samples(self.q, self.dq, self.ddq)

    @property
    def times(self) -> Array:
        """Sample times (N,) [s]."""
        return self.samples.times

    @property
    def commands(self) -> tuple[GripperCommand, ...]:
        """Commands to the gripper, in turn."""
        each = ((one.close, one.open) if one.pick else (one.open,) for one in self.carries)
        return tuple(command for commands in each for command in commands)


def joint_motion(plan: Plan | Throw | Cycle | str | Path) -> JointMotion:
    """The motion of an arm's plan or of a cycle, or of their files, checked for sending.

    InputError for what `read_plan` or `read_cycle` refuses, for a hand's plan, and for a motion
    that does not begin and end at rest, breaks a limit or misses a target: files can be edited.
    """
    if isinstance(plan, Cycle) or (isinstance(plan, str | Path) and is_cycle(plan)):
        found = solved_cycle(plan)
        path = found.name if isinstance(plan, Cycle) else plan
        motion, mistakes = _of_cycle(found), _cycle_mistakes(found)
    else:
        throw = throw_of(plan)
        path = plan if isinstance(plan, str | Path) else throw.scene.name
        if throw.scene.robot is None:
            words = "the plan's scene has no [robot], so there are no joints to send"
            raise InputError(f"{path}: {words}")
        motion = JointMotion.of(throw)
        mistakes = _plan_mistakes(motion)
    mistake = next(mistakes, None)
    if mistake is not None:
        raise InputError(f"{path}: not sent, {mistake}")
    return motion


def solved_cycle(cycle: Cycle | str | Path) -> Cycle:
    """A cycle with a motion; InputError for what `read_cycle` refuses, and without a motion."""
    found = cycle if isinstance(cycle, Cycle) else read_cycle(cycle)
    if found.refused:
        raise InputError(f"{found.name}: the cycle is not solved: {found.refused}")
    return found


def _of_cycle(cycle: Cycle) -> JointMotion:
    """The motion of a cycle and its objects."""
    arm, rows, count = cycle.steps[0].scene.arm, cycle.samples, len(cycle.steps)
    assert arm is not None
    carries = list[Carry]()
    ends = [*(step.reach for step in cycle.steps[1:]), len(rows.q) - 1]
    each = zip(cycle.steps, cycle.throws, ends, strict=True)
    for number, (step, throw, end) in enumerate(each, start=1):
        name = f"{step.pick} (pick {number} of {count})"
        due = min(math.ceil((step.detach_time + OPENED) / TICK), end)
        around = throw.among((*throw.scene.obstacle, *cycle.waiting(number)))
        carries.append(Carry(around, step.join, name, step.reach, step.held, due))
    return JointMotion(arm, tuple(carries), rows.q, rows.dq, rows.ddq)


def _plan_mistakes(motion: JointMotion) -> Iterator[str]:
    """Reasons not to send a plan's motion."""
    throw, arm = motion.throw, motion.arm
    yield from _rest_mistakes(arm, motion.samples)
    broken = verdict(throw).broken
    # Joint limits first: uneven samples miss the target, too.
    yield from (finding.words for finding in broken if finding.code in JOINT_LIMITS.values())
    yield from _rate_mistakes(arm, motion.samples)
    if throw.command_time < -ON_TICK * TICK:
        yield f"the opening command would come {-1e3 * throw.command_time:.1f} ms too early"
    yield from (finding.words for finding in broken)


def _cycle_mistakes(cycle: Cycle) -> Iterator[str]:
    """Reasons not to send a cycle's motion."""
    arm = cycle.steps[0].scene.arm
    assert arm is not None
    yield from _rest_mistakes(arm, cycle.samples)
    yield from (finding.words for finding in cycle.verdict.broken)
    yield from _rate_mistakes(arm, cycle.samples)
    for step in cycle.steps:
        early = TICK * step.held - step.command_time
        if early > 0:
            words = f"the opening command would come {1e3 * early:.1f} ms before it is held"
            yield f"{step.pick}: {words}"


def _rest_mistakes(arm: Arm, samples: Samples) -> Iterator[str]:
    """Ends of a motion of all joints that are not at rest, and a start outside their range."""
    for where, sample in (("begin", 0), ("end", -1)):
        rest = (np.abs(samples.dq[sample]) <= 1e-6) & (np.abs(samples.ddq[sample]) <= 1e-3)
        for j in np.flatnonzero(~rest):
            yield f"the motion does not {where} at rest: joint {j + 1}"
    low, high = np.array(arm.limits.position_min), np.array(arm.limits.position_max)
    for j in np.flatnonzero((samples.q[0] < low) | (samples.q[0] > high)):
        yield f"joint {j + 1} position: outside its limits"


def _rate_mistakes(arm: Arm, samples: Samples) -> Iterator[str]:
    """Positions, rates and accelerations that contradict each other: the mean rate of a tick is off
    by more than twice the change that the jerk limit allows in it."""
    pairs = (
        ("rates", samples.q, samples.dq, TICK / 4),
        ("accelerations", samples.dq, samples.ddq, 1),
    )
    for name, values, rates, part in pairs:
        off = np.abs(np.diff(values, axis=0) / TICK - (rates[1:] + rates[:-1]) / 2)
        allowed = part * np.array(arm.limits.jerk) * TICK / 2 + 1e-6
        for j in np.flatnonzero((off > allowed).any(axis=0)):
            yield f"joint {j + 1}'s {name} do not fit the samples"


def is_franka(arm: Arm) -> bool:
    """Whether the arm's flange moves as a Franka's does (Panda and FR3 alike)."""
    its = load_arm("fr3")
    if arm.joints != its.joints:
        return False
    q = np.linspace(-1.0, 1.0, arm.joints).tolist()
    return bool(np.abs(arm.placed(q)[-2] - its.placed(q)[-2]).max() < 1e-3)
