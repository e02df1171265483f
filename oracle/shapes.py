"""Distances between segments, boxes and outlines, by convex minimisation without cases."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .motion import Array

#: Number of ternary search steps for the minimum of a convex function on [0, 1].
THIRDS = 40


def least_along(function: Callable[[Array], Array], shape: tuple[int, ...]) -> Array:
    """Minima of convex functions of a share in [0, 1], an array of `shape` at once."""
    low, high = np.zeros(shape), np.ones(shape)
    for _ in range(THIRDS):
        one, two = low + (high - low) / 3, high - (high - low) / 3
        falls = function(one) > function(two)
        low, high = np.where(falls, one, low), np.where(falls, high, two)
    ends = [function(np.full(shape, share)) for share in (0.0, 1.0)]
    return np.min([function((low + high) / 2), *ends], axis=0)


def to_segment(p: Array, a: Array, b: Array) -> Array:
    """Distance (...) of points from segments a to b, each (..., d)."""
    d = b - a
    share = ((p - a) * d).sum(axis=-1) / np.maximum((d * d).sum(axis=-1), 1e-300)
    return np.linalg.norm(a + share.clip(0.0, 1.0)[..., None] * d - p, axis=-1)


def between_segments(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distance (...) of segments a to b from c to d: at an end, or where both are inside."""
    found = np.min(
        [to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b)], axis=0
    )
    u, v, w = b - a, d - c, a - c
    uu, uv, vv = (u * u).sum(axis=-1), (u * v).sum(axis=-1), (v * v).sum(axis=-1)
    uw, vw = (u * w).sum(axis=-1), (v * w).sum(axis=-1)
    size = uu * vv - uv**2
    safe = np.where(size > 1e-14, size, np.inf)
    s, t = (uv * vw - vv * uw) / safe, (uu * vw - uv * uw) / safe
    inside = (size > 1e-14) & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    apart = np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1)
    return np.where(inside, np.minimum(found, apart), found)


def to_box(a: Array, b: Array, centre: Array, axes: Array, half: Array) -> Array:
    """Distance (K,) of segments from a to b (K, 3) from a box; axes (3, 3): rows."""
    p, q = (a - centre) @ axes.T, (b - centre) @ axes.T

    def away(share: Array) -> Array:
        at = p + share[:, None] * (q - p)
        return np.linalg.norm(np.maximum(np.abs(at) - half, 0.0), axis=1)

    return least_along(away, (len(p),))


def outline(pose: Array, first: float, last: float, half: float) -> Array:
    """Corners (K, 4, 2) in turn of rectangles along the axes of poses (K, 3)."""
    return placed(rectangle(first, last, half), pose)


def rectangle(first: float, last: float, half: float) -> Array:
    """Corners (4, 2) in turn, along and across an axis."""
    return np.array([[first, -half], [last, -half], [last, half], [first, half]])


def placed(corners: Array, pose: Array) -> Array:
    """Corners (K, m, 2), given along and across the axes of poses (K, 3)."""
    (along, across), c, s = corners.T, np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
    x, z = c * along - s * across, s * along + c * across
    return np.stack([pose[:, :1] + x, pose[:, 1:2] + z], 2)


def inside(p: Array, corners: Array) -> Array:
    """Whether points (K, 2) are inside outlines (K, 4, 2) that go counter-clockwise."""
    edge, to = np.roll(corners, -1, axis=1) - corners, p[:, None] - corners
    return np.asarray((edge[..., 0] * to[..., 1] - edge[..., 1] * to[..., 0] > 0).all(axis=1))


def from_outline(p: Array, corners: Array) -> Array:
    """Distance (K,) of points (K, 2) from outlines (K, 4, 2); inside, how deep, below 0."""
    away = to_segment(p[:, None], corners, np.roll(corners, -1, axis=1)).min(axis=1)
    return np.where(inside(p, corners), -away, away)


def beyond_edges(one: Array, other: Array) -> Array:
    """How far (K,) outlines (K, 4, 2) are apart along the normals of the first one's edges."""
    edge = np.roll(one, -1, axis=1) - one
    normal = np.stack([edge[..., 1], -edge[..., 0]], axis=2)
    size = np.linalg.norm(normal, axis=2)
    normal /= np.maximum(size, 1e-300)[..., None]
    along = np.einsum("kec,kpc->kep", normal, other) - (normal * one).sum(axis=2)[..., None]
    return np.where(size > 0.0, along.min(axis=2), -np.inf).max(axis=1)


def between_outlines(one: Array, other: Array) -> Array:
    """Distance (K,) of outlines (K, 4, 2); how deep they overlap, below 0, where they do."""
    a, b = one[:, :, None], np.roll(one, -1, axis=1)[:, :, None]
    c, d = other[:, None], np.roll(other, -1, axis=1)[:, None]
    away = between_segments(*np.broadcast_arrays(a, b, c, d)).min(axis=(1, 2))
    depth = np.maximum(beyond_edges(one, other), beyond_edges(other, one))
    return np.where(depth < 0.0, depth, away)


def from_column(corners: Array, radius: float, height: float) -> Array:
    """Least of max(|x| - radius, z - height) (K,) on outlines (K, 4, 2)."""
    a, d = corners, np.roll(corners, -1, axis=1) - corners

    def beyond(share: Array) -> Array:
        at = a + share[..., None] * d
        return np.maximum(np.abs(at[..., 0]) - radius, at[..., 1] - height)

    return least_along(beyond, a.shape[:2]).min(axis=1)
