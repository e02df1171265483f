"""Motions for an arm and its gripper: the commands of a sent motion, and its checks before it is
sent."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..planner import JOINT_LIMITS, TICK, Carry, SentMotion, Source, sent_motion
from ..problems import Arm, InputError, load_arm
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


def grasp_of(carry: Carry) -> GripperCommand:
    """The command that closes the gripper on an object at its pick, or in a hand that holds it.

    How thick an outlined object is between the pads is not known: any width will do.
    """
    bar, force = carry.throw.scene.object, carry.throw.scene.gripper.profile().full
    width, tolerance = bar.width, GRASP_TOLERANCE
    if bar.outline or not bar.width:
        width, tolerance = OPEN_WIDTH / 2, OPEN_WIDTH / 2 - MOVED
    return GripperCommand(TICK * carry.reach, width, force, tolerance)


def opening_of(carry: Carry) -> GripperCommand:
    """The command that opens the gripper for a throw."""
    return GripperCommand(carry.command_time, OPEN_WIDTH)


def commands_of(motion: SentMotion) -> list[GripperCommand]:
    """The commands to the gripper, in turn."""
    each = (
        (grasp_of(one), opening_of(one)) if one.pick else (opening_of(one),)
        for one in motion.carries
    )
    return [command for commands in each for command in commands]


def opening_due(motion: SentMotion, number: int) -> int | None:
    """The sample at which the gripper must be open after the throw of a carry, counted from 0; None
    where nothing follows."""
    if not motion.picks:
        return None
    ends = [*(one.reach for one in motion.carries[1:]), len(motion.samples.q) - 1]
    opened = math.ceil((motion.carries[number].detach_time + OPENED) / TICK)
    return min(opened, ends[number])


def parts_of(motion: SentMotion) -> Iterator[tuple[int, slice]]:
    """The number of each carry and its samples of the motion: from the opening for the one before,
    when the hand may come to its pick, to its own."""
    opens = [opening_of(one).cycle + 1 for one in motion.carries[:-1]]
    begins = [0, *opens, len(motion.samples.q)]
    for number in range(len(motion.carries)):
        yield number, slice(*begins[number : number + 2])


def arm_of(motion: SentMotion) -> Arm:
    """The arm of a motion that `joint_motion` has checked."""
    assert motion.arm is not None
    return motion.arm


def joint_motion(source: Source) -> SentMotion:
    """The motion of an arm's plan or of a cycle, or of their files, checked for sending.

    InputError for what `read_motion` refuses, for a hand's plan, and for a motion that does not
    begin and end at rest, breaks a limit or misses a target: files can be edited.
    """
    motion = sent_motion(source)
    path = source if isinstance(source, str | Path) else motion.name
    if motion.arm is None:
        words = "the plan's scene has no [robot], so there are no joints to send"
        raise InputError(f"{path}: {words}")
    mistake = next(_mistakes(motion, motion.arm), None)
    if mistake is not None:
        raise InputError(f"{path}: not sent, {mistake}")
    return motion


def _mistakes(motion: SentMotion, arm: Arm) -> Iterator[str]:
    """Reasons not to send a motion."""
    samples, limits = motion.samples, arm.limits
    for where, sample in (("begin", 0), ("end", -1)):
        rest = (np.abs(samples.dq[sample]) <= 1e-6) & (np.abs(samples.ddq[sample]) <= 1e-3)
        for j in np.flatnonzero(~rest):
            yield f"the motion does not {where} at rest: joint {j + 1}"
    outside = (samples.q[0] < limits.position_min) | (samples.q[0] > limits.position_max)
    for j in np.flatnonzero(outside):
        yield f"joint {j + 1} position: outside its limits"
    broken = motion.verdict.broken
    # Joint limits first: uneven samples miss the target, too.
    yield from (finding.words for finding in broken if finding.code in JOINT_LIMITS.values())
    yield from _uneven(motion, arm)
    for one in motion.carries:
        early = TICK * (one.held - ON_TICK) - one.command_time
        if early > 0.0:
            words = "too early" if not one.pick else "before it is held"
            yield f"{one.name}: the opening command would come {1e3 * early:.1f} ms {words}"
    yield from (finding.words for finding in broken)


def _uneven(motion: SentMotion, arm: Arm) -> Iterator[str]:
    """Positions, rates and accelerations that contradict each other: the mean rate of a tick is off
    by more than twice the change that the jerk limit allows in it."""
    samples = motion.samples
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
