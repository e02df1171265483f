"""What a verdict measures of N throws of one motion, in one call of the compiled core.

What depends on the motion alone is measured once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...core import Structure, array, columns_of, library, out, rows
from ...models import Array, Indices, ReadOnly
from ..throw import TICK, BatchFlights, Throw, core_scene, core_torques, flight_of
from .clearance import Clearance, CollisionScene

#: Longest interval [s] between instants at which the grip is looked at before the opening.
GRIP_STEP = 0.002


@dataclass(frozen=True, eq=False)
class Measures(ReadOnly):
    """Measures of N throws.

    rows (N, M): columns as `measured` of the core; near: bodies that are too near to each other,
    (N, K, 5) as `contact` of the core, of which the first nears (N,) count; around: these bodies,
    None where there are none.
    """

    rows: Array
    near: Array
    nears: Indices
    around: CollisionScene | None = None

    def value(self, name: str) -> Array:
        """A measure (N,): grip, the largest use of the full grip until the opening; arm and held,
        heights [m] of the lowest points of the arm and of the object until detach; column_held,
        column_flown and palm, the object's least distances [m]; speed [m/s], the tool's highest;
        rate [N m/s], of the joints' torques by the motion's commands;
        palm_time [s], when after detach the object first is too near to the palm; cup, the least
        clearance [m] in it, or the least room in a bin, which `Bin.distance` takes. Infinite where
        nothing is near."""
        return self.rows[:, columns_of("measured")[name]][:, 0]

    def time(self, name: str) -> Array:
        """When (N,) [s] on the motion's clock."""
        return self.rows[:, columns_of("measured")[name]][:, 1]

    @property
    def torque(self) -> tuple[Array, Array]:
        """Largest shares (N, 8) of each joint's torque limit, and when [s]."""
        rows = self.rows[:, columns_of("measured")["torque"]]
        return rows[:, ::2], rows[:, 1::2]

    def clearances(self, throw: int = 0) -> list[Clearance]:
        """Pairs of bodies of a throw that are too near to each other."""
        if self.around is None:
            return []
        return self.around.list_clearances(self.near[throw, : self.nears[throw]])


def measures_of(throw: Throw, flights: BatchFlights | None = None) -> Measures:
    """Measures of a throw, or of flights (N,) of its motion."""
    if flights is None:
        flights = flight_of(throw)
    (shared, around, room), count = _motion(throw), len(flights.late)
    track = flights.release.track
    nodes = np.empty((count, 0, 4)) if track is None else track.copy()
    nodes[..., 0] += flights.opened[:, None]
    found, near = rows("measured", count), rows("contact", count, room)
    nears = np.zeros(count, np.int64)
    failed = library().measure_throws(
        shared,
        count,
        array(np.ascontiguousarray(_thrown(throw, flights)), count, of="thrown"),
        nodes.shape[1],
        array(nodes, *nodes.shape),
        out(found, count, of="measured"),
        room,
        out(near, count, room, of="contact"),
        out(nears, count),
    )
    if failed:
        raise MemoryError
    return Measures(found, near, nears, around)


@lru_cache(maxsize=1)
def _motion(throw: Throw) -> tuple[Structure, CollisionScene | None, int]:
    """The motion for the core; the bodies that may meet; the most meetings."""
    scene, manipulator = throw.scene, throw.manipulator
    around, bodies, room = None, None, 0
    if scene.bodies_around or manipulator.capsules is not None:
        around = CollisionScene.of(scene, manipulator)
        bodies = around.core
        room = 3 * around.most_contacts
    shared = Structure(
        "throws",
        motion=throw.path.core,
        arm=manipulator.kinematics.core,
        around=core_scene(scene),
        torques=core_torques(scene, manipulator),
        bodies=bodies,
        tick=TICK,
        step=GRIP_STEP,
    )
    return shared, around, room


def _thrown(throw: Throw, flights: BatchFlights) -> Array:
    """Flights as rows of the core's `thrown`."""
    scene, column, h = throw.scene, flights.columns, flights.com_offset
    patch = scene.patch
    force = patch.faces * column["friction"] * scene.gripper.profile().full
    cup_x = flights.way + (0.0 if scene.opening is None else scene.opening.plane_x)
    numbers = (
        column["mass"],
        column["inertia"] + column["mass"] * h**2,
        h,
        flights.grasp_angle,
        force,
        force * patch.torsion * column["patch_radius"],
        flights.com,
        flights.opened,
        flights.freed,
        flights.landing[:, 2],
        cup_x,
    )
    return np.hstack([np.column_stack(numbers), flights.start, flights.error])
