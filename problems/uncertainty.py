"""Uncertain values and their distributions."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from ..models import Array
from . import section
from .checks import InputError
from .section import Section, from_table, optional, quantity, table_of, unknown


@dataclasses.dataclass(frozen=True)
class Distribution(Section):
    """Distribution of a value: one of `uniform`, `normal` and `samples`.

    With `relative` all numbers are multiples of the scene's value: `{ uniform = 0.1, relative =
    true }` is +-10 % of it.
    """

    uniform: float | None = optional("half width about `mean`; 0: none", least=0)
    normal: float | None = optional(
        "standard deviation about `mean`; cut off where values become impossible", above=0
    )
    samples: tuple[float, ...] = quantity("measured values", default=())
    mean: float | None = optional(
        "the scene's value (0 for an error) where left out; not with `samples`"
    )
    relative: bool = quantity(
        "all numbers are multiples of the scene's value; only for opening, friction, "
        "patch_radius, mass, inertia",
        default=False,
    )

    def check(self) -> None:
        """Exactly one kind."""
        kinds = [self.uniform is not None, self.normal is not None, bool(self.samples)]
        if sum(kinds) != 1:
            raise InputError("give exactly one of 'uniform', 'normal' and 'samples'")
        if self.samples and self.mean is not None:
            raise InputError("mean: not beside 'samples', which have their own")

    def about(self, value: float) -> Distribution:
        """The distribution in absolute numbers, about the scene's value `value`."""
        unit = value if self.relative else 1.0
        mean = value if self.mean is None else unit * self.mean
        return self._times(unit, None if self.samples else mean)

    def scaled(self, unit: float) -> Distribution:
        """The distribution in a unit that is smaller by the factor `unit`."""
        mean = None if self.mean is None else unit * self.mean
        return self._times(unit, mean, self.relative)

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
        """Standard deviation of the distribution."""
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


#: Range of a positive value, as shares of the scene's value.
SHARES = (0.01, 100.0)


@dataclasses.dataclass(frozen=True)
class Parameter:
    """Rules of one uncertain value.

    key: in files. degrees: files have degrees. scaled: a positive value of the scene, whose
    distribution may be relative. most: largest deviation of other values from the scene's.
    """

    key: str
    degrees: bool = False
    scaled: bool = False
    most: float = 0.0

    def range(self, value: float) -> tuple[float, float]:
        """Lowest and highest possible value, for the scene's own."""
        if self.scaled:
            return SHARES[0] * value, SHARES[1] * value
        return value - self.most, value + self.most


@dataclasses.dataclass(frozen=True)
class Uncertainty(Section):
    """Distributions of uncertain values, for sweeps and robust plans.
    At least one of the keys. Each holds a table with exactly one of `uniform`, `normal` and
    `samples`, for example `{ uniform = 0.010, mean = 0.004 }`. A `delay` and an `opening` that are
    left out are assumed, in sweeps, quiet and robust plans and with [rest]; `delay = 0` says that
    it does not vary.

    Errors of the hand's pose and twist are those at the start of the opening. correlation
    is of the normal scores (a Gaussian copula).
    """

    #: Rules of the uncertain values by name.
    PARAMETERS: ClassVar[dict[str, Parameter]]
    #: What is assumed of values that a scene does not give: an opening up to 10 ms early or late,
    #: in half to one and a half times its duration.
    USUAL: ClassVar[Uncertainty]

    delay: Distribution | None = optional(
        "s, from the commanded to the real opening; the command is earlier by a known mean",
        most=10.0,
    )
    opening: Distribution | None = optional("s, duration of the force's fall")
    friction: Distribution | None = optional("μ")
    patch_radius: Distribution | None = optional("m")
    mass: Distribution | None = optional("kg")
    com_offset: Distribution | None = optional("m, from the pads to the CoM", most=100.0)
    inertia: Distribution | None = optional("kg m²")
    grasp_offset: Distribution | None = optional("m, of the pads from the bar's end", most=100.0)
    grasp_angle: Distribution | None = optional("degrees", degrees=True, most=math.tau)
    hand_x: Distribution | None = optional(
        "m, error of the hand at the start of the opening", most=10.0
    )
    hand_z: Distribution | None = optional(
        "m, error of the hand at the start of the opening", most=10.0
    )
    hand_theta: Distribution | None = optional(
        "degrees, error of the hand", degrees=True, most=math.tau
    )
    hand_vx: Distribution | None = optional("m/s, error of the hand", most=100.0)
    hand_vz: Distribution | None = optional("m/s, error of the hand", most=100.0)
    hand_omega: Distribution | None = optional(
        "degrees/s, error of the hand", degrees=True, most=1000.0
    )
    correlation: tuple[tuple[str, str, float], ...] = quantity(
        "rows name, name, coefficient (between −1 and 1) of the normal scores", default=()
    )

    @property
    def names(self) -> tuple[str, ...]:
        """The uncertain parameters; without those that are as the scene has them."""
        known = {name: getattr(self, name) for name in self.PARAMETERS}
        return tuple(
            name
            for name, one in known.items()
            if one is not None and (one.uniform != 0.0 or one.mean is not None)
        )

    def about(self, values: Mapping[str, float]) -> dict[str, Distribution]:
        """The distributions by name in absolute numbers, about the scene's `values`."""
        return {name: getattr(self, name).about(values[name]) for name in self.names}

    def check(self) -> None:
        """At least one value is uncertain, only positive ones are relative, correlations are
        valid."""
        if all(getattr(self, name) is None for name in self.PARAMETERS):
            keys = ", ".join(one.key for one in self.PARAMETERS.values())
            raise InputError(f"nothing is uncertain (known: {keys})")
        for name in self.names:
            if getattr(self, name).relative and not self.PARAMETERS[name].scaled:
                allowed = ", ".join(key for key, value in self.PARAMETERS.items() if value.scaled)
                raise InputError(f"{self.PARAMETERS[name].key}: relative: only for {allowed}")
        self._check_correlation()

    def _check_correlation(self) -> None:
        seen = set()
        for one, other, value in self.correlation:
            for name in (one, other):
                if name not in self.names:
                    known = ", ".join(self.PARAMETERS[each].key for each in self.names)
                    words = f"'{name}' is not uncertain here (uncertain: {known})"
                    raise InputError(f"correlation: {words}")
            pair = f"{self.PARAMETERS[one].key} and {self.PARAMETERS[other].key}"
            if one == other or frozenset((one, other)) in seen:
                raise InputError(f"correlation of {pair}: give two different ones, and once")
            if not -1.0 < value < 1.0:
                raise InputError(f"correlation of {pair} = {value:g}: must be between -1 and 1")
            seen.add(frozenset((one, other)))
        lowest = float(np.linalg.eigvalsh(self.matrix).min(initial=1.0))
        if lowest < 1e-9:
            raise InputError(
                f"correlation: no such values exist: the matrix must be positive definite, its "
                f"lowest eigenvalue is {lowest:.3g}"
            )

    @property
    def matrix(self) -> Array:
        """Correlation of the normal scores (P, P), in the order of `names`."""
        return self.matrix_of(self.names, self.correlation)

    @staticmethod
    def matrix_of(names: Sequence[str], pairs: Iterable[tuple[str, str, float]]) -> Array:
        """(P, P) of coefficients between some of P names; the others do not correlate."""
        matrix = np.eye(len(names))
        for one, other, value in pairs:
            i, j = names.index(one), names.index(other)
            matrix[i, j] = matrix[j, i] = value
        return matrix

    def table(self) -> dict[str, Any]:
        """The table of the section, for `uncertainty_from`."""
        table = table_of(self)
        if self.correlation:
            table["correlation"] = [
                [self.PARAMETERS[one].key, self.PARAMETERS[other].key, number]
                for one, other, number in self.correlation
            ]
        return table

    def check_possible(
        self, values: Mapping[str, float], ranges: Mapping[str, tuple[float, float]]
    ) -> None:
        """InputError if a value can become impossible; `values`: the scene's."""
        for name, spread in self.about(values).items():
            low, high = ranges[name]
            least, largest = spread.reach
            if low <= least and largest <= high:
                continue
            unit = math.degrees(1.0) if self.PARAMETERS[name].degrees else 1.0
            words = [f"{unit * value:.6g}" for value in (least, largest, low, high)]
            reached = f"is {words[0]}" if least == largest else f"reaches [{words[0]}, {words[1]}]"
            raise InputError(
                f"{self.PARAMETERS[name].key}: {reached}: must stay within [{words[2]}, {words[3]}]"
            )


Uncertainty.PARAMETERS = {
    field.name: Parameter(
        section.file_key(field.name, field.metadata),
        field.metadata["degrees"],
        field.name in ("opening", "friction", "patch_radius", "mass", "inertia"),
        field.metadata.get("most", 0.0),
    )
    for field in dataclasses.fields(Uncertainty)
    if field.name != "correlation"
}
Uncertainty.USUAL = Uncertainty(
    delay=Distribution(uniform=0.010), opening=Distribution(uniform=0.5, relative=True)
)


def uncertainty_from(table: Mapping[str, Any]) -> Uncertainty:
    """The section [uncertainty] of a scene file; InputError naming the key."""
    keys = {one.key: name for name, one in Uncertainty.PARAMETERS.items()}
    pairs = {k: _pairs(v, keys) for k, v in table.items() if k == "correlation"}
    none = {
        key: {"uniform": 0.0}
        for key in Uncertainty.USUAL.names
        if type(table.get(key)) in (int, float) and table[key] == 0
    }
    section_read: Uncertainty = from_table(Uncertainty, {**table, **pairs, **none})
    return section_read


def _pairs(value: Any, keys: Mapping[str, str]) -> Any:
    """Correlations with the parameters' names in place of the file's keys."""
    try:
        return [[keys[one], keys[other], number] for one, other, number in value]
    except KeyError as error:
        raise InputError(f"correlation: {unknown(str(error.args[0]), list(keys))}") from None
    except (TypeError, ValueError):
        raise InputError(
            f"correlation = {value!r}: must be like [['friction', 'patch_radius', 0.8]]"
        ) from None


@dataclasses.dataclass(frozen=True)
class Robust(Section):
    """A robust plan: of several throws to the target the one that succeeds most often under
    [uncertainty], or what is assumed without it. The section has no keys."""
