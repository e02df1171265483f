"""The next motion for a throw, from what the arm did of the last one.

Iterative learning on the reference: how the joints follow is fitted to the recording, and what
that does not explain is taken to come again. The motion to send is then a quadratic program over
the coefficients of splines: the throw that will be measured lands at its target, its joints move
nearly as planned while the pads open, and what is sent keeps the limits. It may begin earlier and
elsewhere than the plan's: an arm that lags needs a longer run-up.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from ...models import Array, PlanarArm
from ...problems import InputError
from ..check import Samples, Throw, broken_limits
from ..ocp import broken as broken_terms
from ..result import joint_samples
from .controllers import JointMotion
from .lesson import Lesson
from .recording import Recording

#: Rounds of the program at most, how far the first goes, and by what share the cost must fall.
ROUNDS, STEP, LEAST = 30, 1.0, 1e-3
#: A landing so near [m, scaled error] is near enough; another is sent only where it is expected so
#: many times nearer than the last.
ENOUGH, NEARER = 4e-4, 0.7


@dataclass(frozen=True, eq=False)
class Proposal:
    """off: landing off the target, 1 is near enough; wrong: why it must not be sent, in words."""

    sent: Throw
    expected: Throw
    off: float
    wrong: list[str]

    @classmethod
    def of(cls, lesson: Lesson, coefficients: Array) -> Proposal:
        """What is sent, and what is expected of it."""
        expected = lesson.throw(coefficients)
        samples = Samples(*(basis @ coefficients for basis in lesson.basis))
        sent = dataclasses.replace(expected, path=samples.path, samples=samples)
        return cls(sent, expected, _off(expected), _wrong(sent, expected))

    @property
    def good(self) -> bool:
        """Whether nothing needs to be better."""
        return not self.wrong and self.off <= 1.0


def corrected(plan: JointMotion, recording: Recording) -> tuple[JointMotion, Throw]:
    """The motion to send next, by the recording of one that was sent for the same plan.

    Also the throw that it is expected to be. InputError where no motion within the limits is found
    that lands nearer, and where that throw breaks what the scene asks.
    """
    lesson, found = Lesson.of(plan.throw, recording), list[Proposal]()
    for start in sorted(lesson.starts(), key=lesson.cost):
        found += _rounds(lesson, start)
        if found[-1].good:
            break
    best = min(found, key=lambda each: (bool(each.wrong), each.off))
    nearest = min(found, key=lambda each: each.off)
    thrown = recording.throw(plan.throw)
    if best.wrong or not best.off < max(NEARER * _off(thrown), 1.0):
        # What is in the way of the one that would land nearest.
        reason = (nearest.wrong or best.wrong or ["it would land no nearer than the last"])[0]
        raise InputError(f"the corrected motion is not sent: {reason}")
    sent = best.sent
    assert isinstance(sent.mover.kinematics, PlanarArm)
    values = joint_samples(sent.mover.kinematics, sent.target.plane.azimuth, sent.samples)
    return JointMotion(plan.arm, sent, *values), best.expected


def _rounds(lesson: Lesson, near: Array) -> list[Proposal]:
    """Motions from one on, each better than the one before it; the last is good if any is."""
    found, cost, step = [Proposal.of(lesson, near)], lesson.cost(near), STEP
    for _ in range(ROUNDS):
        if found[-1].good:
            break
        trial, promised = lesson.better(near, step)
        if cost - promised < LEAST * cost:
            break
        now = lesson.cost(trial)
        # As much better as promised, or the promise was made for too far.
        share = (cost - now) / (cost - promised)
        step *= 0.4 if share < 0.25 else 2.0 if share > 0.75 else 1.0
        if share > 0.0:
            near, cost = trial, now
            found.append(Proposal.of(lesson, near))
    return found


def _off(throw: Throw) -> float:
    """How far off the target a throw lands, by its scaled error (39) over ENOUGH [m]."""
    dx, dtheta = throw.miss()
    off = (abs(dx) + abs(dtheta) * throw.scene.object.length / 2) / ENOUGH
    return off if math.isfinite(off) else math.inf


def _wrong(sent: Throw, expected: Throw) -> list[str]:
    """Why a motion must not be sent, in words."""
    found = [f"limit of {name} broken" for name in broken_limits(sent.mover, sent.samples)]
    most, speed = sent.scene.tool_speed, sent.measured.speed
    if most is not None and speed > most:
        found.append(f"tool speed: {speed:.3f} m/s, at most {most:g}")
    return found + [violation.words for violation in broken_terms(expected)]
