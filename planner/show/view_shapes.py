"""Shapes of the 3-D view that viser has not: links between two points, a round cup."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Pieces that a circle is drawn with.
SEGMENTS = 48


def rgb(colour: str) -> tuple[int, int, int]:
    """A colour '#rrggbb' as three numbers to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def turn_to(direction: Array) -> Array:
    """A rotation matrix whose z axis has the direction."""
    z = direction / np.linalg.norm(direction)
    other = np.eye(3)[np.abs(z).argmin()]
    x = np.cross(other, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def quaternion(turn: Array) -> Array:
    """(w, x, y, z) of a rotation matrix."""
    from viser.transforms import SO3

    return np.asarray(SO3.from_matrix(turn).wxyz)


def rod(scene: Any, name: str, ends: tuple[Array, Array], radius: float, colour: str) -> None:
    """A rod between two points of the frame that `name` lies in, round at its end."""
    begin, end = ends
    scene.add_cylinder(
        f"{name}/rod",
        radius,
        float(np.linalg.norm(end - begin)),
        rgb(colour),
        wxyz=quaternion(turn_to(end - begin)),
        position=(begin + end) / 2,
    )
    scene.add_icosphere(f"{name}/end", radius, rgb(colour), subdivisions=3, position=end)


def turned_shape(profile: Array) -> tuple[Array, npt.NDArray[np.int_]]:
    """Vertices (V, 3) and triangles (F, 3) of a profile (k, 2), r and z, turned about z."""
    angles = np.linspace(0.0, 2 * np.pi, SEGMENTS, endpoint=False)
    r, z = profile[:, 0], profile[:, 1]
    circles = [
        np.outer(np.cos(angles), r),
        np.outer(np.sin(angles), r),
        np.broadcast_to(z, (SEGMENTS, len(r))),
    ]
    vertices = np.stack(circles, axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(SEGMENTS), np.arange(len(r) - 1), indexing="ij")
    here, there = i * len(r) + j, (i + 1) % SEGMENTS * len(r) + j
    upper = np.stack([here, there, there + 1], axis=-1)
    lower = np.stack([here, there + 1, here + 1], axis=-1)
    return vertices, np.concatenate([upper.reshape(-1, 3), lower.reshape(-1, 3)])


def cup_wall(radius: float, depth: float) -> Array:
    """Profile of a cup's bottom and inner wall, its rim at z = 0."""
    return np.array([[0.0, -depth], [radius, -depth], [radius, 0.0]])


def ring(radius: float, thickness: float) -> Array:
    """Profile of a torus of the given thickness around z = 0."""
    angle = np.linspace(0.0, 2 * np.pi, 13)
    half = thickness / 2
    return np.column_stack([radius + half + half * np.cos(angle), half * np.sin(angle)])
