"""What is believed of the contact: a normal distribution over the logarithms of its numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .predict import Parameters

Array = npt.NDArray[np.float64]

#: What may be fitted, in this order; all but the delay [s] enter by their logarithms.
UNKNOWNS = ("friction", "patch_radius", "delay", "grip_scale")
#: Values of those that are not fitted.
USUAL = {"delay": 0.0, "grip_scale": 1.0}
#: Chi-squared of two degrees of freedom that 95 % stay below.
CHI2_95 = 5.991


@dataclass(frozen=True)
class Belief:
    """Mean (P,) and covariance (P, P) of the unknowns `names`.

    friction, patch_radius [m] and grip_scale by their natural logarithms, delay in seconds.
    """

    names: tuple[str, ...]
    mean: Array
    covariance: Array

    def index(self, name: str) -> int:
        """Place of an unknown."""
        return self.names.index(name)

    def value(self, name: str) -> float:
        """The unknown at the mean (the median of a logarithm); what it usually is if known."""
        if name not in self.names:
            return USUAL[name]
        return float(self.values()[name])

    def values(self) -> dict[str, float]:
        """All unknowns at the mean, SI units."""
        return {
            name: float(number if name == "delay" else np.exp(number))
            for name, number in zip(self.names, self.mean, strict=True)
        }

    def deviation(self, name: str) -> float:
        """Standard deviation: of the logarithm (so, relative), of the delay [s]; 0 if known."""
        if name not in self.names:
            return 0.0
        i = self.index(name)
        return float(np.sqrt(max(self.covariance[i, i], 0.0)))

    def correlation(self, one: str, other: str) -> float:
        """Correlation of two unknowns."""
        both = self.deviation(one) * self.deviation(other)
        return float(self.covariance[self.index(one), self.index(other)]) / both if both else 0.0

    def along(self, **weights: float) -> tuple[float, float]:
        """Mean and standard deviation of a weighted sum of the unknowns that are in."""
        w = np.array([weights.get(name, 0.0) for name in self.names])
        return float(w @ self.mean), float(np.sqrt(max(w @ self.covariance @ w, 0.0)))

    @property
    def product(self) -> float:
        """mu r_p [m], of the grip force as it was measured: what a release depends on most."""
        return float(np.exp(self.along(friction=1, patch_radius=1, grip_scale=1)[0]))

    @property
    def product_deviation(self) -> float:
        """Standard deviation of its logarithm (relative)."""
        return self.along(friction=1, patch_radius=1, grip_scale=1)[1]

    @property
    def effective(self) -> Belief:
        """The same with the force's scale put into the friction, which acts alike."""
        if "grip_scale" not in self.names:
            return self
        names = tuple(name for name in self.names if name != "grip_scale")
        fold = np.zeros((len(names), len(self.names)))
        for i, name in enumerate(names):
            fold[i, self.index(name)] = 1.0
        fold[0, self.index("grip_scale")] = 1.0
        return Belief(names, fold @ self.mean, fold @ self.covariance @ fold.T)

    def ellipse(self, count: int = 121) -> Array:
        """Outline (count, 2) of friction and patch_radius [m] that hold 95 %."""
        pair = [self.index("friction"), self.index("patch_radius")]
        factor = np.linalg.cholesky(self.covariance[np.ix_(pair, pair)] + 1e-18 * np.eye(2))
        turn = np.linspace(0.0, 2 * np.pi, count)
        circle = np.sqrt(CHI2_95) * np.array([np.cos(turn), np.sin(turn)])
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


def parameters_at(
    names: tuple[str, ...], points: Array, fixed: dict[str, float] | None = None
) -> Parameters:
    """Points (M, P) as parameters; `fixed`: values of what is not among the names."""
    rows = np.atleast_2d(points)
    values = {}
    for name in UNKNOWNS:
        if name in names:
            column = rows[:, names.index(name)]
            values[name] = column.copy() if name == "delay" else np.exp(column)
        else:
            values[name] = np.full(len(rows), (USUAL | (fixed or {}))[name])
    return Parameters(**values)
