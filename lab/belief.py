"""Beliefs about the contact, and their conversion from and to scenes.

A belief is a normal distribution over logarithms. A scene's [contact] and [uncertainty] are a
prior; a posterior becomes a scene's [contact] and [uncertainty].
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..models import Array, ReadOnly
from ..problems import Contact, Distribution, Scene, Uncertainty, toml_lines
from .predict import BASE, UNKNOWNS, parameter_sets
from .throws import Shared

#: Standard deviations that a scene does not give: relative ones, and the delay's [s]. The radius of
#: real sliders was off by -29 to 19 % from geometry (the report, friction laws on real pushes).
ASSUMED = {"friction": 0.4, "patch_radius": 0.25, "delay": 0.01, "grip_scale": 0.1}


@dataclass(frozen=True)
class Belief(ReadOnly):
    """Mean (P,) and covariance (P, P) of the unknowns `names`.

    friction, patch_radius [m] and grip_scale by their natural logarithms, delay in seconds.
    """

    names: tuple[str, ...]
    mean: Array
    covariance: Array

    def value(self, name: str) -> float:
        """The unknown at the mean (the median of a logarithm); its fixed value if not fitted."""
        return self.values()[name] if name in self.names else BASE[name]

    def values(self) -> dict[str, float]:
        """All unknowns at the mean, SI units."""
        return {
            name: float(number if name == "delay" else np.exp(number))
            for name, number in zip(self.names, self.mean, strict=True)
        }

    def deviation(self, name: str) -> float:
        """Standard deviation: of the logarithm (relative), of the delay [s]; 0 if not fitted."""
        if name not in self.names:
            return 0.0
        i = self.names.index(name)
        return math.sqrt(max(float(self.covariance[i, i]), 0.0))

    def correlation(self, one: str, other: str) -> float:
        """Correlation of two unknowns."""
        both = self.deviation(one) * self.deviation(other)
        i, j = self.names.index(one), self.names.index(other)
        return float(self.covariance[i, j]) / both if both else 0.0

    @property
    def product(self) -> float:
        """mu r_p [m] at the measured grip force: a release depends on it most."""
        return float(np.exp(self._factors @ self.mean))

    @property
    def product_deviation(self) -> float:
        """Standard deviation of the product's logarithm (relative)."""
        return math.sqrt(max(float(self._factors @ self.covariance @ self._factors), 0.0))

    @property
    def product_interval(self) -> Array:
        """Ends (2,) [m] of the product's 95 % interval."""
        return self.product * np.exp(1.96 * self.product_deviation * np.array([-1.0, 1.0]))

    @property
    def _factors(self) -> Array:
        """1 for each factor of the product, which all unknowns are but the delay (P,)."""
        return np.array([float(name != "delay") for name in self.names])

    @property
    def effective(self) -> Belief:
        """The belief with the grip force's scale included in the friction: they act alike."""
        if "grip_scale" not in self.names:
            return self
        names = tuple(name for name in self.names if name != "grip_scale")
        fold = np.array([[float(one == other) for other in self.names] for one in names])
        fold[names.index("friction"), self.names.index("grip_scale")] = 1.0
        return Belief(names, fold @ self.mean, fold @ self.covariance @ fold.T)

    def ellipse(self) -> Array:
        """Outline (121, 2) of the 95 % region of friction and patch_radius [m]."""
        quantile = 5.991  # of chi-squared with two degrees of freedom
        pair = [self.names.index("friction"), self.names.index("patch_radius")]
        factor = np.linalg.cholesky(self.covariance[np.ix_(pair, pair)] + 1e-18 * np.eye(2))
        turn = np.linspace(0.0, 2 * np.pi, 121)
        circle = np.sqrt(quantile) * np.array([np.cos(turn), np.sin(turn)])
        return np.asarray(np.exp(self.mean[pair][:, None] + factor @ circle).T)

    def to_dict(self) -> dict[str, Any]:
        """As JSON, SI units; deviations of all but the delay are relative."""
        found: dict[str, Any] = {
            name: {"value": value, "deviation": self.deviation(name)}
            for name, value in self.values().items()
        }
        found["product"] = {"value": self.product, "deviation": self.product_deviation}
        found["covariance"] = self.covariance.tolist()
        return found


def sets_at(names: tuple[str, ...], points: Array) -> Array:
    """Parameter sets (M, 4) of points (M, P): logarithms, delays in seconds, as in a belief."""
    columns: dict[str, Any] = dict(BASE)
    for name, column in zip(names, np.atleast_2d(points).T, strict=True):
        columns[name] = column if name == "delay" else np.exp(column)
    return parameter_sets(*(columns[name] for name in UNKNOWNS))


def prior_of(scene: Scene, names: tuple[str, ...]) -> Belief:
    """A belief of the unknowns from a scene's [contact], and its [uncertainty] if it has one.

    Deviations that the scene does not give are 40 % (friction), 25 % (patch_radius), 10 ms (delay)
    and 10 % (the grip force's scale).
    """
    section = scene.uncertainty or Uncertainty(delay=Distribution(normal=ASSUMED["delay"]))
    mean, deviations = [], []
    for name in names:
        spread = None if name == "grip_scale" else getattr(section, name)
        value, deviation = BASE.get(name) or scene.values.get(name, 0.0), ASSUMED[name]
        if spread is not None:
            about = spread.about(scene.values[name])
            value, deviation = about.expected, about.deviation
            if name != "delay" and about.samples:
                logs = np.log(about.samples)
                value, deviation = math.exp(logs.mean()), float(logs.std())
            elif name != "delay":
                deviation /= value
        mean.append(value if name == "delay" else math.log(value))
        deviations.append(max(deviation, 1e-6))
    pairs = [(a, b, number) for a, b, number in section.correlation if {a, b} <= set(names)]
    matrix = Uncertainty.matrix_of(names, pairs)
    return Belief(names, np.array(mean), matrix * np.outer(deviations, deviations))


def applied(belief: Belief, scene: Scene) -> Scene:
    """The scene with the belief as its [contact] and in its [uncertainty].

    The grip force's scale acts as a friction and is included there. Other entries of the scene's
    [uncertainty] stay.
    """
    known = belief.effective
    contact = dataclasses.replace(
        scene.contact, friction=known.value("friction"), patch_radius=known.value("patch_radius")
    )
    old = scene.uncertainty
    given = {name: getattr(old, name, None) for name in Uncertainty.PARAMETERS}
    spreads = {name: spread for name, spread in given.items() if spread is not None}
    pairs = [] if old is None else [p for p in old.correlation if not {*p[:2]} & {*known.names}]
    own = uncertainty_of(belief)
    spreads |= {name: getattr(own, name) for name in own.names}
    section = Uncertainty(**spreads, correlation=(*pairs, *own.correlation))
    return scene.replace(contact=contact, uncertainty=section)


def uncertainty_of(belief: Belief) -> Uncertainty:
    """The belief as a section [uncertainty], about the scene's values.

    Normal distributions, unless these would add more than 30 % to the deviation of the product of
    friction and radius: then samples of the log-normal ones.
    """
    known = belief.effective
    both = known.deviation("friction") * known.deviation("patch_radius")
    wide = both > 0.3 * known.product_deviation
    spreads: dict[str, Distribution] = {}
    for name in known.names:
        value, deviation = known.value(name), max(known.deviation(name), 1e-6)
        if name == "delay":
            spreads[name] = Distribution(normal=deviation, mean=value)
        elif wide:
            spreads[name] = Distribution(samples=_log_normal(value, deviation))
        else:
            spreads[name] = Distribution(normal=value * deviation)
    pairs = []
    for i, one in enumerate(known.names):
        for other in known.names[i + 1 :]:
            number = float(np.clip(known.correlation(one, other), -0.9999, 0.9999))
            if abs(number) > 0.01:
                pairs.append((one, other, round(number, 4)))
    # Rounding may leave no valid correlation matrix: then all correlations shrink until it is one.
    weaker, shrink = pairs, 1.0
    while np.linalg.eigvalsh(Uncertainty.matrix_of(known.names, weaker)).min() <= 1e-6:
        shrink *= 0.999
        weaker = [(one, other, round(shrink * value, 4)) for one, other, value in pairs]
    return Uncertainty(**spreads, correlation=tuple(weaker))


def _log_normal(value: float, deviation: float) -> tuple[float, ...]:
    """99 values of equal weight of a log-normal distribution, within the range of a scene."""
    from scipy.special import ndtri

    scores = ndtri((np.arange(99) + 0.5) / 99)
    shares = np.clip(np.exp(deviation * scores), 0.02, 50.0)
    return tuple(float(f"{value * share:.6g}") for share in shares)


def contact_text(
    belief: Belief, shared: Contact | Shared, uncertainty: Uncertainty | None = None
) -> str:
    """The sections [contact] and [uncertainty] for a scene file; shared: has the keys of [contact]
    that were not fitted; uncertainty: of the scene with the belief, if the scene is known."""
    known = belief.effective
    contact: dict[str, Any] = {
        k: float(f"{known.value(k):.6g}") for k in ("friction", "patch_radius")
    }
    contact |= {"torsion": shared.torsion, "faces": shared.faces}
    tables = {"contact": contact, "uncertainty": (uncertainty or uncertainty_of(belief)).table()}
    lines = [
        "# In place of the [contact] and [uncertainty] of a scene. The uncertainty is that of the",
        "# mean by this model: not the scatter from throw to throw, nor the model's own error.",
        *toml_lines(tables, {}),
    ]
    return "\n".join(lines) + "\n"
