"""Shapes of a limit surface other than the plain ellipsoid (19).

All are in the hand's axes. A wrench is w = (force along the hand, force across it, torque), each as
a share of its own limit on the plain ellipsoid: friction stays within gauge(w) <= 1, and the plain
ellipsoid is |w| <= 1. A rotated ellipsoid is w^T A w <= 1, a quartic a homogeneous polynomial
H(w) <= 1 of degree 4 (Fig. 8 of Liu and Billard; Zhou et al., ICRA 2016). An ellipsoid becomes
the quartic (w^T A w)^2, so that two laws serve all shapes. The two points of Fig. 9 are on the
hand's axis, c r_p before and behind the middle of the pads, and bear half of the force each.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .body import Array, PinchContact

#: Exponents of w in the terms of a quartic, in the order of its coefficients.
EXPONENTS = tuple((i, j, 4 - i - j) for i in range(4, -1, -1) for j in range(4 - i, -1, -1))
#: Places (row, column) of an ellipsoid's coefficients in A.
ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
#: Directions in which a shape is examined.
DIRECTIONS = 4000


@dataclass(frozen=True, eq=False)
class SurfaceShape:
    """A shape: the symmetric tensor C of its quartic H(w) = sum C_ijkl w_i w_j w_k w_l, as a matrix
    (9, 9) of the pairs ij and kl; None for two points."""

    #: Shapes by their names in files, and how many coefficients each has.
    SHAPES: ClassVar[dict[str, int]] = {"ellipsoid": 6, "quartic": 15, "two-points": 0}

    quartic: Array | None = None

    @classmethod
    def of(cls, name: str, coefficients: Sequence[float]) -> SurfaceShape:
        """The shape of that name of `SHAPES`.

        coefficients: of an ellipsoid A_11, A_22, A_33, A_12, A_13, A_23; of a quartic in the order
        of `EXPONENTS`. ValueError for another number of them, and for a surface that is not convex
        or not bounded.
        """
        if len(coefficients) != (count := cls.SHAPES[name]):
            raise ValueError(f"{name} takes {count} numbers, not {len(coefficients)}")
        if name == "two-points":
            return cls()
        if name == "ellipsoid":
            a = np.empty((3, 3))
            for (i, j), value in zip(ENTRIES, coefficients, strict=True):
                a[i, j] = a[j, i] = value
            square = np.multiply.outer(a, a)
            mixed = square.transpose(0, 2, 1, 3) + square.transpose(0, 2, 3, 1)
            return cls((square + mixed).reshape(9, 9) / 3.0)._checked()
        tensor = np.zeros((3,) * 4)
        for exponents, value in zip(EXPONENTS, coefficients, strict=True):
            factors = [axis for axis, power in enumerate(exponents) for _ in range(power)]
            places = set(itertools.permutations(factors))
            for place in places:
                tensor[place] = value / len(places)
        return cls(tensor.reshape(9, 9))._checked()

    def gauge(self, w: Array) -> Array:
        """Size (...) of w (3, ...): 1 on the surface, in proportion along a ray."""
        if self.quartic is None:
            return _points_gauge(w)
        value = np.einsum("i...,ij...,j...", w, self.paired(w), w)
        return np.asarray(np.maximum(value, 0.0) ** 0.25)

    def use(self, contact: PinchContact, wrench: Array, force: Array, angle: Array) -> Array:
        """Share (...) of a contact's friction limit that a wrench (3, ...) [N, N, N m] in world
        axes uses, at a normal force [N] and an angle [rad] of the hand."""
        cos, sin, (f_x, f_z, torque) = np.cos(angle), np.sin(angle), wrench
        turned = np.array([cos * f_x + sin * f_z, cos * f_z - sin * f_x])
        w = np.concatenate([turned, torque[None] / contact.torsion_arm])
        return self.gauge(w / contact.force_limit(force))

    def paired(self, w: Array) -> Array:
        """M (3, 3, ...), the sum of C_ijkl w_k w_l: H is w^T M w, its gradient 4 M w and its
        Hessian 12 M. Of a quartic."""
        assert self.quartic is not None
        pairs = (w[:, None] * w).reshape(9, -1)
        return np.asarray((self.quartic @ pairs).reshape(3, 3, *w.shape[1:]))

    def _checked(self) -> SurfaceShape:
        """Itself; ValueError if a quartic is not positive, or not convex, in some direction."""
        assert self.quartic is not None
        largest, w = np.abs(self.quartic).max(), _directions()
        if self.gauge(w).min() ** 4 <= 1e-9 * largest:
            raise ValueError("the surface is not bounded: H(w) must be above 0 in each direction")
        if np.linalg.eigvalsh(self.paired(w).T).min() < -1e-7 * largest:
            raise ValueError("the surface is not convex: the Hessian of H(w) has a negative value")
        return self


def _points_gauge(w: Array) -> Array:
    """Gauge of two points: the larger share of their friction, with the force along the hand shared
    best.

    The forces across the hand follow from w. While both points bear some of the force along it,
    both are at their limit.
    """
    along, across, torque = w
    size = np.abs(along)
    behind, before, difference = across - torque, across + torque, 4.0 * across * torque
    share = size + difference / (4.0 * np.maximum(size, 1e-150))
    one = np.maximum(np.abs(behind), np.abs(before))
    both = 4.0 * size * size >= np.abs(difference)
    return np.asarray(np.where(both, np.hypot(behind, share), one))


def _directions() -> Array:
    """Directions (3, N), evenly over the half sphere (a spiral), and the axes and diagonals."""
    share = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    turn, radius = np.pi * (1.0 + 5.0**0.5) * np.arange(DIRECTIONS), np.sqrt(1.0 - share**2)
    spiral = np.array([radius * np.cos(turn), radius * np.sin(turn), share])
    grid = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1)
    special = grid[:, np.abs(grid).sum(axis=0) > 0]
    return np.hstack([spiral, special / np.linalg.norm(special, axis=0)])
