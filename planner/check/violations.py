"""What a throw breaks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
import numpy.typing as npt

from ...models import PlanarArm, PlanarDynamics, pivot_wrench
from .sending import TICK
from .throw import Throw

Array = npt.NDArray[np.float64]

#: Name of rows that an NLP leaves out until the check has seen that they are needed.
Guard = str


@dataclass(frozen=True)
class Margin:
    """A distance [m] or share of a limit that an NLP keeps beyond its usual one, where the check
    found that it takes more: what was missing and `more`, `most` in all."""

    name: str
    more: float
    most: float


@dataclass(frozen=True)
class Violation:
    """What is broken, in words; what the NLP can do about it beyond what it does at first.

    guard: rows that it leaves out at first, "" for none; then: the guard after that one. margin,
    depth [m; share of a limit]: what is too small, and by how much. between: every NLP has rows
    against it, at its nodes.
    """

    words: str
    guard: Guard = ""
    margin: Margin | None = None
    depth: float = 0.0
    between: bool = False
    then: Guard = ""


def throw_violations(throw: Throw) -> list[Violation]:
    """What a throw breaks in any scene: the grip, the release, the way down."""
    found, use = [], throw.measured.grip if throw.lands else throw.grip_use
    if use > 1.0:
        words = f"slip before the opening (grip use {use:.2f})"
        found.append(Violation(words, guard="carry"))
    if throw.release.trouble:
        found.append(Violation(throw.release.trouble))
    if not throw.lands:
        found.append(Violation("the object never comes down to the target's height"))
    return found


def torque_use(throw: Throw) -> tuple[Array, Array]:
    """Times (N,) [s] and torques over their limits (N, n), the larger with and without load.

    The object is held until the opening starts; while the pads open the hand may bear all
    of it or nothing; after that its hand is empty.
    """
    scene, kinematics = throw.scene, throw.mover.kinematics
    assert scene.torque is not None and isinstance(kinematics, PlanarArm)
    limits = scene.torque.of(kinematics.arm, kinematics.throwing_joints)
    times = np.arange(0.0, throw.until + TICK / 2, TICK)
    hand = throw.hand(times)
    theta, h = hand.pose[2] + scene.grasp.angle, scene.com_offset
    x, z = h * np.cos(theta), h * np.sin(theta)
    wrench = pivot_wrench(scene.body, scene.gravity, hand.motion, hand.twist[2], x, z)
    angles, rates, turns = map(kinematics.turned, throw.path.at(times))
    torques = partial(_dynamics(kinematics).torques, angles, rates, turns, scene.gravity)
    held, free = (np.abs(np.array(torques(load)).T) for load in (wrench, None))
    before, after = (times < throw.opening_time)[:, None], (times > throw.detach_time)[:, None]
    most = np.where(before, held, np.where(after, free, np.maximum(held, free)))
    return times, np.asarray(most / np.array(limits))


@lru_cache(maxsize=8)
def _dynamics(kinematics: PlanarArm) -> PlanarDynamics:
    return PlanarDynamics(kinematics)
