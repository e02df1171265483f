"""Limits on a motion alone, whatever object it throws."""

from __future__ import annotations

from collections.abc import Iterator

from ...problems import Scene
from ..throw import Manipulator, Samples, excesses
from .clearance import Clearance, CollisionScene, held_bar
from .findings import JOINT_LIMITS, Code, Finding, Verdict

#: Allowed violation [m] of a clearance: covers rounding.
NEAR = 1e-6
#: Name of the bar after detach, among bodies.
FLYING = "flying bar"


def joint_findings(manipulator: Manipulator, samples: Samples) -> Iterator[Finding]:
    """Limits of the joints that samples break; there may be none."""
    for excess in excesses(manipulator, samples) if len(samples.q) else ():
        yield Finding(
            JOINT_LIMITS[excess.kind], excess.value, excess.limit, excess.time, excess.joint
        )


def held_verdict(scene: Scene, manipulator: Manipulator, samples: Samples, first: int) -> Verdict:
    """The verdict on a motion that keeps the object in the hand.

    It covers joint limits, and from sample `first` on collisions with obstacles, floor and the arm.
    """
    q, times = samples.q[first:].T, samples.times[first:]
    bar = held_bar(scene, manipulator.motion(q, 0 * q, 0 * q)[0])
    surroundings = CollisionScene.of(scene, manipulator)
    clearances = surroundings.clearances(surroundings.bodies_at(times, q, bar))
    return Verdict((*joint_findings(manipulator, samples), *map(collision, clearances)))


def collision(pair: Clearance) -> Finding:
    """The finding about two bodies that are too close to each other."""
    body = FLYING if pair.flying else pair.body
    other = pair.other if pair.thing is None else pair.thing.words
    distance = pair.clearance - pair.penetration
    return Finding(Code.COLLISION, distance, pair.clearance, pair.time, body, other)
