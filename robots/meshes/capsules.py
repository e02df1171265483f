"""A mesh covered by few capsules whose axes lie in the throw's plane.

A capsule is convex: it covers a triangle if it covers its corners. The mesh is cut into small
triangles, which are divided into groups, each with a capsule. The groups begin as one and are split
where that saves the most area; then each triangle joins the capsule that it fits best.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...models import Array, Flags, Indices
from ...problems import SAME, Capsule, distances, small_triangles


@dataclass(frozen=True)
class CapsuleFitSettings:
    """angles: directions of an axis that are tried. wider: radii, over the
    least one, that are. ways: directions in which points are outermost,
    to which a capsule is fitted. cuts: places of a split along each of two
    axes. gain: an added capsule must lessen the
    mean excess by this share. rounds: of regrouping. digits: of the lengths [m] in files.
    """

    angles: int = 24
    wider: tuple[float, ...] = (1.0, 1.03, 1.07, 1.12, 1.2, 1.3)
    ways: int = 80
    cuts: int = 9
    gain: float = 0.15
    rounds: int = 5
    digits: int = 5


SETTINGS = CapsuleFitSettings()


def around(points: Array) -> Capsule:
    """The capsule of least area in the plane around points (N, 3), among directions of its axis."""
    angles = np.linspace(0.0, math.pi, SETTINGS.angles, endpoint=False)[:, None]
    cos, sin = np.cos(angles), np.sin(angles)
    x, y, z = points.T
    along, across = cos * x + sin * z, cos * z - sin * x
    # The axis' place: the largest distance is convex in it.
    low, high = across.min(axis=1), across.max(axis=1)
    for _ in range(16):
        one, two = low + (high - low) / 3, high - (high - low) / 3
        sizes = (np.hypot(across - c[:, None], y).max(axis=1) for c in (one, two))
        falls = np.greater(*sizes)
        low, high = np.where(falls, one, low), np.where(falls, high, two)
    middle = (low + high) / 2
    off = np.hypot(across - middle[:, None], y)
    # A larger radius than needed may let the axis be shorter.
    radius = off.max(axis=1) * np.array(SETTINGS.wider)[:, None]
    reach = np.sqrt(np.maximum(radius[..., None] ** 2 - off**2, 0.0))
    first, last = (along + reach).min(axis=2), (along - reach).max(axis=2)
    # Where the ends pass each other, a ball is enough.
    first, last = np.minimum(first, (first + last) / 2), np.maximum(last, (first + last) / 2)
    area = math.pi * radius**2 + 2 * radius * (last - first)
    best = np.unravel_index(area.argmin(), area.shape)
    k = best[1]
    c, s = float(cos[k, 0]), float(sin[k, 0])
    at = np.array([first[best], last[best]])
    begin, end = np.column_stack([c * at - s * middle[k], s * at + c * middle[k]])
    return begin, end, float(distances(points, (begin, end, 0.0)).max())


def _area(capsule: Capsule) -> float:
    begin, end, radius = capsule
    return math.pi * radius**2 + 2 * radius * float(np.linalg.norm(end - begin))


@dataclass(frozen=True)
class SmallTriangles:
    """Small triangles (F, 3), by their corners' numbers in points (N, 3) [m]; reach (N, W) [m]: of
    the points in each of many directions."""

    points: Array
    triangles: Indices
    reach: Array

    @classmethod
    def of(cls, corners: Array) -> SmallTriangles:
        """Of triangles (F, 3, 3)."""
        points, triangles = small_triangles(corners)
        ways = np.random.default_rng(0).normal(size=(3, SETTINGS.ways))
        return cls(points, triangles, points @ ways)

    def capsule(self, which: Flags) -> Capsule:
        """A capsule around the points of triangles `which` that are outermost in a direction."""
        marked = np.zeros(len(self.points), bool)
        marked[self.triangles[which]] = True
        own = np.flatnonzero(marked)
        return around(self.points[own[np.unique(self.reach[own].argmax(axis=0))]])

    def split(self, which: Flags) -> Flags | None:
        """Which triangles are in one of the best two capsules around triangles `which`."""
        middles = self.points[self.triangles].mean(axis=1)
        best, least = None, math.inf
        for axis in (0, 2):
            low, high = middles[which, axis].min(), middles[which, axis].max()
            for cut in np.linspace(low, high, SETTINGS.cuts + 2)[1:-1]:
                sides = [which & side for side in (middles[:, axis] < cut, middles[:, axis] >= cut)]
                if sides[0].any() and sides[1].any():
                    area = sum(_area(self.capsule(side)) for side in sides)
                    if area < least:
                        best, least = sides[0], area
        return best

    def regrouped(self, groups: Indices) -> tuple[list[Capsule], Indices]:
        """Capsules around groups of triangles, and the number of its capsule for each triangle,
        which is with the one that it is deepest in."""
        best, least = (list[Capsule](), groups), math.inf
        for _ in range(SETTINGS.rounds):
            names, groups = np.unique(groups, return_inverse=True)
            capsules = [self.capsule(groups == k) for k in range(len(names))]
            area = sum(map(_area, capsules))
            if area >= least:
                break
            best, least = (capsules, groups), area
            away = np.array(
                [distances(self.points, c)[self.triangles].max(axis=1) for c in capsules]
            )
            groups = away.argmin(axis=0)
        return best

    def excess(self, capsules: list[Capsule]) -> tuple[Array, float]:
        """How far [m] each capsule reaches beyond the mesh at most, where it is in no other, and
        how far all of them do on average."""
        # Few commands need it, and it takes a while to import.
        from scipy.spatial import KDTree

        tree = KDTree(self.points)
        turn, tilt = np.meshgrid(
            np.linspace(0.0, 2 * math.pi, 24, endpoint=False), np.linspace(-1.5, 1.5, 11)
        )
        cos, found = np.cos(tilt), list[Array]()
        ball = np.stack([np.cos(turn) * cos, np.sin(tilt), np.sin(turn) * cos], axis=-1)
        for begin, end, radius in capsules:
            middles = begin + np.linspace(0.0, 1.0, 15)[:, None] * (end - begin)
            lifted = np.insert(middles, 1, 0.0, axis=1)[:, None]
            spots = (lifted + radius * ball.reshape(-1, 3)).reshape(-1, 3)
            outside = np.min([distances(spots, c) for c in capsules], axis=0) > -1e-9
            # The corners of small triangles are farther than the mesh, if by a little.
            found.append(tree.query(spots[outside])[0])
        most = np.array([away.max(initial=0.0) for away in found])
        return most, float(np.concatenate(found).mean())


def parts_of(corners: Array, most: int) -> tuple[list[Capsule], float]:
    """Capsules that cover a mesh of triangles (F, 3, 3) [m] in the object's frame, and how far [m]
    they reach beyond it at most.

    most: number of capsules; more than one must lessen that.
    """
    small = SmallTriangles.of(corners)
    capsules, groups = small.regrouped(np.zeros(len(small.triangles), np.intp))
    beyond, mean = small.excess(capsules)
    best, best_groups, least = capsules, groups, mean
    # Regrouping may leave a capsule without triangles.
    for _ in range(most - 1):
        side = small.split(groups == beyond.argmax())
        if side is None:
            break
        capsules, groups = small.regrouped(np.where(side, len(capsules), groups))
        beyond, mean = small.excess(capsules)
        if mean < (1 - SETTINGS.gain) ** (len(capsules) - len(best)) * least:
            best, best_groups, least = capsules, groups, mean
    points, triangles = small.points, small.triangles
    rounded = [_rounded(points[triangles[best_groups == k]], c) for k, c in enumerate(best)]
    return rounded, float(small.excess(rounded)[0].max())


def _rounded(corners: Array, capsule: Capsule) -> Capsule:
    """The capsule with rounded lengths, around the same triangles."""
    begin, end = (point.round(SETTINGS.digits) + 0.0 for point in capsule[:2])
    radius = float(distances(corners, (begin, end, 0.0)).max()) + SAME
    scale = 10**SETTINGS.digits
    return begin, end, math.ceil(radius * scale) / scale
