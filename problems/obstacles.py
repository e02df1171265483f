"""Obstacles: boxes, spheres and capsules that arm and bar must not touch."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..models.robot import Solid, about_z
from .section import InputError, Section, quantity

#: Meaning of `size` for each kind.
SIZES = {
    "box": ("length, width and height", 3),
    "sphere": ("radius", 1),
    "capsule": ("radius, and distance of the centres of its ends", 2),
}


@dataclasses.dataclass(frozen=True)
class Obstacle(Section):
    """Something that arm, held bar and flying bar keep clear of, in the base frame; each under a
    heading [[obstacle]]. Without [robot] the throw's plane is y = 0, and only the bar has a shape.

    The bar may land on it or next to it: in the last 0.05 s of the flight it may come as near as it
    lands.
    """

    name: str = quantity("for messages")
    kind: str = quantity("shape; a capsule stands upright", choices=tuple(SIZES))
    size: tuple[float, ...] = quantity(
        "m; box: length, width, height along its x, y, z; sphere: radius; capsule: radius, and "
        "distance of the centres of its ends",
        above=0,
        most=100.0,
    )
    position: tuple[float, float, float] = quantity(
        "m, x, y, z of its centre", least=-100.0, most=100.0
    )
    yaw: float = quantity("degrees, rotation about z", degrees=True, default=0.0)
    pitch: float = quantity(
        "degrees, before that about its y axis; 90 lays a capsule along x",
        degrees=True,
        default=0.0,
    )
    clearance: float = quantity("m, from everything that moves", least=0, most=1.0, default=0.01)

    def check(self) -> None:
        """`size` has as many numbers as its kind requires."""
        said, count = SIZES[self.kind]
        if len(self.size) != count:
            raise InputError(f"size = {list(self.size)}: of a {self.kind} it must be [{said}]")

    @property
    def solid(self) -> Solid:
        """Its shape in the base frame."""
        cos, sin = math.cos(self.pitch), math.sin(self.pitch)
        tilt = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
        half, radius = np.array(self.size) / 2, 0.0
        if self.kind != "box":
            half, radius = np.zeros(3), self.size[0]
            half[2] = self.size[-1] / 2 if self.kind == "capsule" else 0.0
        return Solid(np.array(self.position), (about_z(self.yaw) @ tilt).T, half, radius)
