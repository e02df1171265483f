"""Effects of [uncertainty] on a solved throw: warnings, and the spread of its landing."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ...models import Array
from ...models.release import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems import Pose
from ..throw import Throw, ThrowBatch
from .batch import Judge
from .findings import Code, Finding
from .uncertainty import sampler_of

#: Number of sampled throws for reserves and spread.
SAMPLES = 256
#: Codes of the limits with a reserve in a plan; sweeps judge the scatter of the landing.
RESERVED = (
    Code.SLIP_BEFORE_OPENING,
    Code.TORQUE,
    Code.FLOOR,
    Code.COLUMN,
    Code.PALM,
    Code.COLLISION,
    Code.RELEASE,
)


def warnings(throw: Throw, target: Pose) -> tuple[Finding, ...]:
    """Warnings about a solved throw.

    target: the requested one, which may move.
    """
    return (*_models(throw, target), *_reserves(throw, target))


def _models(throw: Throw, target: Pose) -> Iterator[Finding]:
    """A warning if sliding pivot and limit surface land farther apart than the tolerance."""
    tolerance = throw.scene.tolerance
    pivot, surface = (throw.with_model(model).landing for model in (SLIDING_PIVOT, STEPPED_SURFACE))
    x = abs(pivot.x - surface.x)
    theta = 0.0 if target.theta is None else abs(pivot.theta - surface.theta)
    if x <= tolerance.position and theta <= tolerance.angle:
        return
    words = "only one of sliding pivot and limit surface lands at the target's height"
    if math.isfinite(x):
        words = (
            f"sliding pivot and limit surface land {1e3 * x:.1f} mm and "
            f"{math.degrees(abs(pivot.theta - surface.theta)):.1f} deg apart, more than the "
            f"tolerance of {1e3 * tolerance.position:g} mm and "
            f"{math.degrees(tolerance.angle):g} deg"
        )
    yield Finding(Code.MODELS_DIFFER, x, tolerance.position, broken=False, note=words)


def _reserves(throw: Throw, target: Pose) -> Iterator[Finding]:
    """Warnings about limits, except the tolerance, that throws within [uncertainty] break."""
    scene = throw.scene
    if scene.uncertainty is None:
        return
    batch, values = _sample_throws(throw.in_scene(scene.without_clearances()), target)
    judged = Judge(batch).verdicts(batch.fly(values), values)
    for code in RESERVED:
        share = float(np.mean(judged.breaks(code)))
        if share > 0.0:
            used = "" if code is not Code.SLIP_BEFORE_OPENING else _grip(throw)
            note = f"under [uncertainty] {100 * share:.0f} % of the throws {code.fate}{used}"
            note += f": {code.cure}"
            yield Finding(Code.UNCERTAIN, share, 0.0, body=code.value, broken=False, note=note)


def _grip(throw: Throw) -> str:
    return f"; the plan uses {100 * throw.measured.grip.value:.0f} % of the friction limit"


def _sample_throws(throw: Throw, target: Pose) -> tuple[ThrowBatch, Array]:
    """Throws of one motion, and the values (N, P) of the scene's uncertain parameters."""
    sampler, mean = sampler_of(throw.scene, 0), throw.scene.mean_delay
    opening = throw.scene.gripper.profile().opening
    low, high = (end - mean for end in sampler.reach("delay", mean))
    reach = min(low, 0.0), max(high, 0.0), max(opening, sampler.reach("opening", opening)[1])
    return ThrowBatch.of(throw, target, sampler.names, reach), sampler.draw(0, SAMPLES)


def landing_spread(throw: Throw, target: Pose) -> float:
    """95 % quantile [m] of the pose error (position plus angle times half the length) about the
    throw's own landing under the scene's uncertainty; infinite if over 5 % never land.

    target: theta counts if it fixes it.
    """
    batch, values = _sample_throws(throw, target)
    change = batch.fly(values).landing - batch.fly(batch.nominal()).landing
    turn = 0.0 if target.theta is None else change[:, 1]
    errors = throw.scene.object.pose_error(change[:, 0], turn)
    finite_errors = np.where(np.isnan(errors), np.inf, errors)
    return float(np.quantile(finite_errors, 0.95, method="inverted_cdf"))
