"""Meshes of objects: binary STL files, and a mesh in the capsules of an outline."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..models import Array, Indices
from .checks import InputError
from .grip import Object

#: A triangle of a binary STL file: normal, three corners, and two bytes without a meaning.
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
#: Bytes before the number of triangles of a binary STL file.
HEADER = 80
#: Points nearer to each other [m] are one.
SAME = 1e-6
#: A mesh may be outside its outline [m] by this: STL files round.
COVERED = 2e-5
#: Longest edge of a small triangle, over the mesh's size.
EDGE = 0.04
#: A capsule: begin, end (along, across) and radius [m].
Capsule = tuple[Array, Array, float]


def read_stl(path: Path) -> Array:
    """Corners (F, 3, 3) [m] of the triangles of a binary STL file, such as `import-object` writes.

    InputError naming the file.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    count = int.from_bytes(data[HEADER : HEADER + 4], "little")
    if not count or len(data) != HEADER + 4 + count * TRIANGLE.itemsize:
        raise InputError(f"{path}: must be a binary STL file, as import-object writes")
    corners = np.frombuffer(data, TRIANGLE, count, HEADER + 4)["corners"].astype(float)
    if not np.isfinite(corners).all():
        raise InputError(f"{path}: has corners that are no finite numbers")
    return np.asarray(corners)


def stl_bytes(corners: Array) -> bytes:
    """Triangles (F, 3, 3) [m] as a binary STL file."""
    rows = np.zeros(len(corners), TRIANGLE)
    rows["corners"] = corners
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    rows["normal"] = normal / np.where(size > 0.0, size, 1.0)
    return bytes(HEADER) + len(corners).to_bytes(4, "little") + rows.tobytes()


def covered_mesh(thrown: Object) -> Array:
    """Corners (F, 3, 3) [m] of the triangles of an object's mesh; InputError for one that is no STL
    file, or that its outline does not cover."""
    corners = read_stl(Path(str(thrown.mesh)))
    mesh_parts(corners, thrown)
    return corners


def mesh_parts(corners: Array, thrown: Object) -> list[Array]:
    """Points (N, 3) [m] of an object's mesh of triangles (F, 3, 3) by the capsule of its outline
    that they are in, for each that has some: their convex hulls are the mesh's convex parts.

    InputError for a mesh that the outline does not cover.
    """
    points, triangles = small_triangles(corners)
    capsules = [(row[:2], row[2:4], float(row[4])) for row in thrown.capsules]
    away = np.array([distances(points, c)[triangles].max(axis=1) for c in capsules])
    beyond = float(away.min(axis=0).max())
    if beyond > COVERED:
        raise InputError(
            f"mesh = {thrown.mesh}: reaches {1e3 * beyond:.2g} mm beyond the outline: must be in "
            "the object's frame, in m, as import-object writes it"
        )
    groups = away.argmin(axis=0)
    numbers = (triangles[groups == k] for k in range(len(capsules)))
    return [points[np.unique(own)] for own in numbers if own.size]


def small_triangles(corners: Array) -> tuple[Array, Indices]:
    """Points (N, 3) [m] of triangles (F, 3, 3) cut into small ones, and the numbers (G, 3) of the
    points of each."""
    small = _divided(corners, EDGE * float(np.ptp(corners, axis=(0, 1)).max()))
    flat = small.reshape(-1, 3)
    _, first, number = np.unique(
        (flat / SAME).round(), axis=0, return_index=True, return_inverse=True
    )
    return flat[first], number.reshape(-1, 3)


def _divided(corners: Array, edge: float) -> Array:
    """Triangles (F, 3, 3) cut at the middle of their longest edge until none is above `edge`."""
    done = list[Array]()
    while len(corners):
        sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        longest = sides.argmax(axis=1)
        small = sides.max(axis=1) <= edge
        done.append(corners[small])
        corners, longest = corners[~small], longest[~small]
        each = np.arange(len(corners))
        a, b, c = (corners[each, (longest + k) % 3] for k in range(3))
        middle = (a + b) / 2
        corners = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(done)


def distances(points: Array, capsule: Capsule) -> Array:
    """Distances (...) [m] of points (..., 3), along, y and across, from a capsule's surface; below
    0 inside."""
    begin, end, radius = capsule
    d, off = end - begin, points[..., ::2] - begin
    share = np.clip(off @ d / max(float(d @ d), 1e-18), 0.0, 1.0)
    away = np.linalg.norm(off - share[..., None] * d, axis=-1)
    return np.asarray(np.hypot(away, points[..., 1]) - radius)
