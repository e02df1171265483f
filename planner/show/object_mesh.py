"""The thrown object as triangles, for pictures in 3-D."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...models import Array, Indices
from ...models.robot import segment_distance
from ...problems import Scene, ThrownObject
from ...problems.meshes import read_stl


def object_mesh(thrown: ThrownObject) -> tuple[Array, Indices]:
    """Vertices (N, 3) [m] and faces (F, 3) of an object's mesh, or without one of its outline.

    In the frame of its CoM that pictures use: along the axis, up, and to its right.
    """
    if thrown.mesh is not None:
        points = read_stl(Path(thrown.mesh)).reshape(-1, 3)
    else:
        points = np.concatenate([_capsule(row) for row in thrown.capsules])
    points = points - [thrown.com, 0.0, 0.0]
    return points[:, [0, 2, 1]] * [1.0, 1.0, -1.0], np.arange(len(points)).reshape(-1, 3)


def _capsule(row: Array) -> Array:
    """Corners (3 F, 3) of the triangles of a capsule of an outline."""
    from trimesh.creation import icosphere

    ball = icosphere(2, row[4])
    begin, end = (np.insert(row[i : i + 2], 1, 0.0) for i in (0, 2))
    # The half of a ball towards either end: stretched between them.
    ahead = ball.vertices @ (end - begin) >= 0.0
    return np.asarray((ball.vertices + np.where(ahead[:, None], end, begin))[ball.faces.ravel()])


def half_thickness(scene: Scene) -> float:
    """Half the thickness [m] of the object between the pads."""
    bar = scene.object
    if not bar.outline:
        return bar.width / 2
    grasp = np.array([scene.grasp.offset, 0.0, 0.0])
    ends = np.insert(bar.capsules[:, :4].reshape(-1, 2, 2), 2, 0.0, axis=2)
    point = np.broadcast_to(grasp, (len(ends), 3))
    away = segment_distance(point, point, ends[:, 0], ends[:, 1])
    return float(bar.capsules[np.argmin(away - bar.capsules[:, 4]), 4])
