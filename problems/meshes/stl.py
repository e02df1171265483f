"""Binary STL files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...models import Array
from ..checks import InputError

#: A triangle of a binary STL file: normal, three corners, and two bytes without a meaning.
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
#: Bytes before the number of triangles.
HEADER = 80


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
