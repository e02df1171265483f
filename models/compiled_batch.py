"""Batches in the compiled core: the same laws in the same steps, as C loops over throws."""

from __future__ import annotations

import ctypes

import numpy as np

from ..core import library
from .body import Array
from .release import BatchRelease, ReleaseBatch


class _Batch(ctypes.Structure):
    """`batch` of core/batch.c."""

    _fields_ = (
        *((name, ctypes.c_long) for name in ("count", "steps", "pieces", "rows", "width")),
        ("gap", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("shares", "grip", "numbers", "knots", "curves")),
        *((name, ctypes.c_void_p) for name in ("delays", "drift", "detach", "lost")),
    )


def compiled_batch(
    law: str, batch: ReleaseBatch, shares: Array, gap: float = 0.0
) -> BatchRelease | None:
    """N releases; None without the core, or for hands that are no cubics.

    law: a function of core/batch.c. shares: (2 K + 1,), or (2 K + 1, N), of the opening; gap:
    both as in `Opening`.
    """
    core = library()
    if core is None or not batch.hands.cubic():
        return None
    powers, axes, pieces, rows = batch.hands.coefficients.shape
    curves = np.zeros((4, pieces, rows, axes))
    curves[4 - powers :] = batch.hands.coefficients.transpose(0, 2, 3, 1)
    grip = batch.grip.force(shares * batch.grip.opening) / batch.grip.full
    delays = np.broadcast_to(batch.hands.delays, batch.count)
    drift = np.zeros((3, batch.count)) if batch.hands.drift is None else batch.hands.drift
    inputs = [
        np.ascontiguousarray(value, float)
        for value in (shares, grip, _numbers(batch), batch.hands.breaks, curves, delays, drift)
    ]
    detach, lost = np.empty((batch.count, 6)), np.empty(batch.count, bool)
    addresses = [array.ctypes.data for array in (*inputs, detach, lost)]
    function = getattr(core, law)
    function.restype = None
    width, steps = 1 if shares.ndim == 1 else batch.count, len(shares) // 2
    function(ctypes.byref(_Batch(batch.count, steps, pieces, rows, width, gap, *addresses)))
    return BatchRelease(detach, lost)


def _numbers(batch: ReleaseBatch) -> Array:
    """The law's numbers in the order of number_symbols, then grasp angle, opening, force."""
    body, contact = batch.body, batch.contact
    values = (
        *(body.mass, body.inertia, body.com_offset),
        *(contact.friction, contact.patch_radius, contact.torsion, contact.faces),
        *(batch.gravity, batch.grasp_angle, batch.opening, batch.force),
    )
    return np.array([np.broadcast_to(value, batch.count) for value in values], float)
