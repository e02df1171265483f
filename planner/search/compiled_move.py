"""A solved throw moved to a target by the compiled core, along the slope of its numbers `u`."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...core import MoveC, MovedC, SamplesC, library
from ...models import Array, Trajectory
from ...models.release import STEPPED_SURFACE, Release
from ...problems import Pose
from ..ocp import ReducedVariables
from ..throw import TICK, Samples, release_numbers, send

#: Most exact throws of one move, the first included.
THROWS = 6
#: The next step is cut to half or less if a throw misses by over this share of the least miss.
MIN_PROGRESS = 0.9
#: Most nodes of a release besides those at kinks of the motion, as in core/release.c.
MAX_NODES = 800


class MovedThrow(NamedTuple):
    """u (size,), its planned motion, the samples sent for that motion, and the exact release."""

    u: Array
    planned: Trajectory
    samples: Samples
    release: Release


class ThrowFamily:
    """Moves throws of `u` to targets: controls, motion, samples, exact throw and correction in C.

    Along the slope of `u` Newton steps bring the exact throw to the goal; their matrix is learnt
    from the throws themselves (Broyden's method). Constraints are not checked here.
    """

    def __init__(self, controls: ReducedVariables) -> None:
        request = controls.request
        self._controls, self._manipulator = controls, request.manipulator
        self._arm = self._manipulator.hard.jerk is not None
        self._scene = request.scene

    def moved(
        self, u: Array, slope: Array, off: Array, goal: Pose, aim: tuple[float, float]
    ) -> MovedThrow | None:
        """The throw of the family that lands at the goal, by the model that counts.

        u (size,) and slope (size, 1 or 2): of a throw that lands `off` (x [m], theta [rad]) the
        goal; aim [m], [rad]: the largest error. None without such a throw.
        """
        move, found = self._fixed, self._buffers
        move.errors, move.aim[:], move.off[:] = slope.shape[1], aim, off.tolist()
        begin, along = np.ascontiguousarray(u, float), np.ascontiguousarray(slope, float)
        move.attach(u=begin, slope=along)
        # The core's landings are the release model's, without the bias of [calibration].
        dx, dtheta = self._scene.flight.bias or (0.0, 0.0)
        theta = 0.0 if goal.theta is None else goal.theta
        move.goal[:] = goal.plane_x - dx, goal.z, theta - dtheta
        if library().move_throw(move, found) <= 0:
            return None
        u, breaks, cubics = (found.kept[name].copy() for name in ("u", "breaks", "cubics"))
        nodes = found.kept["nodes_at"][: found.nodes]
        planned, release = Trajectory(breaks, cubics, breaks), Release.from_nodes(nodes)
        if not move.surface:
            release = Release.from_nodes(nodes, list(found.onset), bool(found.lost))
        if not self._arm:
            return MovedThrow(u, planned, send(self._manipulator, planned), release)
        return MovedThrow(u, planned, self._sent(found), release)

    @cached_property
    def _fixed(self) -> MoveC:
        """The arguments that are equal for all moves."""
        scene, limits = self._scene, self._manipulator.hard.core
        release = release_numbers(scene, self._manipulator)
        found = self._controls.core.copy()
        found.surface, found.throws = scene.tolerance.model == STEPPED_SURFACE, THROWS
        found.nearer, found.gravity = MIN_PROGRESS, scene.gravity
        found.attach(limits=limits if self._arm else None, release=release)
        return found

    @cached_property
    def _buffers(self) -> MovedC:
        """Room for the largest result."""
        n, brake = self._manipulator.size, self._manipulator.hard.longest_brake
        longest = self._controls.durations[1] + float(np.ptp(self._controls.request.nodes))
        room = math.ceil((longest + brake) / TICK) + 4
        stages, size, rows = self._fixed.stages, self._controls.size, MAX_NODES + 4 * room
        samples = np.zeros((3, room, n))
        found = MovedC(room=room, stages=stages, size=size, release_room=rows)
        found.attach(
            sent=SamplesC.of(TICK, *samples),
            u=np.zeros(size),
            breaks=np.zeros(stages + 1),
            cubics=np.zeros((4, n, stages, 1)),
            times=np.zeros(room),
            curves=np.zeros(6 * n * room),
            kinks=np.zeros(4 * room),
            nodes_at=np.zeros((rows, 7)),
        )
        found.samples = samples
        return found

    def _sent(self, found: MovedC) -> Samples:
        """The samples that an arm is sent."""
        rows, n, kept = found.sent.rows, self._manipulator.size, found.kept
        samples = found.samples[:, :rows]
        curves = kept["curves"][: 6 * n * (rows - 1)].reshape(6, n, rows - 1, 1)
        arrays = samples, kept["times"][:rows], curves, kept["kinks"][: found.corners]
        return Samples.known(*(array.copy() for array in arrays))
