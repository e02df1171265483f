"""Exact releases of one throw by the non-smooth models: in the compiled core, else in Python.

The sliding pivot goes in Runge-Kutta steps that end where the hand's motion has a kink and where
pivoting or sliding begins or ends, so that they keep their order; their number is doubled until the
detach state settles. The limit surface, first order in its steps, is extrapolated.
"""

from __future__ import annotations

import ctypes
import math
from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np

from ..core import GripC, LinkageC, ReleaseC, library
from .body import Array
from .path import INSIDE, MovedHand, Path
from .release import BLEW_UP, LOST, GripProfile, LinearRelease, Release, ReleaseCase
from .sliding_pivot import PivotSteps, SlidingPivot, world_release
from .stepping import graded, number_symbols, numbers, run_steps, step_function
from .time_stepping import SteppedRelease

#: Nodes of a release besides those at kinks: most steps and events of a run, as in core/release.c.
ROOM = 800
#: Steps without the core: of the sliding pivot, so many of them in a call, and of the finer of two
#: runs on the limit surface.
PIVOT_STEPS, BLOCK, SURFACE_STEPS = 1500, 64, 2000
#: A hand that moves by itself.
_FREE = LinkageC(3, 0, 0, 0.0, 0.0, 0.0)


def exact_pivot_release(case: ReleaseCase) -> Release:
    """The release by the non-smooth sliding pivot; no wrench."""
    core, made = library(), _compiled(case)
    if core is None or made is None:
        return _by_numpy(case)
    rows = np.empty((ROOM + _kinks(case).size, 7))
    onset, lost = (ctypes.c_double * 2)(), ctypes.c_int()
    pointers = ctypes.c_void_p(rows.ctypes.data), onset, ctypes.byref(lost)
    count = core.pivot_release(ctypes.byref(made), ctypes.c_long(len(rows)), *pointers)
    found = rows[:count].T.copy()
    trouble = LOST if lost.value else ""
    if not np.isfinite(found).all():
        trouble = BLEW_UP
    pivot, slide = (None if math.isnan(time) else time for time in onset)
    return Release(found[0], found[1:4], found[4:], pivot, slide, trouble=trouble)


def exact_surface_release(case: ReleaseCase) -> Release:
    """The release by the time-stepping limit surface; no wrench, no onsets (see `slip_onset`)."""
    core, made, count = library(), _compiled(case), 0
    if core is not None and made is not None:
        rows = np.empty((ROOM + _kinks(case).size, 7))
        pointer = ctypes.c_void_p(rows.ctypes.data)
        count = core.surface_release(ctypes.byref(made), ctypes.c_long(len(rows)), pointer)
    if count:
        found = rows[:count].T.copy()
    else:
        runs = [SteppedRelease(n).release(case) for n in (SURFACE_STEPS // 2, SURFACE_STEPS)]
        coarse, fine = (np.vstack([run.com, run.com_twist]) for run in runs)
        every = slice(None, None, SURFACE_STEPS // 200)
        states = 2 * fine[:, ::2] - coarse
        found = np.vstack([runs[0].times, states])[:, every]
    trouble = "" if np.isfinite(found).all() else BLEW_UP
    return Release(found[0], found[1:4], found[4:], trouble=trouble)


def relative_states(case: ReleaseCase, nodes: Array) -> Array:
    """Relative states (K + 1, 6) of the sliding pivot at `nodes` [s] of the opening.

    One Runge-Kutta step from each node to the next, from sticking at the first: rough
    where the nodes are, for starting points.
    """
    core, made = library(), _compiled(case)
    if core is not None and made is not None:
        times, states = np.ascontiguousarray(nodes, float), np.empty((nodes.size, 6))
        pointers = (ctypes.c_void_p(rows.ctypes.data) for rows in (times, states))
        core.pivot_track(ctypes.byref(made), ctypes.c_long(nodes.size), *pointers)
        return states
    return _stepped(case, nodes)


def _by_numpy(case: ReleaseCase) -> Release:
    """The sliding pivot in steps so many that they need no nodes at its events."""
    law, opening = SlidingPivot(case.body, case.contact, case.gravity), case.grip.opening
    nodes = np.union1d(opening * graded(PIVOT_STEPS, 1.5), _kinks(case))
    states, forces = _stepped(case, nodes), case.grip.force(nodes)
    return replace(world_release(law, case.hand.at(nodes), states.T, forces), wrench=None)


def _stepped(case: ReleaseCase, nodes: Array) -> Array:
    """Relative states (K, 6) of the sliding pivot at `nodes`, by CasADi's machine."""
    filling = np.full(-(nodes.size - 1) % BLOCK, nodes[-1])
    filled = np.concatenate([nodes, filling])
    dt = np.diff(filled)
    inside = np.minimum(INSIDE, dt / 4)
    times = np.column_stack([filled[:-1] + inside, filled[:-1] + dt / 2, filled[1:] - inside])
    hand, force = case.hand.at(times.ravel()), case.grip.force(times.ravel())
    rows = np.vstack([hand.pose, hand.twist, hand.acceleration, force]).T.reshape(-1, 30)
    columns, states = np.column_stack([rows, dt]).T, np.zeros((6, 1))
    states[2] = case.grasp_angle
    for first in range(0, dt.size, BLOCK):
        part = columns[:, first : first + BLOCK]
        found = run_steps(_steps(), states[:, -1], part, numbers(case))
        states = np.hstack([states, found[:, 1:]])
    return np.asarray(states.T[: nodes.size])


@cache
def _steps() -> ca.Function:
    p, body, contact, gravity = number_symbols()
    return step_function(PivotSteps(SlidingPivot(body, contact, gravity)), p, BLOCK)


def _path(case: ReleaseCase) -> Path | None:
    hand = case.hand.path if isinstance(case.hand, MovedHand) else case.hand
    return hand if isinstance(hand, Path) else None


def _kinks(case: ReleaseCase) -> Array:
    """Where the hand's acceleration or jerk may step, from the opening's start [s]."""
    path = _path(case)
    kinks = np.empty(0) if path is None else path.kinks - path.delays
    return np.asarray(kinks[(kinks > 0.0) & (kinks < case.grip.opening)])


def _compiled(case: ReleaseCase) -> ReleaseC | None:
    """The case as the core takes it, without owning its arrays; None where it cannot."""
    path = _path(case)
    motion = None if path is None else path.core
    arm = case.hand.linkage if isinstance(case.hand, MovedHand) else _FREE
    if path is None or motion is None or arm is None or motion.n != arm.n:
        return None
    grip = _grip(case.grip)
    found = ReleaseC(ctypes.addressof(motion), ctypes.addressof(arm), grip)
    found.law[:] = numbers(case)[:, 0].tolist()
    found.angle, found.delay = case.grasp_angle, float(path.delays)
    found.kept = motion, arm, grip
    return found


def _grip(profile: GripProfile) -> GripC:
    """A grip force as the core takes it."""
    if isinstance(profile, LinearRelease):
        return GripC(profile.full, profile.opening)
    curve = profile.curve
    arrays = [np.ascontiguousarray(values, float) for values in (curve.x, curve.c)]
    addresses = (values.ctypes.data for values in arrays)
    found = GripC(profile.full, profile.opening, curve.c.shape[1], *addresses)
    found.arrays = arrays
    return found
