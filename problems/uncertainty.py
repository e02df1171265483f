"""What is not known exactly: which of a scene's values are spread, and how they hang together."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from .distribution import Distribution
from .errors import InputError
from .section import Section, from_table, table_of, unknown


@dataclasses.dataclass(frozen=True)
class Parameter:
    """Rules of one uncertain value.

    degrees: the file gives it in degrees, its key ends in `_deg`. scaled: a positive
    value of the scene, which may be spread relative to it; possible are `SHARES` of it.
    most: any other may be this far from the scene's value.
    """

    degrees: bool = False
    scaled: bool = False
    most: float = 0.0


#: A positive value may be spread to these shares of the scene's own.
SHARES = (0.01, 100.0)

PARAMETERS: dict[str, Parameter] = {
    "delay": Parameter(most=10.0),
    "opening": Parameter(scaled=True),
    "friction": Parameter(scaled=True),
    "patch_radius": Parameter(scaled=True),
    "mass": Parameter(scaled=True),
    "com_offset": Parameter(most=100.0),
    "inertia": Parameter(scaled=True),
    "grasp_offset": Parameter(most=100.0),
    "grasp_angle": Parameter(degrees=True, most=math.tau),
    "hand_x": Parameter(most=10.0),
    "hand_z": Parameter(most=10.0),
    "hand_theta": Parameter(degrees=True, most=math.tau),
    "hand_vx": Parameter(most=100.0),
    "hand_vz": Parameter(most=100.0),
    "hand_omega": Parameter(degrees=True, most=1000.0),
}


def file_key(name: str) -> str:
    """A parameter's key in a scene file."""
    return f"{name}_deg" if PARAMETERS[name].degrees else name


@dataclasses.dataclass(frozen=True)
class Uncertainty(Section):
    """What is not known exactly; feeds sweeps, and robust plans where they are asked for.

    delay [s]: the gripper opens that much later than commanded (below zero: earlier); a
    known mean moves the command earlier by as much. opening [s]: duration of the fall.
    friction; patch_radius [m]; mass [kg]; com_offset [m], from the pads to the CoM;
    inertia [kg m^2]; grasp_offset [m], of the pads from the bar's end; grasp_angle [rad].
    hand_x, hand_z [m], hand_theta [rad], hand_vx, hand_vz [m/s], hand_omega [rad/s]: error
    of the hand's pose and twist as the force starts to fall. correlation: (name, name,
    coefficient) of the normal scores (a Gaussian copula).
    """

    delay: Distribution | None = None
    opening: Distribution | None = None
    friction: Distribution | None = None
    patch_radius: Distribution | None = None
    mass: Distribution | None = None
    com_offset: Distribution | None = None
    inertia: Distribution | None = None
    grasp_offset: Distribution | None = None
    grasp_angle: Distribution | None = None
    hand_x: Distribution | None = None
    hand_z: Distribution | None = None
    hand_theta: Distribution | None = None
    hand_vx: Distribution | None = None
    hand_vz: Distribution | None = None
    hand_omega: Distribution | None = None
    correlation: tuple[tuple[str, str, float], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The uncertain parameters."""
        return tuple(name for name in PARAMETERS if getattr(self, name) is not None)

    def check(self) -> None:
        """Something is uncertain; relative only where that means something; correlations."""
        if not self.names:
            raise InputError(
                f"nothing is uncertain (known: {', '.join(map(file_key, PARAMETERS))})"
            )
        for name in self.names:
            if getattr(self, name).relative and not PARAMETERS[name].scaled:
                allowed = ", ".join(key for key, value in PARAMETERS.items() if value.scaled)
                raise InputError(f"{file_key(name)}: relative: only for {allowed}")
        self._check_correlation()

    def _check_correlation(self) -> None:
        seen = set()
        for one, other, value in self.correlation:
            for name in (one, other):
                if name not in self.names:
                    raise InputError(
                        f"correlation: '{name}' is not uncertain here "
                        f"(uncertain: {', '.join(map(file_key, self.names))})"
                    )
            pair = f"{file_key(one)} and {file_key(other)}"
            if one == other or frozenset((one, other)) in seen:
                raise InputError(f"correlation of {pair}: give two different ones, and once")
            if not -1.0 < value < 1.0:
                raise InputError(f"correlation of {pair} = {value:g}: must be between -1 and 1")
            seen.add(frozenset((one, other)))
        lowest = float(np.linalg.eigvalsh(self.matrix).min())
        if lowest < 1e-9:
            raise InputError(
                f"correlation: no such values exist: the matrix must be positive definite, its "
                f"lowest eigenvalue is {lowest:.3g}"
            )

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """Correlation of the normal scores (P, P), in the order of `names`."""
        matrix = np.eye(len(self.names))
        for one, other, value in self.correlation:
            i, j = self.names.index(one), self.names.index(other)
            matrix[i, j] = matrix[j, i] = value
        return matrix

    def check_possible(
        self, values: Mapping[str, float], ranges: Mapping[str, tuple[float, float]]
    ) -> None:
        """InputError where a value can become impossible; `values` are the scene's."""
        for name in self.names:
            low, high = ranges[name]
            least, most = getattr(self, name).about(values[name]).reach
            if low <= least and most <= high:
                continue
            unit = math.degrees(1.0) if PARAMETERS[name].degrees else 1.0
            words = [f"{unit * value:.6g}" for value in (least, most, low, high)]
            reached = f"is {words[0]}" if least == most else f"reaches [{words[0]}, {words[1]}]"
            raise InputError(
                f"{file_key(name)}: {reached}: must stay within [{words[2]}, {words[3]}]"
            )


def uncertainty_from(table: Mapping[str, Any]) -> Uncertainty:
    """The section [uncertainty] of a scene file; InputError naming the key."""
    keys = {file_key(name): name for name in PARAMETERS}
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key == "correlation":
            values[key] = _pairs(value, keys)
        elif key not in keys:
            raise InputError(unknown(key, [*keys, "correlation"]))
        elif not isinstance(value, Mapping):
            raise InputError(f"{key} = {value!r}: must be like {{ uniform = 0.01 }}")
        else:
            try:
                spread: Distribution = from_table(Distribution, value)
            except InputError as error:
                raise InputError(f"{key}: {error}") from None
            values[keys[key]] = spread.in_radians() if key.endswith("_deg") else spread
    return Uncertainty(**values)


def uncertainty_table(uncertainty: Uncertainty) -> dict[str, Any]:
    """The table that `uncertainty_from` makes the section from."""
    table: dict[str, Any] = {}
    for name in uncertainty.names:
        spread: Distribution = getattr(uncertainty, name)
        table[file_key(name)] = table_of(
            spread.in_degrees() if PARAMETERS[name].degrees else spread
        )
    if uncertainty.correlation:
        table["correlation"] = [
            [file_key(one), file_key(other), number]
            for one, other, number in uncertainty.correlation
        ]
    return table


def _pairs(value: Any, keys: Mapping[str, str]) -> Any:
    """Correlations with the parameters' names in place of the file's keys."""
    wrong = f"correlation = {value!r}: must be like [['friction', 'patch_radius', 0.8]]"
    if not isinstance(value, list):
        raise InputError(wrong)
    for row in value:
        kinds = [str, str, (int, float)]
        if not isinstance(row, list) or len(row) != 3 or isinstance(row[2], bool):
            raise InputError(wrong)
        if not all(itertools.starmap(isinstance, zip(row, kinds, strict=True))):
            raise InputError(wrong)
        for key in row[:2]:
            if key not in keys:
                raise InputError(f"correlation: {unknown(key, list(keys))}")
    return [[keys[one], keys[other], float(number)] for one, other, number in value]


#: What a scene without [uncertainty] is swept under: the opening up to 10 ms early or late.
USUAL = Uncertainty(delay=Distribution(uniform=0.010))
