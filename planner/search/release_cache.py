"""Release tables in the cache folder: made once per scene structure, shared by processes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...models import SlidingPivot, rk4_step
from ...problems import Scene
from ..check import Mover, column_room
from ..compile import DAMAGED, cache_folder, digest, publish, source_of
from ..ocp import parameter_values
from .release_room import clears_column
from .releases import ARRAYS, Releases, ReleaseSampler
from .run_up import run_up
from .sparse import sparse_parents

#: What decides which releases are drawn for a scene, and where they go.
MAKERS = (ReleaseSampler, sparse_parents, run_up, clears_column, column_room, parameter_values)
LAWS = (SlidingPivot, rk4_step)


def stored(
    scene: Scene, mover: Mover, count: int, seed: int, draw: Callable[[], Releases]
) -> Releases:
    """The table of a scene from the cache, or drawn and put there.

    Its name is a hash of all that it depends on: not of the target, cup or tolerance. A
    damaged file is drawn again; without a cache folder nothing is kept.
    """
    folder = cache_folder()
    if folder is None:
        return draw()
    name = f"{_key(scene, mover, count, seed)}.npz"
    found = _read(folder / name)
    if found is None:
        found = draw()
        arrays = {key: getattr(found, key) for key in ARRAYS}
        publish(folder, name, lambda path: np.savez(path, **arrays))
    return found


def _key(scene: Scene, mover: Mover, count: int, seed: int) -> str:
    limits = mover.planning
    parts = (
        scene.object,
        scene.grasp,
        scene.patch,
        scene.gripper,
        scene.gravity,
        scene.workspace,
        scene.mesh.sticking_margin,
        scene.mesh.carry_max,
        scene.arm,
        mover.kinematics.coordinates,
        getattr(mover.kinematics, "throwing_joints", None),
        scene.hand,
        *(None if v is None else v.tolist() for v in vars(limits).values()),
        None if mover.start is None else mover.start.tolist(),
        count,
        seed,
    )
    return digest("releases", source_of(*MAKERS, *LAWS), *map(repr, parts))


def _read(path: Path) -> Releases | None:
    """The table in a file; None if it is not there or not whole."""
    try:
        with path.open("rb") as file, np.load(file) as arrays:
            found = [arrays[key] for key in ARRAYS]
            found = [a.astype(bool if a.dtype == bool else float) for a in found]
    except DAMAGED:
        return None
    if len({len(array) for array in found}) != 1 or not all(np.isfinite(a).all() for a in found):
        return None
    return Releases(*found)
