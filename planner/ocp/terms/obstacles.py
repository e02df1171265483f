"""[[obstacle]] and the arm itself: rows that keep links, held bar and flying bar clear of them.

No row knows a shape. At each instant a body that the check found too near keeps on one side of a
plane (`planes`), chosen for the motion that the solve starts from; the next check says whether they
were the right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import ArmCapsules, Array, FlightState, Solid
from ...check import (
    BAR,
    LANDING,
    Around,
    Margin,
    Throw,
    Violation,
    contacts,
    held_bar,
    pairs_of,
    track_of,
)
from ..asked import Request
from ..context import BRAKE_SHARE, Context, Instant, Term
from ..planes import NOTHING, planes_of
from ..stages import Stage

#: Kept back [m] for what lies between instants; how it grows, by GROWTH [m] in a step at most.
CLEAR_MARGIN = 0.003
MARGIN = Margin("clear", more=0.003, most=0.05)
GROWTH = 0.005
#: Planes per body and instant: of the two things that are nearest.
PLANES = 2
#: Numbers of a plane; instants of a stage's interval that have some.
PLANE, SLOTS = len(NOTHING), 6
#: Times [s] in the brake with rows; instants of the flight with rows.
BRAKE = (0.0, 0.03, 0.06, 0.1, 0.15)
FLIGHT = 32
#: The bar after detach, among names of bodies.
FLYING = "flying bar"


@dataclass(frozen=True)
class Clear(Term):
    """bodies: links and held bar that have rows; flying: whether the bar has them in flight."""

    bodies: tuple[str, ...]
    flying: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with obstacles, and an arm whose shape is known."""
        near = request.asked.near
        if request.mover.capsules is None and not request.scene.obstacle and not near:
            return None
        return cls(tuple(sorted(near - {FLYING})), FLYING in near)

    @property
    def local(self) -> bool:
        """Where it has rows."""
        return bool(self.bodies) or self.flying

    def numbers(self, request: Request) -> dict[str, Any]:
        """The planes at all instants, for the throw that the solve starts from."""
        margin = CLEAR_MARGIN + request.asked.margins["clear"]
        found: dict[str, Any] = {"clear_margin": margin, "brake_times": BRAKE}
        if self.bodies:
            found["planes"] = self._moving(request).ravel()
        if self.flying:
            found["flight_planes"] = _flown(request).ravel()
        return found

    def in_interval(self, context: Context, k: int, stage: Stage, dt: ca.SX) -> None:
        """Links, hand and held bar at parts of the carry's intervals, and at later nodes."""
        s = context.structure
        for number in range(SLOTS if k < s.carry else 1):
            at = context.instant(stage, number / SLOTS * dt, "full")
            if number or k or s.free_start:
                self._rows(context, stage, at.q, number, at if k < s.detach else None)

    def at_last(self, context: Context, stage: Stage, place: ca.SX, rate: ca.SX) -> None:
        """The arm in the brake."""
        if not self._links(context.capsules):
            return
        for number, time in enumerate(ca.vertsplit(context.parameters("brake_times", len(BRAKE)))):
            there = _braked(place, rate, time, context.each("braking"), ca.fmin)
            self._rows(context, stage, there, number, None)

    def in_flight(
        self, context: Context, stage: Stage, flight: FlightState, end: FlightState, time: ca.SX
    ) -> None:
        """The flying bar, at even shares of the flight."""
        if not self.flying:
            return
        planes = _data(context, stage, "flight_planes", FLIGHT, context.structure.detach)
        p = context.parameters
        for i in range(FLIGHT):
            at = flight.after(time * (i / (FLIGHT - 1)), context.gravity)
            cos, sin = ca.cos(at.theta), ca.sin(at.theta)
            ends = [
                (at.x + along * cos, at.z + along * sin) for along in (-p("behind"), p("ahead"))
            ]
            _keep_off(context, stage, ends, planes[i * PLANES * PLANE :])

    def broken(self, throw: Throw) -> list[Violation]:
        """What comes too near at any time from rest to rest and down to the landing."""
        found = []
        for contact in contacts(throw):
            depth, body = min(contact.missing, GROWTH), FLYING if contact.flying else contact.body
            found.append(Violation(contact.words, margin=MARGIN, depth=depth, near=body))
        return found

    def _rows(
        self, context: Context, stage: Stage, q: ca.SX, number: int, held: Instant | None
    ) -> None:
        """Rows of all bodies at coordinates q, the instant of that number; held: with the bar."""
        which, ends = self._links(context.capsules), list[Any]()
        if which:
            assert context.capsules is not None
            arm = context.capsules.arm
            ends += context.capsules.ends(stage.lift(*arm.turned(q)), which)
        if BAR in self.bodies:
            ends.append(None if held is None else _bar(held))
        if not ends:
            return
        size = len(ends) * PLANES * PLANE
        planes = _data(context, stage, "planes", SLOTS * len(ends), 0)
        for body, pair in enumerate(ends):
            if pair is not None:
                begin = number * size + body * PLANES * PLANE
                _keep_off(context, stage, [(x, z) for x, *_, z in pair], planes[begin:])

    def _links(self, capsules: ArmCapsules | None) -> list[int]:
        """Places of the links that have rows among the arm's capsules."""
        names = () if capsules is None else capsules.names
        return [i for i, name in enumerate(names) if name in self.bodies]

    def _moving(self, request: Request) -> Array:
        """Planes (stages, SLOTS, bodies, PLANES, PLANE) from rest to rest."""
        scene, mover, near = request.scene, request.mover, request.near
        bodies = self._links(mover.capsules)
        count = len(mover.capsules.names) if mover.capsules else 0
        if BAR in self.bodies:
            bodies = [*bodies, count]
        stages = scene.mesh.carry + len(request.nodes)
        if near is None:
            return np.tile(NOTHING, (stages, SLOTS, len(bodies), PLANES, 1))
        nodes = request.times(near.opening_time)
        times = (
            nodes[:, None] + np.arange(SLOTS) / SLOTS * np.diff(nodes, append=nodes[-1])[:, None]
        )
        q = near.path.at(times.ravel()).pose
        q[:, -SLOTS:][:, : len(BRAKE)] = _brake(request, near, np.array(BRAKE))
        hand = mover.motion(q, 0 * q, 0 * q)[0]
        around = Around.of(scene, mover)
        track = track_of(scene, around.capsules, times.ravel(), q, held_bar(scene, hand))
        pairs = pairs_of(mover.capsules, bar=True, flying=False) if mover.capsules else []
        found = [
            planes_of(
                *(track, body, _solids(around, bar=body == count)),
                *([i for i, j in pairs if j == body], PLANES),
            )
            for body in bodies
        ]
        return np.stack(found, axis=1).reshape(stages, SLOTS, len(bodies), PLANES, PLANE)


def _solids(around: Around, *, bar: bool) -> list[tuple[Solid, float]]:
    """What a body keeps off, with the clearance [m]."""
    return [(thing.solid, thing.clearance) for thing in around.things if thing.bar or not bar]


def _data(context: Context, stage: Stage, name: str, planes: int, first: int) -> ca.SX:
    """The stage's own planes, flat; stages from `first` on have some."""
    size = planes * PLANE * PLANES
    stages = context.structure.last + 1 - first if name == "planes" else 1
    context.parameters(name, size * stages)
    if name not in stage.data:
        stage.data[name] = ca.SX.sym(name, size), first
    return stage.data[name][0]


def _keep_off(
    context: Context, stage: Stage, ends: Sequence[tuple[ca.SX, ca.SX]], planes: ca.SX
) -> None:
    """Both ends of a body beyond its planes, the first PLANES of these."""
    for k in range(PLANES):
        plane = planes[k * PLANE : (k + 1) * PLANE]
        for (x, z), offset in zip(ends, (plane[2], plane[3]), strict=True):
            # Where there is nothing to meet the offset is far below the margin.
            clear = plane[0] * x + plane[1] * z - offset - context.parameters("clear_margin")
            stage.row("obstacle", clear, 0.0, np.inf)


def _bar(held: Instant) -> list[tuple[ca.SX, float, ca.SX]]:
    """Ends x, y, z of the held bar's axis."""
    p = held.context.parameters
    x, z, cos, sin = held.bar_end
    length = p("ahead") + p("behind")
    return [(x - length * cos, 0.0, z - length * sin), (x, 0.0, z)]


def _braked(q: Any, dq: Any, time: Any, braking: Any, lesser: Callable[[Any, Any], Any]) -> Any:
    """Coordinates `time` [s] into a brake from q, dq, each by itself, for symbols and numbers."""
    stop = (dq**2 + 1e-6) ** 0.5 / braking
    moving = lesser(time / stop, 1.0)
    return q + dq * stop * (moving - moving**2 / 2)


def _brake(request: Request, near: Throw, times: Array) -> Array:
    """Coordinates (n, N) at times (N,) [s] after the nodes of a throw."""
    end = request.times(near.opening_time)[-1:]
    q, dq, _ = near.path.at(end)
    return np.asarray(
        _braked(q, dq, times, BRAKE_SHARE * request.mover.planning.ddq[:, None], np.minimum)
    )


def _flown(request: Request) -> Array:
    """Planes (FLIGHT, PLANES, PLANE) of the flying bar; none just before the landing."""
    scene, mover, near = request.scene, request.mover, request.near
    if near is None or not near.lands:
        return np.tile(NOTHING, (FLIGHT, PLANES, 1))
    since = np.linspace(0.0, near.landing.flight_time, FLIGHT)
    q = _brake(request, near, since)
    around = Around.of(scene, mover)
    track = track_of(scene, around.capsules, since, q, near.flight(since), flying=True)
    bar, capsules = len(track.names) - 1, around.capsules
    pairs = pairs_of(capsules, bar=True, flying=True) if capsules else []
    links = [i for i, j in pairs if j == bar]
    found = planes_of(track, bar, _solids(around, bar=True), links, PLANES)
    found[since > since[-1] - LANDING] = NOTHING
    return found
