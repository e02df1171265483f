"""Writes the meshes of the example objects, in mm: hammer, bottle and box.

.venv/bin/python examples/objects/make_meshes.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np
from trimesh import Trimesh
from trimesh.creation import box, cylinder, revolve
from trimesh.transformations import rotation_matrix
from trimesh.util import concatenate


def hammer() -> Trimesh:
    """A handle along x, and a head along z on its end: two closed bodies."""
    handle = cylinder(9.0, 240.0, sections=24)
    handle.apply_transform(rotation_matrix(np.pi / 2, [0, 1, 0])).apply_translation([120, 0, 0])
    head = cylinder(13.0, 84.0, sections=24).apply_translation([253, 0, 0])
    return concatenate([handle, head])


def bottle() -> Trimesh:
    """A full bottle along z, its neck above."""
    outline = [[0, 0], [28, 0], [32, 6], [32, 115], [14, 150], [13, 185], [0, 185]]
    return revolve(np.array(outline, float), sections=36)


def carton() -> Trimesh:
    """A box of 120 x 40 x 60 mm."""
    return box([120.0, 40.0, 60.0])


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    for make in (hammer, bottle, carton):
        name = "box" if make is carton else make.__name__
        make().export(folder / f"{name}.stl")
