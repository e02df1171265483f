"""What [uncertainty] does to a throw that breaks nothing: warnings, and its landing's spread."""

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

#: Number of throws that judge reserves and spread.
SAMPLES = 256
#: Codes that a plan keeps a reserve for. The scatter of the landing is left to sweeps.
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

    target: the one requested, which may move.
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
    words = "only one of sliding pivot and limit surface comes down to the target's height"
    if math.isfinite(x):
        words = (
            f"sliding pivot and limit surface land {1e3 * x:.1f} mm and "
            f"{math.degrees(abs(pivot.theta - surface.theta)):.1f} deg apart, more than the "
            f"tolerance of {1e3 * tolerance.position:g} mm and "
            f"{math.degrees(tolerance.angle):g} deg"
        )
    yield Finding(Code.MODELS_DIFFER, x, tolerance.position, broken=False, note=words)


def _reserves(throw: Throw, target: Pose) -> Iterator[Finding]:
    """What throws within the scene's [uncertainty] break, other than the tolerance."""
    scene = throw.scene
    if scene.uncertainty is None:
        return
    batch, values = _sampled(throw.in_scene(scene.without_clearances()), target)
    found = Judge(batch).verdicts(batch.fly(values), values)
    for code in RESERVED:
        share = float(np.mean(found.breaks(code)))
        if share > 0.0:
            used = "" if code is not Code.SLIP_BEFORE_OPENING else _grip(throw)
            note = f"of the throws that [uncertainty] allows {100 * share:.0f} % {code.fate}{used}"
            note += f": {code.cure}"
            yield Finding(Code.UNCERTAIN, share, 0.0, body=code.value, broken=False, note=note)


def _grip(throw: Throw) -> str:
    return f", of whose friction the plan uses {100 * throw.measured.grip.value:.0f} %"


def _sampled(throw: Throw, target: Pose) -> tuple[ThrowBatch, Array]:
    """Throws of one motion, and the values (N, P) of the scene's uncertain parameters."""
    sampler, mean = sampler_of(throw.scene, 0), throw.scene.mean_delay
    opening = throw.scene.gripper.profile().opening
    low, high = (end - mean for end in sampler.reach("delay", mean))
    reach = min(low, 0.0), max(high, 0.0), max(opening, sampler.reach("opening", opening)[1])
    return ThrowBatch.of(throw, target, sampler.names, reach), sampler.draw(0, SAMPLES)


def landing_spread(throw: Throw, target: Pose) -> float:
    """95 % quantile [m] of the pose error about the throw's own landing under the scene's
    uncertainty; infinite if so many never land. target: says whether theta counts."""
    batch, values = _sampled(throw, target)
    moved = batch.fly(values).landing - batch.fly(batch.nominal()).landing
    turn = 0.0 if target.theta is None else moved[:, 1]
    errors = throw.scene.object.pose_error(moved[:, 0], turn)
    known = np.where(np.isnan(errors), np.inf, errors)
    return float(np.quantile(known, 0.95, method="inverted_cdf"))
