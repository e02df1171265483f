"""Limits on the flights of N throws of one motion: column, palm, cup, obstacles and links."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...core import ReferenceC, library
from ...models import Array, Flags, Indices
from ..throw import (
    TICK,
    BatchFlights,
    ThrowBatch,
    column_of,
)
from ..throw.clearance import (
    CollisionScene,
    bar_room,
    column_distance,
    palm_distance,
    reach_of_bar,
)
from .findings import Code
from .landing import least_cup_clearance
from .single import NEAR

#: Ticks of a window of flight; it has one clearance of the planned throw's bar.
WINDOW = 8


@dataclass(frozen=True)
class InFlight:
    """Judges flights of a batch; caches the clearances of the planned throw."""

    batch: ThrowBatch

    def judge(self, flights: BatchFlights, doubt: Array) -> tuple[dict[Code, Flags], Flags]:
        """Flags (N,) of the limits that flights break, and of those whose error bound straddles a
        limit.

        doubt (2, N): error bounds of their landings, x [m] and theta [rad].
        """
        scene, count = self.batch.scene, len(flights.late)
        lands = np.flatnonzero(np.isfinite(flights.landing[:, 2]))
        rows = self._rows(flights)[lands]
        wide = doubt[0, lands] + doubt[1, lands] * reach_of_bar(scene.object)
        broken, unsure = dict[Code, Flags](), np.zeros(count, bool)

        def add(code: Code, which: Indices, distance: Array, least: float, flags: Flags) -> None:
            broken[code] = np.zeros(count, bool)
            broken[code][lands[which]] = flags
            unsure[lands[which]] |= np.abs(distance - least) <= wide[which]

        every = np.arange(lands.size)
        column, palm, palm_time, cup, near = self._measure(rows).T
        workspace = scene.workspace
        if column_of(scene) is not None:
            add(Code.COLUMN, every, column, 0.0, column < -NEAR)
        if workspace is not None and workspace.palm_clearance is not None:
            add(Code.PALM, every, palm, workspace.palm_clearance, np.isfinite(palm_time))
        if scene.cup is not None:
            least, into = least_cup_clearance(scene.cup), np.isfinite(cup)
            add(Code.CUP_MISSED, every, np.full(lands.size, np.inf), 0.0, ~into)
            add(Code.CUP_WALL, every, cup, least, into & (cup <= least))
            # A bar that grazes the mouth may be inside or outside.
            unsure[lands] |= self._at_mouth(flights, lands, doubt[:, lands])
        some = np.flatnonzero(near)
        if some.size:
            lack = self._penetrations(rows[some])
            add(Code.COLLISION, some, lack, 0.0, lack > NEAR)
        return broken, unsure

    def _rows(self, flights: BatchFlights) -> Array:
        """BatchFlights (N, 17) in the layout of the core: `flown_sample` of structures.h."""
        given = (flights.opened, flights.freed, flights.landing[:, 2], flights.com, flights.cup)
        return np.hstack([np.column_stack(given), flights.start, flights.error])

    def _measure(self, rows: Array) -> Array:
        """(N, 5): distances to column and palm [m], first time [s] too near the palm, clearance in
        the cup [m], and whether obstacles or links may be near."""
        values, rows = np.empty((len(rows), 5)), np.ascontiguousarray(rows)
        library().measure_flights(self.batch.throw.core, self._reference, len(rows), rows, values)
        return values

    def _at_mouth(self, flights: BatchFlights, which: Indices, doubt: Array) -> Flags:
        """Flags of the throws whose lower end may pass on either side of the cup's rim.

        The lower end is taken at the instant of the CoM at the target's height.
        """
        scene = self.batch.scene
        assert scene.cup is not None
        bar, theta = scene.object, flights.landing[which, 1]
        lower = np.where(np.sin(theta) < 0, bar.length - bar.com, -bar.com)
        end = flights.landing[which, 0] + lower * np.cos(theta) - flights.cup[which]
        wide = doubt[0] + doubt[1] * reach_of_bar(bar)
        return np.asarray(np.abs(np.abs(end) - scene.cup.radius) <= wide)

    def _penetrations(self, rows: Array) -> Array:
        """Penetrations (N,) [m] of flights into the clearances of obstacles and links."""
        bodies = self._around.core()
        lack, rows = np.empty(len(rows)), np.ascontiguousarray(rows)
        if library().near_flights(self.batch.throw.core, bodies, len(rows), rows, lack):
            raise MemoryError
        return lack

    @cached_property
    def _reference(self) -> ReferenceC:
        """Clearances of the planned throw's bar to palm, column, and links and obstacles."""
        throw, scene, (early, late, longest) = self.batch.throw, self.batch.scene, self.batch.reach
        begin = throw.opening_time + min(early, 0.0)
        end = throw.landing_time + max(late, 0.0) + longest + throw.landing.flight_time
        count = math.ceil((end - begin) / (WINDOW * TICK))
        times = np.asarray(begin + TICK * np.arange(count * WINDOW + 1), float)
        com = throw.flight(times - throw.detach_time)
        none, column, workspace = np.full(times.size, np.inf), column_of(scene), scene.workspace
        clearances = [none, none, bar_room(throw, times, com, flying=True)]
        if workspace is not None and workspace.palm_clearance is not None and scene.arm is not None:
            hand = throw.hand(times).pose
            clearances[0] = palm_distance(scene.object, scene.arm.tool, com, hand)
            clearances[0] = clearances[0] - workspace.palm_clearance
        if column is not None:
            clearances[1] = column_distance(scene.object, com, *column)
        # The motion of the bodies reduces clearances between ticks.
        least = [
            np.minimum(
                np.minimum.reduceat(one[:-1], np.arange(0, one.size - 1, WINDOW)),
                one[WINDOW::WINDOW],
            )
            - self._fastest * TICK
            for one in clearances
        ]
        reference = ReferenceC(begin=begin, step=WINDOW * TICK, n=count)
        reference.detach, reference.far = throw.detach_time, self._far
        reference.start[:] = throw.release.end.tolist()
        reference.attach(
            **dict(zip(("palm", "column", "bodies"), map(np.ascontiguousarray, least), strict=True))
        )
        return reference

    @cached_property
    def _fastest(self) -> float:
        """Upper bound on the speed [m/s] at which bar and hand or links approach each other."""
        throw = self.batch.throw
        hand = throw.hand(np.arange(0.0, throw.until + TICK, TICK))
        swing = np.hypot(*hand.twist[:2]) + self._far * np.abs(hand.twist[2])
        end = throw.landing.state
        fall = math.hypot(end.v_x, end.v_z) + self._far * abs(end.omega)
        return float(swing.max() + fall)

    @cached_property
    def _far(self) -> float:
        """Upper bound on the distance [m] from the pads to any point of the bar."""
        scene = self.batch.scene
        return reach_of_bar(scene.object) + abs(scene.com_offset)

    @cached_property
    def _around(self) -> CollisionScene:
        return CollisionScene.of(self.batch.scene, self.batch.throw.manipulator)

    def __getstate__(self) -> dict[str, object]:
        """The state for another process, without pointers into the memory of this one."""
        return {key: value for key, value in vars(self).items() if key != "_reference"}
