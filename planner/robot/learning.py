"""The next motion for a throw, learnt from the recording of the last one.

Iterative learning control on the reference: a response of the joints is fitted to the recording;
the rest is a disturbance that is expected again. A quadratic program over spline coefficients then
finds the motion to send: the measured throw lands at its target, its joints move nearly as planned
while the pads open, and the sent motion keeps the limits. It may begin earlier and elsewhere than
the plan's: an arm that lags needs a longer run-up.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from ...models import Array
from ...models.robot import PlanarArm
from ...problems import InputError
from ..planner import Planner
from ..result import joint_samples
from ..throw import Samples, Throw
from ..verdict import Code, Finding, Verdict, verdict
from .controllers import JointMotion
from .learning_control import LearningControl
from .recording import Recording


@dataclass(frozen=True)
class LearningSettings:
    """Settings of a correction.

    rounds: quadratic programs, at most; step: length of the first step in the
    weights of the program; min_gain: share by which the predicted cost must fall for another round.
    palm_clearance [m]: added to a plan whose correction collides with the hand.
    accurate [m]: pose error (position plus angle times half the length) that needs no correction;
    progress: a correction is sent if its expected error is below this share of the last throw's.
    """

    rounds: int = 30
    step: float = 1.0
    min_gain: float = 1e-3
    palm_clearance: float = 0.01
    accurate: float = 4e-4
    progress: float = 0.7


LEARNING = LearningSettings()


@dataclass(frozen=True, eq=False)
class Proposal:
    """A motion to send and the throw expected of it.

    error: its pose error over `LearningSettings.accurate`; verdict: on whether it may be sent.
    """

    sent: Throw
    expected: Throw
    error: float
    verdict: Verdict

    @classmethod
    def of(cls, control: LearningControl, coefficients: Array) -> Proposal:
        """The motion of spline coefficients."""
        expected = control.throw(coefficients)
        samples = Samples(*(basis @ coefficients for basis in control.basis))
        sent = dataclasses.replace(expected, path=samples.path, samples=samples)
        # The next recording corrects the landing error, so that does not forbid sending.
        judged = verdict(expected, sent=sent).without(Code.LANDING)
        return cls(sent, expected, _error(expected), judged)

    @property
    def good(self) -> bool:
        """Whether it may be sent and needs no further round."""
        return self.verdict.ok and self.error <= 1.0


def corrected(plan: JointMotion, recording: Recording) -> tuple[JointMotion, Throw]:
    """The motion to send next, by the recording of one that was sent for the same plan.

    Also the throw that is expected of it. If the bar would collide with the hand, which lags, a
    plan with more palm clearance is corrected instead. InputError if no motion within the limits
    lands nearer, or if the expected throw breaks a limit of the scene.
    """
    best, reason = _proposal(plan.throw, recording)
    if reason is not None and reason.code is Code.PALM:
        roomier = _roomier(plan.throw)
        best, reason = (best, reason) if roomier is None else _proposal(roomier, recording)
    if reason is not None:
        words = "it would land no nearer than the last"
        words = words if reason.code is Code.LANDING else reason.words
        raise InputError(f"the corrected motion is not sent: {words}")
    sent = best.sent
    assert isinstance(sent.manipulator.kinematics, PlanarArm)
    values = joint_samples(sent.manipulator.kinematics, sent.target.plane.azimuth, sent.samples)
    return JointMotion(plan.arm, sent, *values), best.expected


def _roomier(plan: Throw) -> Throw | None:
    """Another throw to the target, planned with more palm clearance."""
    scene = plan.scene
    assert scene.workspace is not None and scene.workspace.palm_clearance is not None
    clearance = scene.workspace.palm_clearance + LEARNING.palm_clearance
    workspace = dataclasses.replace(scene.workspace, palm_clearance=clearance)
    found = Planner(scene.replace(workspace=workspace)).plan(plan.target)
    if not found.solved or found.throw is None:
        return None
    return dataclasses.replace(found.throw.deciding, scene=scene)


def _proposal(plan: Throw, recording: Recording) -> tuple[Proposal, Finding | None]:
    """The best motion to send for a throw, and the finding that forbids it, None if it may be sent.

    A finding LANDING: it would land no nearer than the last throw.
    """
    control = LearningControl.of(plan, recording)
    found = _rounds(control, control.start())
    best = min(found, key=lambda each: (not each.verdict.ok, each.error))
    nearest = min(found, key=lambda each: each.error)
    allowed = max(LEARNING.progress * _error(recording.throw(plan)), 1.0)
    if best.verdict.ok and best.error < allowed:
        return best, None
    # The limits that the nearest landing breaks are the reason.
    farther = Finding(
        Code.LANDING, LEARNING.accurate * best.error, LEARNING.accurate * allowed, body="position"
    )
    return best, (*nearest.verdict.broken, *best.verdict.broken, farther)[0]


def _rounds(control: LearningControl, point: Array) -> list[Proposal]:
    """Motions of falling cost by sequential quadratic programs, until one is good."""
    found, cost, step = [Proposal.of(control, point)], control.cost(point), LEARNING.step
    for _ in range(LEARNING.rounds):
        if found[-1].good:
            break
        trial, predicted = control.step_from(point, step)
        if cost - predicted < LEARNING.min_gain * cost:
            break
        now = control.cost(trial)
        # The trust region shrinks if the cost falls by much less than predicted.
        share = (cost - now) / (cost - predicted)
        step *= 0.4 if share < 0.25 else 2.0 if share > 0.75 else 1.0
        if share > 0.0:
            point, cost = trial, now
            found.append(Proposal.of(control, point))
    return found


def _error(throw: Throw) -> float:
    """Pose error of a landing over `LearningSettings.accurate`; infinite without a landing."""
    dx, dtheta = throw.miss()
    error = throw.scene.object.pose_error(dx, dtheta) / LEARNING.accurate
    return error if math.isfinite(error) else math.inf
