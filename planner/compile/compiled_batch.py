"""Batches of throws in compiled code, where a C compiler is there.

The steps are those of `models.step_batch`: the same laws are called with CasADi symbols, and
what they do is written out as C loops over a block of throws (batch_functions, lane_code).
C text around them moves the hands, counts the steps and lets Newton's method run until a
whole block has settled (batch_text).
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import (
    SLIDING_PIVOT,
    STEPPED_SURFACE,
    BatchRelease,
    EvenSteps,
    Path,
    ReleaseBatch,
    graded,
    with_middles,
)
from .batch_functions import source
from .compiler import compiler, shared_library
from .lane_code import FLAGS

Array = npt.NDArray[np.float64]

#: From so many throws on compiled code pays: a process needs 0.05 s to find its library
#: again (0.4 s to make it, once), in which NumPy throws about 3000 (sp) or 600 (ls-step).
PAYS_FROM = 2000


class _Batch(ctypes.Structure):
    """`batch` of the C text."""

    _fields_ = (
        *((name, ctypes.c_long) for name in ("count", "steps", "pieces", "rows")),
        *(
            (name, ctypes.c_void_p)
            for name in ("shares", "grip", "numbers", "knots", "curves", "delays", "detach", "lost")
        ),
    )


def compiled_steps(model: str, hands: Path) -> EvenSteps | None:
    """The steps of `sp` or `ls-step` in compiled code; None where that is not to be had:
    no compiler, another model, hands that are no cubics."""
    if model not in _RUNS or not hands.cubic():
        return None
    library = _library(compiler())
    return None if library is None else partial(_RUNS[model], library)


def _pivot_steps(library: ctypes.CDLL, batch: ReleaseBatch, steps: int) -> BatchRelease:
    instants = with_middles(graded(steps))
    return _throw(library.sliding_pivot, batch, steps, instants, instants)


def _surface_steps(library: ctypes.CDLL, batch: ReleaseBatch, steps: int) -> BatchRelease:
    instants = np.linspace(0.0, 1.0, steps + 1)
    middles = (instants[:-1] + instants[1:]) / 2
    return _throw(library.limit_surface, batch, steps, instants, middles)


_RUNS = {SLIDING_PIVOT: _pivot_steps, STEPPED_SURFACE: _surface_steps}


def _throw(
    function: Callable[..., Any],
    batch: ReleaseBatch,
    steps: int,
    instants: Array,
    gripped: Array,
) -> BatchRelease:
    """`instants`: shares of the opening at which the hands are asked for; `gripped`: the grip."""
    powers, axes, pieces, rows = batch.hands.coefficients.shape
    curves = np.zeros((4, pieces, rows, axes))
    curves[4 - powers :] = batch.hands.coefficients.transpose(0, 2, 3, 1)
    grip = batch.grip.force(gripped * batch.grip.opening) / batch.grip.full
    delays = np.broadcast_to(batch.hands.delays, batch.count)
    inputs = [
        np.ascontiguousarray(value, float)
        for value in (instants, grip, _numbers(batch), batch.hands.breaks, curves, delays)
    ]
    detach, lost = np.empty((batch.count, 6)), np.empty(batch.count, bool)
    addresses = [array.ctypes.data for array in (*inputs, detach, lost)]
    function(ctypes.byref(_Batch(batch.count, steps, pieces, rows, *addresses)))
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


@cache
def _library(command: str | None) -> ctypes.CDLL | None:
    """The laws compiled by `command`; for this processor, or for any where it refuses that."""
    if command is None:
        return None
    text = source()
    for flags in ((*FLAGS, "-march=native"), FLAGS):
        path = shared_library(text, flags)
        if path is not None:
            library = ctypes.CDLL(str(path))
            library.sliding_pivot.restype = library.limit_surface.restype = None
            return library
    return None
