"""What a throw breaks."""

from __future__ import annotations

from dataclasses import dataclass

from .in_space import AGREES, off_in_space
from .throw import FALLS, Throw

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
    against it, at its nodes. near: the body that needs rows against what is around it.
    """

    words: str
    guard: Guard = ""
    margin: Margin | None = None
    depth: float = 0.0
    between: bool = False
    then: Guard = ""
    near: str = ""


def throw_violations(throw: Throw) -> list[Violation]:
    """What a throw breaks in any scene: the kinematics in space, grip, release, way down."""
    found, use = [], throw.measured.grip if throw.lands else throw.grip_use
    if use > 1.0:
        words = f"slip before the opening (grip use {use:.2f})"
        found.append(Violation(words, guard="carry"))
    off = off_in_space(throw.mover, throw.samples, throw.target.plane.azimuth)
    if not off <= AGREES:
        words = f"the joints hold the hand {1e3 * off:.3g} mm off where the planar model has it"
        found.append(Violation(words))
    if throw.release.trouble:
        found.append(Violation(throw.release.trouble))
    if throw.lands and throw.landing.state.v_z > -FALLS:
        found.append(Violation("the object only grazes the target's height: where is not sure"))
    if not throw.lands:
        found.append(Violation("the object never comes down to the target's height"))
    return found
