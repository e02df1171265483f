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
from ..plan import Planner
from ..result import joint_samples
from .controllers import JointMotion
from .lesson import Lesson
from .recording import Recording

#: Rounds of the program at most, how far the first goes, and by what share the cost must fall.
ROUNDS, STEP, LEAST = 30, 1.0, 1e-3
#: Clearance [m] from the palm beyond the scene's of a plan whose correction meets the hand.
ROOM = 0.01
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
    that lands nearer, and where that throw breaks what the scene asks. Where the bar would meet the
    hand, which lags, another throw to the target is tried, one that leaves the palm earlier.
    """
    best, reason = _proposal(plan.throw, recording)
    if reason.startswith("palm"):
        roomier = _roomier(plan.throw)
        best, reason = (best, reason) if roomier is None else _proposal(roomier, recording)
    if reason:
        raise InputError(f"the corrected motion is not sent: {reason}")
    sent = best.sent
    assert isinstance(sent.mover.kinematics, PlanarArm)
    values = joint_samples(sent.mover.kinematics, sent.target.plane.azimuth, sent.samples)
    return JointMotion(plan.arm, sent, *values), best.expected


def _roomier(plan: Throw) -> Throw | None:
    """Another throw to its target, planned with more clearance from the palm."""
    scene = plan.scene
    assert scene.workspace is not None and scene.workspace.palm_clearance is not None
    clearance = scene.workspace.palm_clearance + ROOM
    workspace = dataclasses.replace(scene.workspace, palm_clearance=clearance)
    found = Planner(scene.replace(workspace=workspace)).plan(plan.target)
    if not found.solved or found.throw is None:
        return None
    return dataclasses.replace(found.throw.final, scene=scene)


def _proposal(plan: Throw, recording: Recording) -> tuple[Proposal, str]:
    """The best motion to send for a throw, and why it must not be sent; empty: it may."""
    lesson, found = Lesson.of(plan, recording), list[Proposal]()
    for start in sorted(lesson.starts(), key=lesson.cost):
        found += _rounds(lesson, start)
        if found[-1].good:
            break
    best = min(found, key=lambda each: (bool(each.wrong), each.off))
    nearest = min(found, key=lambda each: each.off)
    if not best.wrong and best.off < max(NEARER * _off(recording.throw(plan)), 1.0):
        return best, ""
    # What is in the way of the one that would land nearest.
    return best, (nearest.wrong or best.wrong or ["it would land no nearer than the last"])[0]


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
