"""Objects from meshes: mass, CoM and inertia of a closed mesh, its outline as capsules, STL files.

`read_mesh` and `object_from` need trimesh (extra `objects`); the STL files that they write, in the
object's own frame, are read without it.
"""

from .body import (
    MeshChoices,
    MeshObject,
    covered_mesh,
    object_from,
    object_text,
    read_stl,
    stl_bytes,
)
from .capsules import mesh_parts
from .solid import read_mesh
