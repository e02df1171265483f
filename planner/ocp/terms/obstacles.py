"""[[obstacle]] and the arm itself: links, held bar and flying bar stay clear of them.

A verdict names the bodies that collide. At each instant such a body stays on one side of a plane
that touches an obstacle from outside. The planes are chosen for the motion that the solve starts
from, out of a fixed family of normals; the next verdict checks the result. A body clear of the
obstacle takes the plane of largest clearance. A body in the obstacle at successive instants takes
the plane of least penetration for all of them, and so leaves it on one side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np
import numpy.typing as npt

from ....models import Array
from ....models.robot import ArmCapsules, Solid
from ....problems import Scene
from ...throw import Throw
from ...verdict import BAR, FLYING, LANDING, CollisionScene, SweptBodies, bar_radii, held_bar
from ..request import Request
from ..scene_constraint import BRAKE_SHARE, Brake, Flight, Instant, SceneConstraint, braked
from ..transcription import Interval, Node, OutlinePoint


@dataclass(frozen=True)
class PlaneSettings:
    """Separating planes, and the instants at which they hold.

    margin [m]: covers the motion between instants; `request.CLEAR` adds to it. count:
    planes of a body at an instant, those of its nearest neighbours. around: directions of the
    normals in the plane of the throw. tilts [rad]: angles of the normals out of that plane. carry:
    instants of a carry interval. brake [s]: times in the brake, `carry` at most. flight: instants
    of the flight.
    """

    margin: float = 0.003
    count: int = 2
    around: int = 32
    tilts: tuple[float, ...] = (0.0, 0.4, -0.4, 0.8, -0.8)
    carry: int = 6
    brake: tuple[float, ...] = (0.0, 0.03, 0.06, 0.1, 0.15)
    flight: int = 32


SETTINGS = PlaneSettings()
#: A plane that excludes nothing: normal x, z; offset [m] of either end.
EMPTY = (0.0, 0.0, -1.0, -1.0)
#: Numbers of a plane.
SIZE = len(EMPTY)
#: Numbers of a body's planes at an instant.
BODY = SETTINGS.count * SIZE


@dataclass(frozen=True)
class CollisionAvoidance(SceneConstraint):
    """Separating planes of links and bar. bodies: links and held bar with planes; flying: the
    flying bar has planes too."""

    linearised: ClassVar[bool] = True
    bodies: tuple[str, ...]
    flying: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For the bodies that a verdict found too near; their planes at all instants, for the throw
        that the solve starts from."""
        bodies, values = request.refinement.bodies, dict[str, Any]()
        if not bodies:
            return None
        held, flying = tuple(sorted(bodies - {FLYING})), FLYING in bodies
        if held:
            values["planes"] = _planes(request, held).ravel()
        if flying:
            values["flight_planes"] = _flight_planes(request).ravel()
        margin = SETTINGS.margin + request.refinement.margins["clear"]
        values |= {"clear_margin": margin, "brake_times": SETTINGS.brake}
        return cls(values, held, flying)

    def in_interval(self, interval: Interval) -> None:
        """Links, hand and held bar at parts of the carry's intervals, and at later nodes."""
        s, k, links = interval.ocp.structure, interval.k, self._of_links(interval)
        for number in range(SETTINGS.carry if k < s.carry else 1):
            at = Instant.of(interval, number / SETTINGS.carry * interval.dt, "full")
            if number or k or s.free_start:
                self._avoid(interval, at.q, number, links, at if k < s.detach else None)

    def at_last(self, brake: Brake) -> None:
        """The arm in the brake."""
        links = self._of_links(brake)
        if links is None:
            return
        braking = brake.ocp.each("braking")
        for number, time in enumerate(ca.vertsplit(brake.p("brake_times", len(SETTINGS.brake)))):
            q = braked(brake.place, brake.rate, time, braking, ca.fmin)
            self._avoid(brake, q, number, links, None)

    def in_flight(self, flight: Flight) -> None:
        """The flying bar, at even shares of the flight."""
        if not self.flying:
            return
        p, size = flight.p, max(flight.ocp.structure.parts, 1) * BODY
        planes = flight.stage_parameter(
            "flight_planes", SETTINGS.flight * size, flight.ocp.structure.detach, 1
        )
        share, here = ca.SX.sym("share"), ca.SX.sym("planes", size)
        at = flight.after(flight.time * share)
        cos, sin = ca.cos(at.theta), ca.sin(at.theta)
        if flight.ocp.structure.parts:
            points = flight.ocp.outline_points(2)
        else:
            points = [OutlinePoint(-p("behind")), OutlinePoint(p("ahead"))]
        ends = [point.placed(at.x, at.z, cos, sin) for point in points]
        bodies = [ends[i : i + 2] for i in range(0, len(ends), 2)]
        each = ca.Function(
            "flying", [share, here], [_clearances(bodies, here)], {"allow_free": True}
        )
        for i, now in enumerate(np.linspace(0.0, 1.0, SETTINGS.flight)):
            self._subject_to(flight, each(now, planes[i * size : (i + 1) * size]))

    def _of_links(self, node: Node) -> ca.Function | None:
        """Clearances [m] of the links in `bodies`, of the links' angles and the planes.

        A function, since CasADi copies its expressions faster than Python writes them again.
        """
        capsules = node.ocp.capsules
        links = _links(capsules, self.bodies)
        if capsules is None or not links:
            return None
        angles = ca.SX.sym("angles", node.ocp.n)
        planes = ca.SX.sym("planes", len(links) * BODY)
        ends = capsules.ends(ca.vertsplit(angles), links)
        return ca.Function("links", [angles, planes], [_clearances(ends, planes)])

    def _avoid(
        self, node: Node, q: ca.SX, number: int, links: ca.Function | None, held: Instant | None
    ) -> None:
        """All bodies at coordinates q and instant `number`; links: see `_of_links`; held: the held
        bar, None after detach."""
        of_links = 0 if links is None else links.numel_in(1)
        parts = max(node.ocp.structure.parts, 1) if BAR in self.bodies else 0
        size, stages = of_links + parts * BODY, node.ocp.structure.last + 1
        if links is None and (held is None or not parts):
            return
        planes = node.stage_parameter("planes", SETTINGS.carry * size, 0, stages)
        here = planes[number * size : (number + 1) * size]
        if links is not None:
            angles = node.stage.lift(*node.ocp.kinematics.link_angles(q))
            self._subject_to(node, links(ca.vertcat(*angles), here[:of_links]))
        if held is not None and parts:
            self._subject_to(node, _clearances(_bar(held), here[of_links:]))

    def _subject_to(self, node: Node, clearances: ca.SX) -> None:
        node.subject_to("collision", clearances - node.p("clear_margin"), low=0.0)


def _links(capsules: ArmCapsules | None, bodies: Sequence[str]) -> list[int]:
    """Indices among the arm's capsules of the links in `bodies`."""
    names = () if capsules is None else capsules.names
    return [i for i, name in enumerate(names) if name in bodies]


def _clearances(bodies: Sequence[Sequence[Sequence[Any]]], planes: ca.SX) -> ca.SX:
    """Clearances [m] of both ends x, ..., z of each body from its planes, `count` of them.

    An empty plane's offset is far below the margin.
    """
    numbers, rows = ca.vertsplit(planes), []
    for i, begin in enumerate(range(0, len(numbers), SIZE)):
        normal_x, normal_z, *offsets = numbers[begin : begin + SIZE]
        for (x, *_, z), offset in zip(bodies[i // SETTINGS.count], offsets, strict=True):
            rows.append(normal_x * x + normal_z * z - offset)
    return ca.SX(ca.vertcat(*rows))


def _bar(held: Instant) -> list[list[tuple[ca.SX, float, ca.SX]]]:
    """Ends x, y, z of the axes of the held object's capsules, one for a bar."""
    p = held.p
    if held.ocp.structure.parts:
        points = [(x, 0.0, z) for x, z, _ in held.held_points()]
        return [points[i : i + 2] for i in range(0, len(points), 2)]
    x, z, cos, sin = held.bar_end
    length = p("ahead") + p("behind")
    return [[(x - length * cos, 0.0, z - length * sin), (x, 0.0, z)]]


def _planes(request: Request, bodies: Sequence[str]) -> Array:
    """Planes (stages, carry, bodies, count, SIZE) of links and held bar, from rest to rest."""
    scene, manipulator, reference = request.scene, request.manipulator, request.reference
    capsules, carry = manipulator.capsules, SETTINGS.carry
    moving = [*_links(capsules, bodies), *(_parts(scene) if BAR in bodies else [])]
    stages = scene.nlp.carry + len(request.nodes)
    if reference is None:
        return np.tile(EMPTY, (stages, carry, len(moving), SETTINGS.count, 1))
    nodes = request.times(reference.opening_time)
    lengths = np.diff(nodes, append=nodes[-1])
    times = (nodes[:, None] + np.arange(carry) / carry * lengths[:, None]).ravel()
    q = reference.path.at(times).pose
    q[:, -carry:][:, : len(SETTINGS.brake)] = _braking_coordinates(
        request, reference, np.array(SETTINGS.brake)
    )
    bar = held_bar(scene, manipulator.motion(q, 0 * q, 0 * q)[0])
    planes = _separating_planes(request, times, q, bar, moving)
    return planes.reshape(stages, carry, len(moving), SETTINGS.count, SIZE)


def _parts(scene: Scene) -> range:
    """Indices of the object's capsules, from the end of a track's bodies."""
    return range(-len(bar_radii(scene.object)), 0)


def _flight_planes(request: Request) -> Array:
    """Planes (flight, parts, count, SIZE) of the flying object; empty just before the landing."""
    reference, moving = request.reference, list(_parts(request.scene))
    if reference is None or not reference.lands:
        return np.tile(EMPTY, (SETTINGS.flight, len(moving), SETTINGS.count, 1))
    since = np.linspace(0.0, reference.landing.flight_time, SETTINGS.flight)
    q = _braking_coordinates(request, reference, since)
    planes = _separating_planes(request, since, q, reference.flight(since), moving, flying=True)
    planes[since > since[-1] - LANDING] = EMPTY
    return planes


def _braking_coordinates(request: Request, reference: Throw, times: Array) -> Array:
    """Coordinates (n, N) at times (N,) [s] after the nodes of a throw."""
    end = request.times(reference.opening_time)[-1:]
    q, dq, _ = reference.path.at(end)
    return np.asarray(
        braked(q, dq, times, BRAKE_SHARE * request.manipulator.planning.ddq[:, None], np.minimum)
    )


def _separating_planes(
    request: Request, times: Array, q: Array, bar: Array, moving: list[int], *, flying: bool = False
) -> Array:
    """Planes (N, bodies, count, SIZE) at N instants, for coordinates q (n, N), CoM poses of the bar
    (3, N), and the bodies `moving`: links by their indices, `_parts` for the object."""
    around = CollisionScene.of(request.scene, request.manipulator)
    track, planes = around.bodies_at(times, q, bar, flying=flying), list[Array]()
    for index in moving:
        body = index % len(track.names)
        solids = [(o.solid, o.clearance) for o in around.things if o.bar or index >= 0]
        links = [(i, apart) for i, j, apart in around.pairs(flying=flying) if j == body]
        planes.append(_planes_of(track, body, solids, links))
    return np.stack(planes, axis=1)


@cache
def _directions() -> tuple[Array, Array]:
    """Unit vectors (D, 3), and their length (D,) in the throw's plane."""
    angles = np.linspace(0.0, 2 * np.pi, SETTINGS.around, endpoint=False)
    directions = [
        (np.cos(a) * np.cos(tilt), np.sin(tilt), np.sin(a) * np.cos(tilt))
        for tilt in SETTINGS.tilts
        for a in angles
    ]
    every = np.array(directions)
    return every, np.hypot(every[:, 0], every[:, 2])


def _planes_of(
    track: SweptBodies,
    body: int,
    solids: Sequence[tuple[Solid, float]],
    links: Sequence[tuple[int, float]],
) -> Array:
    """Planes (N, count, SIZE) for a body at the track's instants: n_x, n_z, offset of either end.

    solids: with their clearance [m]; links: bodies of the track that it must not meet, with
    theirs. An end at (x, z) is clear if n_x x + n_z z >= its offset. The planes are those of the
    `count` nearest.
    """
    normals, in_plane = _directions()
    ends = track.ends[body]
    nearest_end = np.minimum(normals @ ends[0], normals @ ends[1]).T
    extents: list[Array] = []
    for solid, clearance in solids:
        extent = solid.support(normals) + clearance + track.radius[body]
        extents.append(np.broadcast_to(extent, nearest_end.shape))
    for link, clearance in links:
        extent = np.maximum(*(normals @ end for end in track.ends[link])).T
        extents.append(extent + track.radius[link] + track.radius[body] + clearance)
    planes = np.tile(EMPTY, (len(track.times), max(SETTINGS.count, len(extents)), 1))
    clearances = np.full(planes.shape[:2], np.inf)
    for k, extent in enumerate(extents):
        clearance_in_plane = (nearest_end - extent) / in_plane
        best = _choose_direction(clearance_in_plane)
        each = np.arange(len(best))
        clearances[:, k] = clearance_in_plane[each, best]
        planes[:, k, :2] = normals[best][:, [0, 2]]
        for end in (0, 1):
            planes[:, k, 2 + end] = extent[each, best] - normals[best, 1] * ends[end, 1]
    nearest = np.argsort(clearances, axis=1)[:, : SETTINGS.count]
    return np.take_along_axis(planes, nearest[:, :, None], axis=1)


def _choose_direction(clearance: Array) -> npt.NDArray[np.intp]:
    """Index (N,) of the direction at each instant, by the clearance (N, D) in each direction."""
    best: npt.NDArray[np.intp] = clearance.argmax(axis=1)
    collides = clearance.max(axis=1) < 0.0
    for inside, group in groupby(range(len(best)), key=lambda i: bool(collides[i])):
        if inside:
            instants = list(group)
            best[instants] = clearance[instants].min(axis=0).argmax()
    return best
