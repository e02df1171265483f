"""What [uncertainty] makes of a solved throw: warnings, and the spread of its landings."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ...models import Array
from ...models.release import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems import Pose
from ..throw import Throw, ThrowBatch
from ..verdict import Code, Finding, Judge, measures_of
from .sampler import sampler_of

#: Number of sampled throws for reserves and spread.
SAMPLES = 256
#: The same of the comparison of a throw with its quiet one.
SPREAD = 64
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


def warnings(throw: Throw, target: Pose, robust: bool = False) -> tuple[Finding, ...]:
    """Warnings about a solved throw.

    target: the requested one, which may move; robust: whether a robust throw was looked for.
    """
    return (*_models(throw, target), *_reserves(throw, target, robust))


def _models(throw: Throw, target: Pose) -> Iterator[Finding]:
    """A warning if sliding pivot and limit surface land farther apart than the tolerance."""
    tolerance = throw.scene.tolerance
    if throw.scene.release is not None:
        return
    pivot, surface = (throw.with_model(model).landing for model in (SLIDING_PIVOT, STEPPED_SURFACE))
    x = abs(pivot.x - surface.x)
    theta = 0.0 if target.theta is None else abs(pivot.theta - surface.theta)
    if x <= tolerance.position and theta <= tolerance.angle:
        return
    words = "only one of sliding pivot and limit surface lands at the target's height"
    if math.isfinite(x):
        allowed = [f"{1e3 * tolerance.position:g} mm"] if x > tolerance.position else []
        if theta > tolerance.angle:
            allowed.append(f"{math.degrees(tolerance.angle):g} deg")
        words = (
            f"sliding pivot and limit surface land {1e3 * x:.1f} mm and "
            f"{math.degrees(abs(pivot.theta - surface.theta)):.1f} deg apart, more than the "
            f"tolerance of {' and '.join(allowed)}"
        )
    if x <= tolerance.position:
        value, limit, body = theta, tolerance.angle, "angle"
    else:
        value, limit, body = x, tolerance.position, "position"
    yield Finding(Code.MODELS_DIFFER, value, limit, body=body, broken=False, note=words)


def _reserves(throw: Throw, target: Pose, robust: bool) -> Iterator[Finding]:
    """Warnings about limits, except the tolerance, that throws within [uncertainty] break."""
    # A robust plan does not go with a target that moves.
    first = "" if robust or not target.is_fixed else "plan with --robust, "
    scene = throw.scene
    if scene.uncertainty is None:
        return
    judge, values = sample_throws(throw, target)
    judged = judge.verdicts(values)
    for code in RESERVED:
        share = float(np.mean(judged.breaks(code)))
        if share > 0.0:
            few = f"{100 * share:.0f} %" if share >= 0.005 else "less than 1 %"
            note = f"under [uncertainty] {few} of the throws {code.fate}"
            if code is Code.SLIP_BEFORE_OPENING:
                use = 100 * float(measures_of(throw).value("grip")[0])
                note += f"; the plan uses {use:.0f} % of the friction limit"
            note += f": {first}{code.cure}"
            yield Finding(Code.UNCERTAIN, share, 0.0, body=code.value, broken=False, note=note)


def spread(throw: Throw, target: Pose) -> float:
    """95 % pose error [m] of a throw about its own landing, over `SPREAD` samples of what is
    uncertain; inf where more never land."""
    judge, values = sample_throws(throw, target, SPREAD)
    batch = judge.batch
    (x, theta, _), own = batch.fly(values).landing.T, batch.fly(batch.nominal()).landing[0]
    turn = theta - own[1] if target.theta is not None else 0.0
    errors = np.nan_to_num(throw.scene.object.pose_error(x - own[0], turn), nan=math.inf)
    return float(np.sort(errors)[math.ceil(0.95 * SPREAD) - 1])


def sample_throws(
    throw: Throw, target: Pose, count: int = SAMPLES, seed: int = 0
) -> tuple[Judge, Array]:
    """A judge of one motion's throws, and values (count, P) of the uncertain parameters."""
    sampler = sampler_of(throw.scene, seed)
    early, late, longest = sampler.openings(throw.scene)
    reach = min(early, 0.0), max(late, 0.0), longest
    batch = ThrowBatch.of(throw, target, sampler.names, reach)
    return Judge.of_success(batch), sampler.draw(0, count)
