"""Planes between what moves and what it must not meet, chosen for a motion that is known.

A plane touches an obstacle from outside; its normal is one of a family of directions. A body that
is clear has the plane that leaves it the most room. One that is not, for some instants in a row,
has for all of them the plane that it is least far beyond: so it leaves on one side.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import groupby

import numpy as np
import numpy.typing as npt

from ...models import Array, Solid
from ..check import Track

#: Directions of planes: around the throw's plane, and tilted out of it by these angles [rad].
AROUND, TILTS = 32, (0.0, 0.4, -0.4, 0.8, -0.8)
#: A plane that nothing is beyond: normal x, z; offset of either end.
NOTHING = (0.0, 0.0, -1.0, -1.0)


@cache
def directions() -> tuple[Array, Array]:
    """Unit vectors (D, 3), and their length (D,) in the throw's plane."""
    around = np.linspace(0.0, 2 * np.pi, AROUND, endpoint=False)
    found = [
        (np.cos(a) * np.cos(tilt), np.sin(tilt), np.sin(a) * np.cos(tilt))
        for tilt in TILTS
        for a in around
    ]
    every = np.array(found)
    return every, np.hypot(every[:, 0], every[:, 2])


def planes_of(
    track: Track, body: int, solids: Sequence[tuple[Solid, float]], links: Sequence[int], count: int
) -> Array:
    """Planes (N, count, 4) for a body at the track's instants: n_x, n_z, offset of either end.

    solids: with their clearance [m]; links: bodies of the track that it must not meet. An end at
    (x, z) is clear where n_x x + n_z z >= its offset. Of the nearest `count` things.
    """
    normals, in_plane = directions()
    ends = track.ends[body]
    along = np.minimum(normals @ ends[0], normals @ ends[1]).T
    reach: list[Array] = []
    for solid, clearance in solids:
        far = solid.beyond(normals) + clearance + track.reach[body]
        reach.append(np.broadcast_to(far, along.shape))
    for link in links:
        far = np.maximum(*(normals @ end for end in track.ends[link])).T
        reach.append(far + track.radius[link] + track.radius[body])
    found = np.tile(np.array(NOTHING), (len(track.times), max(count, len(reach)), 1))
    room = np.full(found.shape[:2], np.inf)
    for k, far in enumerate(reach):
        score = (along - far) / in_plane
        best = _chosen(score)
        each = np.arange(len(best))
        room[:, k] = score[each, best]
        found[:, k, :2] = normals[best][:, [0, 2]]
        for end in (0, 1):
            found[:, k, 2 + end] = far[each, best] - normals[best, 1] * ends[end, 1]
    nearest = np.argsort(room, axis=1)[:, :count]
    return np.take_along_axis(found, nearest[:, :, None], axis=1)


def _chosen(score: Array) -> npt.NDArray[np.intp]:
    """The direction (N,) for each instant, by the room (N, D) that it leaves."""
    best: npt.NDArray[np.intp] = score.argmax(axis=1)
    meets = score.max(axis=1) < 0.0
    for inside, group in groupby(range(len(best)), key=lambda i: bool(meets[i])):
        if inside:
            instants = list(group)
            best[instants] = score[instants].min(axis=0).argmax()
    return best
