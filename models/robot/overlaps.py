"""How deep capsules of an arm's links may overlap: a capsule is rounder than the link in it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from ..body import Array, Flags, read_only
from .arm import Arm, CapsuleOverlap
from .capsules import segment_distance
from .in_space import SpatialArm

#: Random states of an arm at which the overlap of its capsules is measured, and the share of them
#: in which it is at most what is allowed.
STATES, USUAL = 200, 0.9
#: Random states at which links' surfaces are compared.
COMPARED = 1500
#: Side [m] of the cells in which surfaces, points about 4 mm from each other, are compared.
CELL = 0.005
#: Room [m] between a measured overlap and the least at which links were seen to touch.
ROOM = 1e-3
#: Measured overlap over the largest seen, of links that do not touch where theirs is largest.
DEEPER = 1.25
#: Least share of the states without a contact that a measured overlap allows. With less, the
#: capsules of the two links do not tell contacts.
TOLD = 0.2


@lru_cache(maxsize=8)
def shape_overlaps(arm: Arm) -> Array:
    """Overlap [m] that capsules of two links may have, (C, C); infinite where links adjoin.

    The arm's `overlaps` come first. Of other pairs, capsules that overlap in half of the states of
    all joints, or of those that throw, may overlap as deeply as they do in the share `USUAL` of
    these. Links adjoin that a joint joins, and links two joints apart whose capsules overlap like
    this or in the arm's posture. No link adjoins a body beside the arm.
    """
    frames, given = _frames(arm, STATES), {each.capsules: each.depth for each in arm.overlaps}
    allowed = np.full((len(arm.capsules), len(arm.capsules)), np.inf)
    for i, j, joints in _pairs(arm):
        if (known := given.get((i + 1, j + 1))) is None:
            depth, beside = _depths(arm, frames, i, j), joints == 0
            groups = (depth[:STATES], depth[STATES:-1])[: 1 if beside else 2]
            usual = [float(np.quantile(each, USUAL)) for each in groups if np.median(each) > 0.0]
            if joints == 2 and (usual or depth[-1] > 0.0):
                continue
            known = max(usual, default=0.0)
        allowed[i, j] = allowed[j, i] = known
    return read_only(allowed)


def measured_overlaps(arm: Arm, surfaces: Sequence[Array]) -> tuple[CapsuleOverlap, ...]:
    """How deep capsules may overlap, judged by the links' surfaces: less than at any contact that
    was seen, and not much deeper than without one.

    surfaces (N, 3) [m] each: points on what is in each capsule, in its link's frame. Of links two
    joints apart, and others whose capsules may overlap; none where capsules do not tell contacts,
    see `TOLD`.
    """
    frames = _frames(arm, COMPARED)[:, :COMPARED]
    usual, found = shape_overlaps(arm), list[CapsuleOverlap]()
    for i, j, joints in _pairs(arm):
        depth = np.maximum(_depths(arm, frames, i, j), 0.0)
        known = len(surfaces[i]) and len(surfaces[j])
        if not known or not depth.any() or not (joints == 2 or usual[i, j]):
            continue
        first, second = (frames[arm.capsules[k].link] for k in (i, j))
        touch = _touch(surfaces[i], surfaces[j], np.linalg.inv(first) @ second, depth > 0.0)
        free = depth[~touch]
        # Ends of ranges, between which the samples are, may be deeper.
        most, contact = DEEPER * free.max(initial=0.0), depth[touch].min(initial=math.inf)
        if contact < most:
            # States between the sampled ones touch before.
            most = max(contact - ROOM, 0.0)
        if free.size and np.mean(free <= most) >= TOLD:
            found.append(CapsuleOverlap((i + 1, j + 1), round(float(most), 4)))
    return tuple(found)


def _touch(one: Array, other: Array, placed: Array, where: Flags) -> Flags:
    """Whether two surfaces (N, 3) have points in a common cell, (S,), at poses (S, 4, 4) of the
    other in the first's frame; looked at `where` (S,) only."""
    low = one.min(axis=0)
    cells = np.zeros((np.ptp(one, axis=0) / CELL).astype(int) + 1, bool)
    cells[tuple(((one - low) / CELL).astype(int).T)] = True
    touch = where.copy()
    for state in np.flatnonzero(where):
        points = other @ placed[state, :3, :3].T + placed[state, :3, 3]
        at = np.floor((points - low) / CELL).astype(int)
        at = at[((at >= 0) & (at < cells.shape)).all(axis=1)]
        touch[state] = cells[tuple(at.T)].any()
    return touch


def _frames(arm: Arm, count: int) -> Array:
    """Frames of `SpatialArm` (joints + 2, S, 4, 4) in random states of all joints, in as many of
    those that throw, and in the posture."""
    low, high = np.array(arm.limits.position_min), np.array(arm.limits.position_max)
    every = np.random.default_rng(0).uniform(low, high, (count, arm.joints))
    posture, throwing = np.clip(arm.posture, low, high), np.array(arm.throwing_joints) - 1
    in_plane = np.tile(posture, (count, 1))
    in_plane[:, throwing] = every[:, throwing]
    return np.asarray(SpatialArm(arm).frames(np.vstack([every, in_plane, posture])))


def _pairs(arm: Arm) -> Iterator[tuple[int, int, int]]:
    """Indices of the capsules that no joint joins, and the number of joints between their links,
    0: one stands beside the arm."""
    for (i, one), (j, other) in itertools.combinations(enumerate(arm.capsules), 2):
        joints, beside = abs(one.link - other.link), one.beside or other.beside
        if joints > 1 or (joints and beside):
            yield i, j, 0 if beside else joints


def _depths(arm: Arm, frames: Array, i: int, j: int) -> Array:
    """Overlap (S,) [m] of two capsules in the states of `_frames`; below 0: a distance."""
    pair = arm.capsules[i], arm.capsules[j]
    ends = [
        frames[c.link][:, :3, :3] @ np.array(end) + frames[c.link][:, :3, 3]
        for c in pair
        for end in (c.begin, c.end)
    ]
    return pair[0].radius + pair[1].radius - segment_distance(*ends)
