"""Shapes of a limit surface other than the plain ellipsoid (19).

All are in the hand's axes. A wrench is w = (force along the hand, force across it, torque), each as
a share of its own limit on the plain ellipsoid: friction stays within gauge(w) <= 1, and the plain
ellipsoid is |w| <= 1. A rotated ellipsoid is w^T A w <= 1, a quartic a homogeneous polynomial
H(w) <= 1 of degree 4 (Fig. 8 of Liu and Billard; Zhou et al., ICRA 2016). An ellipsoid becomes
the quartic (w^T A w)^2, so that two laws serve all shapes. The two points of Fig. 9 are on the
hand's axis, c r_p before and behind the middle of the pads, and bear half of the force each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .backend import Value, backend

#: Shapes by their names in files, and how many coefficients each has.
SHAPES = {"ellipsoid": 6, "quartic": 15, "two-points": 0}
#: Exponents of w in the terms of a quartic, in the order of its coefficients.
EXPONENTS = tuple((i, j, 4 - i - j) for i in range(4, -1, -1) for j in range(4 - i, -1, -1))
#: Places (row, column) of an ellipsoid's coefficients in A.
ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
#: Directions in which a shape is examined.
DIRECTIONS = 4000


def polynomial(coefficients: Sequence[Value], w: Sequence[Value], *by: int) -> Value:
    """A quartic at w (3 values), or its derivative by the given components."""
    total: Value = 0.0
    for coefficient, exponents in zip(coefficients, EXPONENTS, strict=True):
        left, term = list(exponents), coefficient
        for component in by:
            term = left[component] * term
            left[component] -= 1
        if min(left) < 0:
            continue
        for value, exponent in zip(w, left, strict=True):
            for _ in range(exponent):
                term = term * value
        total = total + term
    return total


def quartic_gauge(w: Sequence[Value], coefficients: Sequence[Value]) -> Value:
    """Gauge of a quartic: the fourth root of H(w)."""
    value = polynomial(coefficients, w)
    xp = backend(value)
    return xp.sqrt(xp.sqrt(xp.maximum(value, 0.0)))


def points_gauge(w: Sequence[Value]) -> Value:
    """Gauge of two points: the larger share of their friction, with the force along the hand shared
    best.

    The forces across the hand follow from w. While both points bear some of the force along it,
    both are at their limit.
    """
    along, across, torque = w
    xp = backend(*w)
    size = abs(along)
    behind, before, difference = across - torque, across + torque, 4.0 * across * torque
    share = size + difference / (4.0 * xp.maximum(size, 1e-150))
    both = xp.sqrt(behind * behind + share * share)
    one = xp.maximum(abs(behind), abs(before))
    return xp.where(4.0 * size * size >= abs(difference), both, one)


@dataclass(frozen=True)
class SurfaceShape:
    """A shape: the 15 coefficients of its quartic, none for two points."""

    quartic: tuple[float, ...] = ()

    @classmethod
    def of(cls, name: str, coefficients: Sequence[float]) -> SurfaceShape:
        """The shape of that name of `SHAPES`.

        coefficients: of an ellipsoid A_11, A_22, A_33, A_12, A_13, A_23; of a quartic in the order
        of `EXPONENTS`. ValueError for another number of them, and for a surface that is not convex
        or not bounded.
        """
        if len(coefficients) != SHAPES[name]:
            raise ValueError(f"{name} takes {SHAPES[name]} numbers, not {len(coefficients)}")
        values = tuple(float(value) for value in coefficients)
        if name == "ellipsoid":
            return cls.squared(values)._checked()
        return cls(values)._checked() if name == "quartic" else cls()

    @classmethod
    def squared(cls, a: Sequence[float]) -> SurfaceShape:
        """The quartic (w^T A w)^2 of an ellipsoid; unchecked."""
        terms = [(a[n] * (1.0 if i == j else 2.0), i, j) for n, (i, j) in enumerate(ENTRIES)]
        found = dict.fromkeys(EXPONENTS, 0.0)
        for one, i, j in terms:
            for other, k, m in terms:
                places = (i, j, k, m)
                found[places.count(0), places.count(1), places.count(2)] += one * other
        return cls(tuple(found.values()))

    def gauge(self, w: Sequence[Value]) -> Value:
        """Size of w (3 values): 1 on the surface, in proportion along a ray."""
        return quartic_gauge(w, self.quartic) if self.quartic else points_gauge(w)

    def normal(self, w: Sequence[Value]) -> list[Value]:
        """Gradient of H (3 values) at w: the direction of slip under friction -w; of a quartic."""
        return [polynomial(self.quartic, w, i) for i in range(3)]

    @cached_property
    def inscribed(self) -> float:
        """Radius of the largest plain ellipsoid inside: 1 for the plain one."""
        return float(1.0 / np.max(self.gauge(list(_directions()))))

    def _checked(self) -> SurfaceShape:
        """Itself; ValueError if a quartic is not positive, or not convex, in some direction."""
        w = list(_directions())
        if np.min(polynomial(self.quartic, w)) <= 1e-9 * np.max(np.abs(self.quartic)):
            raise ValueError("the surface is not bounded: H(w) must be above 0 in each direction")
        bend = [
            [polynomial(self.quartic, w, i, j) + 0.0 * w[0] for j in range(3)] for i in range(3)
        ]
        least = np.linalg.eigvalsh(np.array(bend).transpose(2, 0, 1)).min()
        if least < -1e-6 * np.max(np.abs(self.quartic)):
            raise ValueError("the surface is not convex: the Hessian of H(w) has a negative value")
        return self


def _directions() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Directions (3, N), evenly over the half sphere (a spiral), and the axes and diagonals."""
    share = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    turn, radius = np.pi * (1.0 + 5.0**0.5) * np.arange(DIRECTIONS), np.sqrt(1.0 - share**2)
    spiral = np.array([radius * np.cos(turn), radius * np.sin(turn), share])
    grid = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1)
    special = grid[:, np.abs(grid).sum(axis=0) > 0]
    return np.hstack([spiral, special / np.linalg.norm(special, axis=0)])
