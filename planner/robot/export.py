"""What is sent to a robot: a saved plan's joint motion, read back and checked again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...models import Arm, PlanarArm
from ...problems import InputError
from ..check import TICK, Throw, broken_limits
from ..ocp import broken as broken_terms
from ..result import joint_samples, read_plan

Array = npt.NDArray[np.float64]

#: At rest: rate [rad/s] and acceleration [rad/s^2] of every joint are below.
REST = (1e-6, 1e-3)
#: A clock instant is on a tick that it misses by less than this share of one.
ON_TICK = 1e-6


@dataclass(frozen=True)
class JointMotion:
    """What is sent to an arm: all its joints at 1 kHz from rest to rest, and the opening.

    q, dq, ddq (N, joints) at times (N,) [s]; throw: where it comes from.
    """

    arm: Arm
    throw: Throw
    q: Array
    dq: Array
    ddq: Array

    @property
    def times(self) -> Array:
        """Sample times (N,) [s]."""
        return self.throw.samples.times

    @property
    def cycle(self) -> int:
        """The last sample at or before the opening command: it goes out in that cycle."""
        return math.floor(self.throw.command_time / TICK + ON_TICK)

    @property
    def fraction(self) -> float:
        """How much of that cycle has passed when the command is due, 0 to 1."""
        return max(self.throw.command_time / TICK - self.cycle, 0.0)


def joint_motion(path: str | Path) -> JointMotion:
    """The motion of an arm's plan, fit to be sent.

    InputError for what `read_plan` refuses, for a hand's plan, and for a motion that does
    not begin and end at rest, breaks a limit or throws elsewhere: files can be edited.
    """
    throw = read_plan(path)
    kinematics = throw.mover.kinematics
    if not isinstance(kinematics, PlanarArm):
        raise InputError(f"{path}: the plan's scene has no [robot], so there are no joints to send")
    values = joint_samples(kinematics, throw.target.azimuth, throw.samples)
    motion = JointMotion(kinematics.arm, throw, *values)
    wrong = _wrong(motion)
    if wrong:
        raise InputError(f"{path}: not sent, {wrong[0]}")
    return motion


def _wrong(motion: JointMotion) -> list[str]:
    """Why the motion must not be sent, in words."""
    throw, arm = motion.throw, motion.arm
    found = []
    for where, sample in (("begin", 0), ("end", -1)):
        for j in range(arm.joints):
            rate, acceleration = abs(motion.dq[sample, j]), abs(motion.ddq[sample, j])
            if not (rate <= REST[0] and acceleration <= REST[1]):
                found.append(f"the motion does not {where} at rest: joint {j + 1}")
    broken = broken_limits(throw.mover, throw.samples)
    found += [f"limit of {name} broken" for name in broken]
    low, high = np.array(arm.limits.position_min), np.array(arm.limits.position_max)
    outside = (motion.q[0] < low) | (motion.q[0] > high)
    found += [f"limit of joint {j + 1} position broken" for j in np.flatnonzero(outside)]
    found += _uneven(motion)
    if throw.command_time < -ON_TICK * TICK:
        found.append(f"the opening command would come {-1e3 * throw.command_time:.1f} ms too early")
    tolerance, (dx, dtheta) = throw.scene.tolerance, throw.miss()
    # NaN where it does not come down at all.
    if not max(abs(dx) / tolerance.position, abs(dtheta) / tolerance.angle) <= 1 + 1e-6:
        off = f"{1e3 * abs(dx):.2f} mm and {math.degrees(abs(dtheta)):.2f} deg off"
        found.append(f"the motion lands {off}")
    return found + [violation.words for violation in broken_terms(throw)]


def _uneven(motion: JointMotion) -> list[str]:
    """Joints whose positions, rates and accelerations are not those of one motion."""
    jerk, found = np.array(motion.arm.limits.jerk), []
    pairs = (("rates", motion.q, motion.dq, TICK / 4), ("accelerations", motion.dq, motion.ddq, 1))
    for name, values, rates, part in pairs:
        off = np.abs(np.diff(values, axis=0) / TICK - (rates[1:] + rates[:-1]) / 2)
        # What the jerk limit lets a motion do inside a tick, twice.
        most = part * jerk * TICK / 2 + 1e-6
        for j in np.flatnonzero((off > most).any(axis=0)):
            found.append(f"joint {j + 1}'s {name} do not fit the samples")
    return found
