"""How one value is spread."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from .errors import InputError
from .section import Section, quantity


@dataclasses.dataclass(frozen=True)
class Distribution(Section):
    """How a value is spread: one of `uniform` (half width), `normal` (standard deviation)
    and `samples` (a measured list of values), about `mean`.

    mean: the scene's own value where absent; samples have their own. relative: all numbers
    are multiples of the scene's value, so that `{ uniform = 0.1, relative = true }` is
    +-10 % of it. A normal distribution is cut off where its values become impossible.
    """

    uniform: float | None = quantity(above=0, default=None)
    normal: float | None = quantity(above=0, default=None)
    samples: tuple[float, ...] = ()
    mean: float | None = None
    relative: bool = False

    def check(self) -> None:
        """Exactly one kind."""
        kinds = [self.uniform is not None, self.normal is not None, bool(self.samples)]
        if sum(kinds) != 1:
            raise InputError("give exactly one of 'uniform', 'normal' and 'samples'")
        if self.samples and self.mean is not None:
            raise InputError("mean: not beside 'samples', which have their own")

    def about(self, value: float) -> Distribution:
        """The same without reference to the scene, whose value is `value`: in its unit."""
        unit = value if self.relative else 1.0
        mean = value if self.mean is None else unit * self.mean
        return self._times(unit, None if self.samples else mean)

    def in_radians(self) -> Distribution:
        """The same for numbers given in degrees."""
        unit = math.radians(1.0)
        return self._times(unit, None if self.mean is None else unit * self.mean, self.relative)

    def in_degrees(self) -> Distribution:
        """The other way round."""
        unit = math.degrees(1.0)
        return self._times(unit, None if self.mean is None else unit * self.mean, self.relative)

    def _times(self, unit: float, mean: float | None, relative: bool = False) -> Distribution:
        width, deviation = self.uniform, self.normal
        return Distribution(
            None if width is None else unit * width,
            None if deviation is None else unit * deviation,
            tuple(unit * value for value in self.samples),
            mean,
            relative,
        )

    @property
    def expected(self) -> float:
        """Mean of the distribution, one that `about` made (a cut-off aside)."""
        return float(np.mean(self.samples)) if self.samples else self.mean or 0.0

    @property
    def deviation(self) -> float:
        """Its standard deviation."""
        if self.uniform is not None:
            return self.uniform / math.sqrt(3.0)
        return float(np.std(self.samples)) if self.samples else self.normal or 0.0

    @property
    def reach(self) -> tuple[float, float]:
        """Lowest and highest value; the mean alone for a normal one, which is cut off."""
        if self.samples:
            return min(self.samples), max(self.samples)
        half = self.uniform or 0.0
        return self.expected - half, self.expected + half
