"""Exact releases of one throw by the non-smooth models, in the compiled core.

The sliding pivot takes Runge-Kutta steps. They end at kinks of the hand's motion and at starts and
ends of pivoting and sliding, which preserves their order; their number is doubled until the detach
state converges. The limit surface, first order in its steps, is extrapolated.
"""

from __future__ import annotations

import numpy as np

from ...core import GripC, LinkageC, ReleaseC, library
from ..body import Array
from ..trajectory import MovedHand, Trajectory
from .cases import Release, ReleaseBatch, ReleaseCase
from .grip import GripProfile
from .stepping import law_numbers

#: Rows for the nodes of a release without kinks; more than its steps and events.
ROOM = 800
#: The core's linkage of a hand without an arm.
_FREE = LinkageC(n=3)


def exact_pivot_release(case: ReleaseCase) -> Release:
    """The release by the non-smooth sliding pivot; no wrench."""
    rows, onset, lost = _row_count(case), np.empty(2), np.empty(1, np.int64)
    count = library().pivot_release(compiled_release(case), len(rows), rows, onset, lost)
    return Release.from_nodes(rows[:count], onset.tolist(), bool(lost[0]))


def exact_surface_release(case: ReleaseCase) -> Release:
    """The release by the time-stepping limit surface; no wrench, no onsets (see `slip_onset`)."""
    rows = _row_count(case)
    count = library().surface_release(compiled_release(case), len(rows), rows)
    if not count:
        raise MemoryError
    return Release.from_nodes(rows[:count])


def exact_detaches(
    case: ReleaseCase, batch: ReleaseBatch, delays: Array, *, surface: bool
) -> Array:
    """Detach states (N, 6) of a batch on a case's motion, by the time-stepping limit surface or the
    sliding pivot; NaN for an unreliable one.

    The batch's hands are ignored; delays (N,) [s]: of its openings after the case's.
    """
    turning = 0.0 if batch.hands.drift is None else batch.hands.drift[2]
    angle, delays_total = batch.grasp_angle, float(_path(case).delays) + delays
    values = (*law_numbers(batch), angle, delays_total, turning, batch.opening)
    numbers = np.column_stack([np.broadcast_to(value, batch.count) for value in values])
    numbers, detaches = np.ascontiguousarray(numbers), np.empty((batch.count, 6))
    if library().many_releases(
        compiled_release(case), int(surface), batch.count, numbers, detaches
    ):
        raise MemoryError
    return detaches


def relative_states(case: ReleaseCase, nodes: Array) -> Array:
    """Relative states (K + 1, 6) of the sliding pivot at `nodes` [s] of the opening.

    It takes one Runge-Kutta step between nodes, from sticking at the first. Its accuracy is that of
    an initial guess.
    """
    times, states = np.ascontiguousarray(nodes, float), np.empty((nodes.size, 6))
    library().pivot_track(compiled_release(case), nodes.size, times, states)
    return states


def _path(case: ReleaseCase) -> Trajectory:
    path = case.hand.path if isinstance(case.hand, MovedHand) else case.hand
    assert isinstance(path, Trajectory)
    return path


def _row_count(case: ReleaseCase) -> Array:
    """Number of rows for all nodes of a release, kinks included."""
    path = _path(case)
    kinks = path.kinks - path.delays
    inside = np.count_nonzero((kinks > 0.0) & (kinks < case.grip.opening))
    return np.empty((ROOM + inside, 7))


def compiled_release(case: ReleaseCase) -> ReleaseC:
    """The case for the core."""
    path = _path(case)
    arm, turning = _FREE, 0.0
    if isinstance(case.hand, MovedHand):
        arm, turning = case.hand.linkage, case.hand.turning
    motion, grip = path.core, _grip(case.grip)
    assert motion.n == arm.n
    release = ReleaseC(angle=case.grasp_angle, delay=float(path.delays), turning=turning)
    release.law[:] = law_numbers(case)
    release.attach(motion=motion, arm=arm, grip=grip)
    return release


def _grip(profile: GripProfile) -> GripC:
    """A grip force for the core."""
    curve = profile.curve
    if curve is None:
        return GripC(full=profile.full, opening=profile.opening, stretch=1.0)
    breaks, curves = (np.ascontiguousarray(values, float) for values in (curve.x, curve.c))
    pieces = curve.c.shape[1]
    grip_force = GripC(full=profile.full, opening=profile.opening, stretch=1.0, pieces=pieces)
    grip_force.attach(breaks=breaks, curves=curves)
    return grip_force
