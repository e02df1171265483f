"""[[obstacle]] and the arm itself: links, held bar and flying bar stay clear of them.

No constraint knows a shape. At each instant a body that a verdict found too near keeps on one side
of a plane, chosen for the motion that the solve starts from; the next verdict says whether the
planes were the right ones. A plane touches an obstacle from outside; its normal is one of a family
of directions. A body that is clear has the plane of largest clearance. One that is not, for some
instants in a row, has for all of them the plane of least penetration: so it leaves on one side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from typing import Any, Self

import casadi as ca
import numpy as np
import numpy.typing as npt

from ....models import Array
from ....models.robot import ArmCapsules, Solid
from ...throw import Throw
from ...throw.clearance import (
    BAR,
    LANDING,
    CollisionScene,
    SweptBodies,
    held_bar,
    pairs_of,
    swept_bodies,
)
from ...verdict import FLYING
from ..request import Request
from ..scene_constraint import BRAKE_SHARE, Brake, Flight, Instant, SceneConstraint, braked
from ..transcription import Interval, Node

#: Margin [m] for what lies between instants; `refinement.CLEAR` adds to it.
CLEAR_MARGIN = 0.003
#: Planes of a body at an instant: those of the nearest things.
PLANES = 2
#: Directions of the planes' normals around the throw's plane.
AROUND = 32
#: Angles [rad] by which they are tilted out of it.
TILTS = (0.0, 0.4, -0.4, 0.8, -0.8)
#: A plane that excludes nothing: normal x, z; offset of either end.
EMPTY = (0.0, 0.0, -1.0, -1.0)
#: Numbers of a plane.
PLANE = len(EMPTY)
#: Instants of a carry interval with constraints.
INSTANTS = 6
#: Times [s] in the brake with constraints; at most INSTANTS.
BRAKE = (0.0, 0.03, 0.06, 0.1, 0.15)
#: Instants of the flight with constraints.
FLIGHT = 32


@dataclass(frozen=True)
class CollisionAvoidance(SceneConstraint):
    """bodies: links and held bar that it holds for; flying: whether it holds for the flying bar."""

    bodies: tuple[str, ...]
    flying: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For bodies that a verdict found too reference."""
        bodies = request.refinement.bodies
        return cls(tuple(sorted(bodies - {FLYING})), FLYING in bodies) if bodies else None

    @property
    def linearised(self) -> bool:
        """The planes are those of a throw."""
        return True

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """The planes at all instants, for the throw that the solve starts from."""
        margin = CLEAR_MARGIN + request.refinement.margins["clear"]
        found: dict[str, Any] = {"clear_margin": margin, "brake_times": BRAKE}
        if self.bodies:
            found["planes"] = self._planes(request).ravel()
        if self.flying:
            found["flight_planes"] = _flight_planes(request).ravel()
        return found

    def in_interval(self, interval: Interval) -> None:
        """Links, hand and held bar at parts of the carry's intervals, and at later nodes."""
        s, k = interval.ocp.structure, interval.k
        for number in range(INSTANTS if k < s.carry else 1):
            at = Instant.of(interval, number / INSTANTS * interval.dt, "full")
            if number or k or s.free_start:
                self._avoid(interval, at.q, number, at if k < s.detach else None)

    def at_last(self, brake: Brake) -> None:
        """The arm in the brake."""
        if not self._links(brake.ocp.capsules):
            return
        braking = brake.ocp.each("braking")
        for number, time in enumerate(ca.vertsplit(brake.p("brake_times", len(BRAKE)))):
            q = braked(brake.place, brake.rate, time, braking, ca.fmin)
            self._avoid(brake, q, number, None)

    def in_flight(self, flight: Flight) -> None:
        """The flying bar, at even shares of the flight."""
        if not self.flying:
            return
        size, p = FLIGHT * PLANES * PLANE, flight.p
        planes = flight.stage_parameter("flight_planes", size, flight.ocp.structure.detach, 1)
        for i in range(FLIGHT):
            at = flight.after(flight.time * (i / (FLIGHT - 1)))
            cos, sin = ca.cos(at.theta), ca.sin(at.theta)
            ends = [
                (at.x + along * cos, at.z + along * sin) for along in (-p("behind"), p("ahead"))
            ]
            _avoid_planes(flight, ends, planes[i * PLANES * PLANE :])

    def _avoid(self, node: Node, q: ca.SX, number: int, held: Instant | None) -> None:
        """All bodies at coordinates q, the instant of that number; held: with the bar."""
        capsules = node.ocp.capsules
        links, ends = self._links(capsules), list[Any]()
        if links:
            assert capsules is not None
            ends += capsules.ends(node.stage.lift(*capsules.arm.link_angles(q)), links)
        if BAR in self.bodies:
            ends.append(None if held is None else _bar(held))
        if not ends:
            return
        size = len(ends) * PLANES * PLANE
        stages = node.ocp.structure.last + 1
        planes = node.stage_parameter("planes", INSTANTS * size, 0, stages)
        for body, pair in enumerate(ends):
            if pair is not None:
                begin = number * size + body * PLANES * PLANE
                _avoid_planes(node, [(x, z) for x, *_, z in pair], planes[begin:])

    def _links(self, capsules: ArmCapsules | None) -> list[int]:
        """Indices of its links among the arm's capsules."""
        names = () if capsules is None else capsules.names
        return [i for i, name in enumerate(names) if name in self.bodies]

    def _planes(self, request: Request) -> Array:
        """Planes (stages, INSTANTS, bodies, PLANES, PLANE) from rest to rest."""
        scene, manipulator, reference = request.scene, request.manipulator, request.reference
        bodies = self._links(manipulator.capsules)
        count = len(manipulator.capsules.names) if manipulator.capsules else 0
        if BAR in self.bodies:
            bodies = [*bodies, count]
        stages = scene.mesh.carry + len(request.nodes)
        if reference is None:
            return np.tile(EMPTY, (stages, INSTANTS, len(bodies), PLANES, 1))
        nodes = request.times(reference.opening_time)
        shares, lengths = np.arange(INSTANTS) / INSTANTS, np.diff(nodes, append=nodes[-1])
        times = nodes[:, None] + shares * lengths[:, None]
        q = reference.path.at(times.ravel()).pose
        q[:, -INSTANTS:][:, : len(BRAKE)] = _braking(request, reference, np.array(BRAKE))
        hand = manipulator.motion(q, 0 * q, 0 * q)[0]
        around = CollisionScene.of(scene, manipulator)
        track = swept_bodies(scene, around.capsules, times.ravel(), q, held_bar(scene, hand))
        pairs = pairs_of(manipulator.capsules) if manipulator.capsules else []
        found = [
            _planes_of(
                *(track, body, _solids(around, bar=body == count)),
                *([i for i, j in pairs if j == body], PLANES),
            )
            for body in bodies
        ]
        return np.stack(found, axis=1).reshape(stages, INSTANTS, len(bodies), PLANES, PLANE)


def _solids(around: CollisionScene, *, bar: bool) -> list[tuple[Solid, float]]:
    """What a body keeps off, with the clearance [m]."""
    return [(thing.solid, thing.clearance) for thing in around.things if thing.bar or not bar]


def _avoid_planes(node: Node, ends: Sequence[tuple[ca.SX, ca.SX]], planes: ca.SX) -> None:
    """Both ends of a body beyond its planes, the first PLANES of these."""
    for k in range(PLANES):
        plane = planes[k * PLANE : (k + 1) * PLANE]
        for (x, z), offset in zip(ends, (plane[2], plane[3]), strict=True):
            # An empty plane's offset is far below the margin.
            clearance = plane[0] * x + plane[1] * z - offset - node.p("clear_margin")
            node.subject_to("obstacle", clearance, low=0.0)


def _bar(held: Instant) -> list[tuple[ca.SX, float, ca.SX]]:
    """Ends x, y, z of the held bar's axis."""
    p = held.p
    x, z, cos, sin = held.bar_end
    length = p("ahead") + p("behind")
    return [(x - length * cos, 0.0, z - length * sin), (x, 0.0, z)]


def _braking(request: Request, reference: Throw, times: Array) -> Array:
    """Coordinates (n, N) at times (N,) [s] after the nodes of a throw."""
    end = request.times(reference.opening_time)[-1:]
    q, dq, _ = reference.path.at(end)
    return np.asarray(
        braked(q, dq, times, BRAKE_SHARE * request.manipulator.planning.ddq[:, None], np.minimum)
    )


def _flight_planes(request: Request) -> Array:
    """Planes (FLIGHT, PLANES, PLANE) of the flying bar; none just before the landing."""
    scene, manipulator, reference = request.scene, request.manipulator, request.reference
    if reference is None or not reference.lands:
        return np.tile(EMPTY, (FLIGHT, PLANES, 1))
    since = np.linspace(0.0, reference.landing.flight_time, FLIGHT)
    q = _braking(request, reference, since)
    around = CollisionScene.of(scene, manipulator)
    track = swept_bodies(scene, around.capsules, since, q, reference.flight(since), flying=True)
    bar, capsules = len(track.names) - 1, around.capsules
    pairs = pairs_of(capsules) if capsules else []
    links = [i for i, j in pairs if j == bar]
    found = _planes_of(track, bar, _solids(around, bar=True), links, PLANES)
    found[since > since[-1] - LANDING] = EMPTY
    return found


@cache
def _directions() -> tuple[Array, Array]:
    """Unit vectors (D, 3), and their length (D,) in the throw's plane."""
    around = np.linspace(0.0, 2 * np.pi, AROUND, endpoint=False)
    found = [
        (np.cos(a) * np.cos(tilt), np.sin(tilt), np.sin(a) * np.cos(tilt))
        for tilt in TILTS
        for a in around
    ]
    every = np.array(found)
    return every, np.hypot(every[:, 0], every[:, 2])


def _planes_of(
    track: SweptBodies,
    body: int,
    solids: Sequence[tuple[Solid, float]],
    links: Sequence[int],
    count: int,
) -> Array:
    """Planes (N, count, 4) for a body at the track's instants: n_x, n_z, offset of either end.

    solids: with their clearance [m]; links: bodies of the track that it must not meet. An end at
    (x, z) is clear where n_x x + n_z z >= its offset. Of the nearest `count` things.
    """
    normals, in_plane = _directions()
    ends = track.ends[body]
    along = np.minimum(normals @ ends[0], normals @ ends[1]).T
    reach: list[Array] = []
    for solid, clearance in solids:
        far = solid.support(normals) + clearance + track.reach[body]
        reach.append(np.broadcast_to(far, along.shape))
    for link in links:
        far = np.maximum(*(normals @ end for end in track.ends[link])).T
        reach.append(far + track.radius[link] + track.radius[body])
    found = np.tile(np.array(EMPTY), (len(track.times), max(count, len(reach)), 1))
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
