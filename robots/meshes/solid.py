"""Meshes from STL and OBJ files that enclose a volume, and how much of it they enclose twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array, Indices
from ...problems import InputError

#: Largest number of triangles: MuJoCo reads no more.
TRIANGLES = 200_000
#: Least volume of a mesh over the cube of its size; that of a flat one is 0 but for rounding.
VOLUME = 1e-12
#: Largest overlap of bodies over the mesh's volume: mass and inertia are as accurate.
OVERLAP = 1e-3
#: Lines across a mesh, a side of their square grid, along which overlaps are measured: at most.
LINES = 512
#: Most crossings of triangles with rows of that grid: half a GB of memory.
CROSSINGS = 5_000_000
#: Directions of these lines and of the grid: faces and edges of parts are along none of them.
TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


def read_mesh(file: Path) -> tuple[Any, float]:
    """A mesh (trimesh) from an STL or OBJ file, and the overlap of its bodies over its volume.

    The mesh may have several bodies, which may touch at corners, edges and faces. InputError for
    one that encloses no volume, and for bodies that overlap by more than `OVERLAP`.
    """
    try:
        import trimesh
    except ImportError:
        raise InputError("import-object: needs trimesh: pip install 'throwplan[objects]'") from None
    if file.suffix.lower() not in (".stl", ".obj"):
        raise InputError(f"{file}: must be an STL or OBJ file")
    if not file.is_file():
        raise InputError(f"{file}: no such file")
    try:
        with np.errstate(all="ignore"):
            mesh: Any = trimesh.load(file, force="mesh", process=True)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        corners, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as error:  # trimesh lets through whatever its readers raise.
        raise InputError(f"{file}: cannot be read as a mesh: {error}") from None
    if not len(faces) or not np.isfinite(corners).all():
        raise InputError(f"{file}: has no triangles, or corners that are no finite numbers")
    if len(faces) > TRIANGLES:
        raise InputError(f"{file}: has {len(faces)} triangles: must be at most {TRIANGLES}")
    if (gaps := _open_edges(faces, turned=True)).size:
        place = " ".join(f"{v:.6g}" for v in corners[gaps[0]].mean(axis=0))
        raise InputError(
            f"{file}: is not watertight: {len(gaps)} of its edges are open, one at {place}: its "
            "triangles must enclose the object without gaps, so that it has a volume (repair the "
            "mesh, for example with Blender's 3D-Print toolbox)"
        )
    with np.errstate(all="ignore"):
        if mesh.volume < 0.0:
            mesh.invert()
        faces = np.asarray(mesh.faces)
        flat = not mesh.volume > VOLUME * np.ptp(corners, axis=0).max() ** 3
    if flat or _open_edges(faces, turned=False).size:
        words = "its triangles must enclose one and all face outwards"
        raise InputError(f"{file}: has no volume: {words}")
    overlap = overlap_of(corners, faces)
    if overlap > OVERLAP:
        raise InputError(
            f"{file}: has bodies that overlap, or that face inwards, by {100 * overlap:.2g} % of "
            f"its volume, must be at most {100 * OVERLAP:g} %: this would count twice or be taken "
            "off: unite them (for example with Blender's Boolean modifier)"
        )
    return mesh, overlap


def _open_edges(faces: Indices, turned: bool) -> Indices:
    """Edges (E, 2) that triangles (F, 3) do not pass as often in one direction as in the other, or,
    if triangles may be turned around, an odd number of times.

    Where there are none, the surface is closed, also where bodies share corners, edges and faces.
    """
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    pairs, number = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    ways = np.ones(len(edges)) if turned else np.where(edges[:, 0] < edges[:, 1], 1.0, -1.0)
    times = np.bincount(number[edges[:, 0] != edges[:, 1]], ways[edges[:, 0] != edges[:, 1]])
    return pairs[np.flatnonzero(times % 2 if turned else times)]


def overlap_of(corners: Array, faces: Indices) -> float:
    """The volume that closed triangles (F, 3) of corners (N, 3) enclose more than once, or from
    outside, over the volume that they enclose.

    Along parallel lines the surface's winding number changes by one at each triangle; it is 1 in
    the object and 0 elsewhere. A line's part with another one is overlap.
    """
    turned = corners @ TURN
    low = turned.min(axis=0)
    size = np.ptp(turned, axis=0).max()
    rows = np.ptp(turned[faces, 1], axis=1).sum() / size
    points = (turned - low) / size * min(LINES, CROSSINGS / rows)
    # Corners by their second coordinate: rows of the grid cross the long side and a short one.
    ordered = points[faces[np.arange(len(faces))[:, None], points[faces, 1].argsort(axis=1)]]
    first, last = np.ceil(ordered[:, 0, 1]), np.ceil(ordered[:, 2, 1])
    own, row = _ranges(first, last)
    a, b, c = np.moveaxis(ordered[own], 1, 0)
    above = (row >= b[:, 1])[:, None]
    sides = np.sort(
        [_crossing(a, c, row), _crossing(np.where(above, b, a), np.where(above, c, b), row)], axis=0
    )
    which, column = _ranges(*np.ceil(sides))
    row, own = row[which], own[which]
    a, b, c = np.moveaxis(points[faces[own]], 1, 0)
    normal = np.cross(b - a, c - a)
    height = (
        a[:, 2]
        - (normal[:, 0] * (column - a[:, 0]) + normal[:, 1] * (row - a[:, 1])) / (normal[:, 2])
    )
    order = np.lexsort((height, column, row))
    winding = np.cumsum(-np.sign(normal[order, 2]))[:-1]
    length = np.diff(height[order])
    solid = float(length[winding > 0].sum())
    twice = float((length * np.maximum(winding - 1, -winding))[(winding < 0) | (winding > 1)].sum())
    return twice / solid if solid else 0.0


def _crossing(begin: Array, end: Array, row: Array) -> Array:
    """First coordinates at which sides from `begin` to `end` (N, 3) cross rows (N,)."""
    share = (row - begin[:, 1]) / (end[:, 1] - begin[:, 1])
    return np.asarray(begin[:, 0] + share * (end[:, 0] - begin[:, 0]))


def _ranges(first: Array, last: Array) -> tuple[Indices, Array]:
    """The whole numbers from `first` to before `last` (N,), all in a row, and whose each is."""
    count = (last - first).astype(np.intp)
    whose = np.repeat(np.arange(len(count)), count)
    return whose, np.arange(float(len(whose))) - np.repeat(np.cumsum(count) - count - first, count)
