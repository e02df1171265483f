"""What is thrown and how it is held: the bar, the grasp, the pads, the grip force."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from ..models import GripProfile, LinearRelease, TableRelease
from .errors import InputError
from .section import Section, from_table, quantity

#: No hand-held thing weighs more [kg]: above it, it is likely in grams.
HEAVIEST = 50.0


@dataclasses.dataclass(frozen=True)
class ThrownObject(Section):
    """The bar: a rigid body with its mass along a long axis.

    mass [kg]; inertia about the CoM [kg m^2]; length and width [m]; com [m], the CoM's
    distance from the end that is nearer the grasp.
    """

    mass: float = quantity(above=0, most=1e4)
    inertia: float = quantity(above=0, least=1e-12, most=1e6)
    length: float = quantity(above=0, most=100, unit="m")
    com: float = quantity(least=0)
    width: float = quantity(least=0, most=100, default=0.0)

    def check(self) -> None:
        """CoM inside the bar; inertia not above the two-point-mass bound for that CoM."""
        if self.com > self.length:
            raise InputError(f"com = {self.com:g}: must be at most the length {self.length:g}")
        most = self.mass * (self.com * (self.length - self.com) + self.width**2 / 4)
        if self.inertia > most * (1 + 1e-9):
            raise InputError(
                f"inertia = {self.inertia:g}: must be at most {most:.4g} kg m^2, "
                "what mass, length, width and com allow"
            )


def held_object(table: Mapping[str, Any]) -> ThrownObject:
    """The object of a file's table, in SI units: of a mass that a hand can hold."""
    found: ThrownObject = from_table(ThrownObject, table)
    if found.mass > HEAVIEST:
        raise InputError(
            f"mass = {found.mass:g}: must be in kg, at most {HEAVIEST:g} (is it in grams?)"
        )
    return found


@dataclasses.dataclass(frozen=True)
class Grasp(Section):
    """Where and how the bar is held.

    offset [m] of the pads from the end nearer the grasp; angle [rad] of the bar's axis
    (grasp towards CoM) against the hand's approach axis.
    """

    offset: float = quantity(least=0, default=0.0)
    angle: float = quantity(degrees=True, default=0.0)


@dataclasses.dataclass(frozen=True)
class PadContact(Section):
    """Friction of the pads.

    friction mu, patch_radius r_p [m], torsion c, faces (pads that rub). pressure: how the
    meshed models `patch` and `lugre` spread the force over the pad.
    """

    friction: float = quantity(above=0, most=100)
    patch_radius: float = quantity(above=0, least=1e-6, most=1, unit="m")
    torsion: float = quantity(above=0, least=1e-3, most=10, default=0.6)
    faces: int = quantity(least=1, most=100, default=2)
    pressure: str = quantity(choices=("uniform", "hertz"), default="uniform")


@dataclasses.dataclass(frozen=True)
class Gripper(Section):
    """Grip force of one pad.

    Either `force` [N], `dwell` [s] (command to the start of the fall) and `opening` [s]
    (the fall, linear), or `times` [s from the command] and `forces` [N], measured, in
    the file itself or as `table`, a CSV with the columns t and f_N. raw: the table is an
    unfiltered recording, of which the nearest falling curve is taken (`monotone_grip`).
    """

    force: float | None = quantity(above=0, most=1e6, default=None)
    dwell: float = quantity(least=0, most=2, unit="s", default=0.0)
    opening: float | None = quantity(above=0, least=1e-5, most=2, unit="s", default=None)
    times: tuple[float, ...] = ()
    forces: tuple[float, ...] = ()
    table: str | None = None
    raw: bool = False

    def check(self) -> None:
        """Exactly one way of giving the force; a table that falls to zero."""
        linear = self.force is not None or self.opening is not None
        measured = bool(self.times or self.forces or self.table)
        if linear == measured:
            raise InputError("give either 'force' and 'opening', or a measured 'table'")
        if linear and (self.force is None or self.opening is None):
            missing = "force" if self.force is None else "opening"
            raise InputError(f"key '{missing}' is missing")
        self.profile()

    def profile(self) -> GripProfile:
        """The grip-force profile of the models."""
        if self.force is not None and self.opening is not None:
            return LinearRelease(self.force, self.dwell, self.opening)
        try:
            return TableRelease(self.times, self.forces)
        except ValueError as error:
            raise InputError(f"table = {self.table or 'times, forces'}: {error}") from None
