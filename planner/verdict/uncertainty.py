"""[uncertainty]: samples of the uncertain parameters, and what they make of a solved throw."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...models import Array, ReadOnly
from ...models.release import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems import Distribution, Pose, Scene, Uncertainty
from ..throw import Throw, ThrowBatch
from .batch import Judge
from .findings import Code, Finding

#: Half a cell of SciPy's 30-bit sequence; added to a share it excludes 0 and 1.
HALF_CELL = 2.0**-31
#: Standard deviations in the range of a normal value; one draw in 10^19 is outside.
COVERED = 9.0
#: Names of parameters with their factor from SI and unit; all others are lengths or angles.
UNITS = (
    (("hand_vx", "hand_vz"), 1e3, "mm/s"),
    (("hand_omega",), math.degrees(1.0), "deg/s"),
    (("delay", "opening"), 1e3, "ms"),
    (("friction",), 1.0, ""),
    (("mass",), 1e3, "g"),
    (("inertia",), 1e6, "kg mm²"),
)
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


@dataclass(frozen=True)
class Sampler(ReadOnly):
    """Draws of the uncertain parameters `names`; sample k depends on the seed only.

    spreads: their distributions in SI units; ranges: lowest and highest possible values,
    where normal ones are cut off; factor (P, P): Cholesky factor of the normal scores'
    correlation, None for independent parameters.
    """

    names: tuple[str, ...]
    spreads: tuple[Distribution, ...]
    ranges: tuple[tuple[float, float], ...]
    factor: Array | None
    seed: int

    def draw(self, first: int, count: int) -> Array:
        """Samples `first` to `first + count` of the sequence: (count, P), columns as `names`."""
        from scipy.special import ndtr, ndtri
        from scipy.stats import qmc

        sequence = qmc.Sobol(len(self.names), rng=np.random.default_rng(self.seed))
        if first:
            sequence.fast_forward(first)
        # SciPy warns of draws other than powers of two; the first values of a longer draw are
        # equal.
        shares = sequence.random(1 << max(count - 1, 0).bit_length())[:count] + HALF_CELL
        if self.factor is not None:
            shares = ndtr(ndtri(shares) @ self.factor.T)
        columns = [
            quantile(spread, share, bounds)
            for spread, share, bounds in zip(self.spreads, shares.T, self.ranges, strict=True)
        ]
        return np.column_stack(columns)

    def quantiles(self, name: str, shares: Array) -> Array:
        """Values of a parameter below which `shares` (N,) of it lie."""
        i = self.names.index(name)
        return quantile(self.spreads[i], shares, self.ranges[i])

    def reach(self, name: str, value: float) -> tuple[float, float]:
        """Lowest and highest value that is drawn; `value` where the parameter is certain."""
        if name not in self.names:
            return value, value
        spread = self.spreads[self.names.index(name)]
        more = COVERED * (spread.normal or 0.0)
        return spread.reach[0] - more, spread.reach[1] + more

    def openings(self, scene: Scene) -> tuple[float, float, float]:
        """The earliest and the latest opening [s] beside the mean delay, and the longest one."""
        mean, opening = scene.mean_delay, scene.gripper.profile().opening
        low, high = self.reach("delay", mean)
        return low - mean, high - mean, max(opening, self.reach("opening", opening)[1])


def sampler_of(scene: Scene, seed: int) -> Sampler:
    """Draws of the scene's [uncertainty], or of the default one."""
    section = scene.uncertainty or Uncertainty.USUAL
    spreads, ranges = section.about(scene.values), scene.ranges
    return Sampler(
        section.names,
        tuple(spreads.values()),
        tuple(ranges[name] for name in spreads),
        np.asarray(np.linalg.cholesky(section.matrix), float) if section.correlation else None,
        seed,
    )


def quantile(spread: Distribution, shares: Array, bounds: tuple[float, float]) -> Array:
    """Values of a distribution below which `shares` (N,) of it lie; normal ones cut off."""
    from scipy.special import ndtr, ndtri

    if spread.samples:
        ordered = np.sort(np.array(spread.samples))
        return np.asarray(ordered[np.minimum(shares * ordered.size, ordered.size - 1).astype(int)])
    mean = spread.expected
    if spread.uniform is not None:
        return np.asarray(mean + spread.uniform * (2.0 * shares - 1.0))
    deviation = spread.deviation
    low, high = (float(ndtr((bound - mean) / deviation)) for bound in bounds)
    values = mean + deviation * ndtri(low + shares * (high - low))
    return np.asarray(np.clip(values, *bounds))


def words_of(section: Uncertainty) -> list[str]:
    """The uncertain parameters as text: one line each, in the units of the file."""
    lines = []
    for name in section.names:
        spread: Distribution = getattr(section, name)
        unit = np.degrees(1.0) if Uncertainty.PARAMETERS[name].degrees else 1.0
        times = " x the scene's" if spread.relative else ""
        if spread.uniform is not None:
            words = f"uniform +-{unit * spread.uniform:g}{times}"
        elif spread.normal is not None:
            words = f"normal, deviation {unit * spread.normal:g}{times}"
        else:
            words = f"{len(spread.samples)} given values{times}"
        about = "" if spread.mean is None else f" about {unit * spread.mean:g}"
        lines.append(f"{Uncertainty.PARAMETERS[name].key}: {words}{about}")
    return lines


def unit_of(name: str) -> tuple[float, str]:
    """Factor and unit in which people read a parameter."""
    for names, factor, unit in UNITS:
        if name in names:
            return factor, unit
    return (math.degrees(1.0), "deg") if Uncertainty.PARAMETERS[name].degrees else (1e3, "mm")


def warnings(throw: Throw, target: Pose, robust: bool = False) -> tuple[Finding, ...]:
    """Warnings about a solved throw.

    target: the requested one, which may move; robust: whether a robust throw was looked for.
    """
    return (*_models(throw, target), *_reserves(throw, target, robust))


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


def _reserves(throw: Throw, target: Pose, robust: bool) -> Iterator[Finding]:
    """Warnings about limits, except the tolerance, that throws within [uncertainty] break."""
    # A robust plan does not go with a target that moves.
    first = "" if robust or not target.at_rest else "plan with --robust auto, "
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
                use = 100 * throw.measured.grip.value
                note += f"; the plan uses {use:.0f} % of the friction limit"
            note += f": {first}{code.cure}"
            yield Finding(Code.UNCERTAIN, share, 0.0, body=code.value, broken=False, note=note)


def sample_throws(
    throw: Throw, target: Pose, count: int = SAMPLES, seed: int = 0
) -> tuple[Judge, Array]:
    """A judge of one motion's throws, and values (count, P) of the uncertain parameters."""
    sampler = sampler_of(throw.scene, seed)
    early, late, longest = sampler.openings(throw.scene)
    reach = min(early, 0.0), max(late, 0.0), longest
    batch = ThrowBatch.of(throw, target, sampler.names, reach)
    return Judge.of_success(batch), sampler.draw(0, count)


def landing_spread(throw: Throw, target: Pose) -> float:
    """95 % quantile [m] of the pose error (position plus angle times half the length) about the
    throw's own landing under the scene's uncertainty; infinite if over 5 % never land.

    target: theta counts if it fixes it.
    """
    judge, values = sample_throws(throw, target)
    batch = judge.batch
    change = batch.fly(values).landing - batch.fly(batch.nominal()).landing
    turn = 0.0 if target.theta is None else change[:, 1]
    errors = throw.scene.object.pose_error(change[:, 0], turn)
    finite_errors = np.where(np.isnan(errors), np.inf, errors)
    return float(np.quantile(finite_errors, 0.95, method="inverted_cdf"))
