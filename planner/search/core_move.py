"""All throws that free numbers `u` give, and one of them moved to a target by the compiled core."""

from __future__ import annotations

import ctypes
import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...core import MoveC, MovedC, SamplesC, address, library
from ...models import Array, Trajectory
from ...models.release import STEPPED_SURFACE, Release
from ...problems import Pose
from ..ocp import ReducedVariables
from ..throw import TICK, Samples, release_numbers, send

#: Exact throws of one move, the first included.
THROWS = 6
#: A throw must come nearer than this share of the least miss before it; else the next step is at
#: most half its length.
NEARER = 0.9
#: Nodes of a release besides those at kinks of the motion, as in core/release.c.
ROOM = 800


class MovedThrow(NamedTuple):
    """u (size,), the motion that it plans, what is sent for that, and the exact release."""

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
        goal; aim [m], [rad]: how near is near enough. None without such a throw.
        """
        move, found = self._fixed, self._buffers
        kept = np.ascontiguousarray(u, float), np.ascontiguousarray(slope, float)
        move.u, move.slope = map(address, kept)
        move.errors, move.aim[:], move.off[:] = slope.shape[1], aim, off.tolist()
        move.goal[:] = goal.plane_x, goal.z, 0.0 if goal.theta is None else goal.theta
        if library().move_throw(move, found) <= 0:
            return None
        *own, nodes = self._thrown(found)
        u, breaks, cubics = (array.copy() for array in own)
        planned, release = Trajectory(breaks, cubics, breaks), Release.from_nodes(nodes)
        if not move.surface:
            release = Release.from_nodes(nodes, list(found.onset), bool(found.lost))
        if not self._arm:
            return MovedThrow(u, planned, send(self._manipulator, planned), release)
        sent = Samples.known(*(array.copy() for array in self._sent(found)))
        return MovedThrow(u, planned, sent, release)

    @cached_property
    def _fixed(self) -> MoveC:
        """What all moves have in common."""
        scene, limits = self._scene, self._manipulator.hard.core
        release, turned = release_numbers(scene, self._manipulator)
        found = MoveC.from_buffer_copy(self._controls.core)
        found.surface, found.throws = scene.tolerance.model == STEPPED_SURFACE, THROWS
        found.nearer, found.gravity, found.turned = NEARER, scene.gravity, turned
        found.limits = ctypes.addressof(limits) if self._arm else None
        found.release = ctypes.addressof(release)
        found.kept = self._controls, limits, release
        return found

    @cached_property
    def _buffers(self) -> MovedC:
        """Room for the largest result."""
        n, brake = self._manipulator.size, self._manipulator.hard.longest_brake
        longest = self._controls.durations[1] + float(self._controls.opening.sum())
        room = math.ceil((longest + brake) / TICK) + 4
        sent, sizes = np.zeros((3, room, n)), (room, 6 * n * room, 4 * room, 7 * (ROOM + 4 * room))
        stages = self._fixed.stages
        planned = np.zeros(stages + 1), np.zeros((4, n, stages, 1))
        kept = [np.zeros(self._controls.size), *planned, *map(np.zeros, sizes)]
        found = MovedC(SamplesC.of(TICK, *sent), room)
        found.release_room = ROOM + 4 * room
        names = ("u", "breaks", "cubics", "times", "curves", "kinks", "nodes_at")
        for name, array in zip(names, kept, strict=True):
            setattr(found, name, address(array))
        found.kept = sent, kept
        return found

    def _thrown(self, found: MovedC) -> tuple[Array, ...]:
        """u, breaks and cubics of the planned motion, nodes of the release."""
        _, (u, breaks, cubics, *_, nodes) = found.kept
        return u, breaks, cubics, nodes.reshape(-1, 7)[: found.nodes]

    def _sent(self, found: MovedC) -> tuple[Array, ...]:
        """Of what an arm is sent: samples (3, K, n), times, quintics and kinks."""
        sent, (*_, times, curves, kinks, _) = found.kept
        rows, n = found.sent.rows, self._manipulator.size
        curves = curves[: 6 * n * (rows - 1)].reshape(6, n, rows - 1, 1)
        return sent[:, :rows], times[:rows], curves, kinks[: found.corners]
