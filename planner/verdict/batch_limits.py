"""Limits on N throws of one motion: grip, torques and clearances until detach, bodies in flight.

Bounds over all throws find the instants at which grip or torque may exceed its limit; single throws
are measured at these instants only.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, replace
from functools import cached_property, partial

import numpy as np

from ...core import ReferenceC, library
from ...models import Array, Body, Contact, Flags, HandMotion, HandSamples, Indices, held_wrench
from ..clearance import (
    CollisionScene,
    bar_room,
    column_distance,
    held_bar,
    lowest_of_bar,
    palm_distance,
    reach_of_bar,
)
from ..throw import (
    CARRY_STEP,
    TICK,
    BatchFlights,
    ThrowBatch,
    column_of,
    load_torques,
    torque_limits,
)
from .findings import Code
from .landing import least_cup_clearance
from .single import NEAR

#: Time [s] after the start of the opening of the last measurement of the grip use.
AFTER_OPENING = 1e-12
#: Use of grip or torque above which single throws are measured: 1 less rounding.
MEASURED_USE = 1 - 1e-9
#: Number of parts in which held bars are measured; more parts take less memory.
PARTS = 16
#: Ticks of a window of flight; it has one clearance of the planned throw's bar.
WINDOW = 8


@dataclass(frozen=True)
class _Loads:
    """Held bodies of N throws: their pads, angles (N,) to the hand, and the full grip [N]."""

    body: Body
    contact: Contact
    angle: Array
    full: float
    gravity: float

    @classmethod
    def of(cls, batch: ThrowBatch, flights: BatchFlights) -> _Loads:
        """The bodies of a batch's flights."""
        column, scene = flights.columns, batch.scene
        full = scene.gripper.profile().full
        body = Body(column["mass"], column["inertia"], flights.com_offset)
        contact = replace(
            scene.patch, friction=column["friction"], patch_radius=column["patch_radius"]
        )
        return cls(body, contact, flights.grasp_angle, full, scene.gravity)

    def wrench(self, hand: HandMotion) -> tuple[Array, Array, Array]:
        """Force [N] and torque [N m] at the pads that hold N bodies without slip."""
        return held_wrench(self.body, self.gravity, hand, self.angle)

    def slips(self, hand: HandMotion) -> Flags:
        """Flags (N,) of the bodies that need more than the full grip's friction."""
        wrench = self.wrench(hand)
        use = self.contact.utilisation_squared(*wrench, self.full)
        return np.asarray(use > 1.0)

    def bounds(self, hand: HandSamples) -> tuple[Array, Array, Array, Array]:
        """Bounds at instants (K,): a force f_x, f_z [N], the largest difference of any body's
        force to it, and the largest |torque| [N m], each (K,)."""
        body = self.body
        lever, inertia = body.mass * body.com_offset, body.grasp_inertia
        (m, dm), (mh, dmh), (j, dj) = map(_spread, (body.mass, lever, inertia))
        angle, da = _spread(self.angle)
        theta, (a_x, a_z, alpha) = hand.pose[2] + angle, hand.acceleration
        cos, sin, square, a_z = np.cos(theta), np.sin(theta), hand.twist[2] ** 2, a_z + self.gravity
        pull, swing = np.hypot(a_x, a_z), np.hypot(alpha, square)
        f_x = m * a_x - mh * (alpha * sin + square * cos)
        f_z = m * a_z + mh * (alpha * cos - square * sin)
        off = dm * pull + (dmh + abs(mh) * da) * swing
        torque = np.abs(j * alpha - mh * (a_x * sin - a_z * cos))
        torque += dj * np.abs(alpha) + (dmh + abs(mh) * da) * pull
        return f_x, f_z, off, torque


def _spread(values: Array) -> tuple[float, float]:
    """Middle of the range of values, and half its width."""
    low, high = float(values.min()), float(values.max())
    return (low + high) / 2, (high - low) / 2


def _instant(hand: HandSamples, k: int) -> HandMotion:
    """The hand's motion at one of its instants."""
    return HandMotion(*(float(values[k]) for values in vars(hand.motion).values()))


@dataclass(frozen=True)
class MotionLimits:
    """Judges throws of a batch but for their landings; caches the quantities of the motion."""

    batch: ThrowBatch

    # Grip and torques.

    def slips(self, flights: BatchFlights) -> Flags:
        """Flags (N,) of the throws that slip under full grip before the opening."""
        loads, hand = _Loads.of(self.batch, flights), self._hand
        f_x, f_z, off, torque = loads.bounds(hand)
        limit = loads.contact.force_limit(loads.full)
        force = (np.hypot(f_x, f_z) + off) / limit.min()
        use = np.hypot(force, torque / (limit * loads.contact.torsion_arm).min())
        until, slips = flights.opened, np.zeros(len(flights.late), bool)
        for k in np.flatnonzero((use > MEASURED_USE) & (hand.times < until.max())).tolist():
            slips |= loads.slips(_instant(hand, k)) & (hand.times[k] < until)
        at = self.batch.hands.shifted(flights.late).at(np.full(len(until), AFTER_OPENING))
        return np.asarray(slips | loads.slips(at.motion))

    @cached_property
    def _hand(self) -> HandSamples:
        """The hand at the instants of the single verdict's grip use, up to the latest opening."""
        throw = self.batch.throw
        instants = partial(library().grip_instants, throw.path.core, CARRY_STEP, self._latest)
        times = np.empty(instants(0, None))
        instants(times.size, times)
        return throw.hand(np.sort(times))

    @property
    def _latest(self) -> float:
        """The latest detach [s] of the batch."""
        return self.batch.throw.opening_time + max(self.batch.reach[1], 0.0) + self.batch.reach[2]

    def strains(self, flights: BatchFlights) -> Flags:
        """Flags (N,) of the throws that need a torque above a joint's limit."""
        times, free, by_force, limits = self._torques
        loads, hand = _Loads.of(self.batch, flights), self.batch.throw.hand(times)
        f_x, f_z, off, torque = loads.bounds(hand)
        (torque_of_x, torque_of_z, torque_of_turn) = by_force
        middle = free + torque_of_x * f_x + torque_of_z * f_z
        wide = np.hypot(torque_of_x, torque_of_z) * off + np.abs(torque_of_turn) * torque
        use = ((np.abs(middle) + wide) / limits[:, None]).max(axis=0)
        strains = np.zeros(len(flights.late), bool)
        for k in np.flatnonzero(use > MEASURED_USE).tolist():
            # The object loads the joints until the pads are open.
            load = np.array(loads.wrench(_instant(hand, k)))
            total = free[:, k, None] + np.einsum("wj,wn->jn", by_force[:, :, k], load)
            loaded = (np.abs(total) > limits[:, None]).any(axis=0)
            strains |= loaded & (times[k] <= flights.freed)
        for k in np.flatnonzero((np.abs(free) > limits[:, None]).any(axis=0)).tolist():
            strains |= times[k] >= flights.opened
        return strains

    @cached_property
    def _torques(self) -> tuple[Array, Array, Array, Array]:
        """Times (K,) [s]; torques (n, K) [N m] with an empty hand; torques by force along x, z and
        torque of a load (3, n, K); limits (n,) [N m], less the margin."""
        throw = self.batch.throw
        times = np.arange(0.0, throw.path.end + TICK / 2, TICK)
        limits = torque_limits(throw.scene)
        assert limits is not None
        limits = limits * (1.0 - throw.scene.torque_margin)
        return times, *load_torques(throw.scene, throw.manipulator, throw.path, times), limits

    # The held bar.

    def may_collide(self, flights: BatchFlights) -> Flags:
        """Flags (N,) of the held bars that may collide with floor, column, obstacles or links.

        The error of its grasp bounds the distance of a bar from the planned bar; while the pads
        open, its motion in the hand adds to it. Until the opening, bars that this bound leaves in
        doubt are measured in their own grasp.
        """
        own = self.batch.columns(self.batch.nominal())
        shifted = np.abs(flights.columns["grasp_offset"] - own["grasp_offset"])
        angle = np.abs(flights.grasp_angle - own["grasp_angle"])
        displacement = shifted + self._far * angle + np.hypot(*flights.error[:, :2].T)
        stray = flights.release.stray
        strays = math.inf if stray is None else stray[:, 0] + self._far * stray[:, 1]
        drift = np.hypot(*flights.error[:, 3:5].T) + self._far * np.abs(flights.error[:, 5])
        strays = strays + drift * flights.columns["opening"]
        times, clearance = self._planned_clearance
        opens = times >= self.batch.throw.opening_time + min(self.batch.reach[0], 0.0)
        collides = displacement + strays > clearance[opens].min(initial=math.inf)
        near_times = times[(clearance < displacement.max(initial=0.0)) & ~opens]
        for part in np.array_split(
            np.flatnonzero(displacement > clearance[~opens].min(initial=math.inf)), PARTS
        ):
            if part.size:
                collides[part] |= self._held_clearance(flights, part, near_times) <= 0.0
        return np.asarray(collides)

    @cached_property
    def _far(self) -> float:
        """Upper bound on the distance [m] from the pads to any point of the bar."""
        scene = self.batch.scene
        return reach_of_bar(scene.object) + abs(scene.com_offset)

    def _swing(self, end: float) -> float:
        """Upper bound on the speed [m/s] of any point of the held bar up to a time [s]."""
        twist = self.batch.throw.hand(np.arange(0.0, end + TICK, TICK)).twist
        return float((np.hypot(*twist[:2]) + self._far * np.abs(twist[2])).max())

    @cached_property
    def _planned_clearance(self) -> tuple[Array, Array]:
        """Ticks (K,) [s] until the latest opening, and the held bar's clearance (K,) [m] there."""
        end = max(self._latest, TICK)
        times = np.append(np.arange(0.0, end, TICK), end)
        com = held_bar(self.batch.scene, self.batch.throw.hand(times).pose)
        return times, self._clearance(times, com)

    def _held_clearance(self, flights: BatchFlights, which: Indices, times: Array) -> Array:
        """Least clearance (M,) [m] at `times` (K,) [s] of M bars, each held in its own grasp."""
        scene, hand = self.batch.scene, self.batch.throw.hand(times).pose
        theta = hand[2] + flights.grasp_angle[which, None]
        arm = scene.object.com - flights.columns["grasp_offset"][which, None]
        x, z = (hand[i] + flights.error[which, i, None] for i in (0, 1))
        com = np.array([x + arm * np.cos(theta), z + arm * np.sin(theta), theta])
        every = np.tile(times, which.size)
        clearance = self._clearance(every, com.reshape(3, -1)).reshape(which.size, -1)
        return np.asarray(clearance.min(axis=1))

    def _clearance(self, times: Array, com: Array) -> Array:
        """Lower bound (K,) [m] until the next tick on the distance of held bars to all bodies, less
        the required clearance; com (3, K): their poses at `times` (K,) [s]."""
        throw, scene = self.batch.throw, self.batch.scene
        clearance = bar_room(throw, times, com, flying=False)
        if scene.bounds.floor is not None:
            height = lowest_of_bar(scene.object, com) - scene.bounds.floor
            clearance = np.minimum(clearance, height)
        column = column_of(scene)
        if column is not None:
            clearance = np.minimum(clearance, column_distance(scene.object, com, *column))
        # The motion of bar and links reduces the clearance between ticks.
        return np.asarray(clearance - self._held_swing * TICK)

    @cached_property
    def _held_swing(self) -> float:
        return self._swing(self._latest)

    # The flight.

    def judge_flights(self, flights: BatchFlights) -> dict[Code, Flags]:
        """Flags (N,) of the limits that flights break; False for those that never land."""
        scene, count = self.batch.scene, len(flights.late)
        lands = np.flatnonzero(np.isfinite(flights.landing[:, 2]))
        # In the layout of the core: `flown_sample` of structures.h.
        cup_x = flights.way + (0.0 if scene.cup is None else scene.cup.x)
        given = (flights.opened, flights.freed, flights.landing[:, 2], flights.com, cup_x)
        table = np.hstack([np.column_stack(given), flights.start, flights.error])
        rows = np.ascontiguousarray(table[lands])
        broken: dict[Code, Flags] = {}

        def add(code: Code, flags: Flags) -> None:
            broken[code] = np.zeros(count, bool)
            broken[code][lands] = flags

        measured, core = np.empty((len(rows), 4)), library()
        shared = self.batch.throw.core
        core.measure_flights(shared, self._reference, len(rows), rows, measured)
        column, palm_time, cup, near = measured.T
        if column_of(scene) is not None:
            add(Code.COLUMN, column < -NEAR)
        if scene.palm_clearance is not None:
            add(Code.PALM, np.isfinite(palm_time))
        if scene.cup is not None:
            into = np.isfinite(cup)
            add(Code.CUP_MISSED, ~into)
            add(Code.CUP_WALL, into & (cup <= least_cup_clearance(scene.cup)))
        some = np.flatnonzero(near)
        if some.size:
            bodies, lack = self._around.core(), np.empty(some.size)
            if core.near_flights(shared, bodies, some.size, rows[some], lack):
                raise MemoryError
            add(Code.COLLISION, np.zeros(lands.size, bool))
            broken[Code.COLLISION][lands[some]] = lack > NEAR
        return broken

    @cached_property
    def _around(self) -> CollisionScene:
        return CollisionScene.of(self.batch.scene, self.batch.throw.manipulator)

    @cached_property
    def _reference(self) -> ReferenceC:
        """Clearances of the planned throw's bar to palm, column, and links and obstacles."""
        throw, scene, (early, late, longest) = self.batch.throw, self.batch.scene, self.batch.reach
        begin = throw.opening_time + min(early, 0.0)
        end = throw.landing_time + max(late, 0.0) + longest + throw.landing.flight_time
        count = math.ceil((end - begin) / (WINDOW * TICK))
        times = np.asarray(begin + TICK * np.arange(count * WINDOW + 1), float)
        com = throw.flight(times - throw.detach_time)
        column, room = column_of(scene), scene.palm_clearance
        clearances = dict.fromkeys(("palm", "column"), np.full(times.size, np.inf))
        clearances["bodies"] = bar_room(throw, times, com, flying=True)
        if room is not None and scene.arm is not None:
            away = palm_distance(scene.object, scene.arm.tool, com, throw.hand(times).pose)
            clearances["palm"] = away - room
        if column is not None:
            clearances["column"] = column_distance(scene.object, com, *column)
        reference = ReferenceC(begin=begin, step=WINDOW * TICK, n=count)
        reference.detach, reference.far = throw.detach_time, self._far
        reference.start[:] = astuple(throw.landing.start)
        # The motion of the bodies reduces clearances between ticks.
        end_state = throw.landing.state
        fall = math.hypot(end_state.v_x, end_state.v_z) + self._far * abs(end_state.omega)
        moved = (self._swing(throw.until) + fall) * TICK
        for name, one in clearances.items():
            least = np.minimum.reduceat(one[:-1], np.arange(0, one.size - 1, WINDOW))
            reference.attach(**{name: np.minimum(least, one[WINDOW::WINDOW]) - moved})
        return reference

    def __getstate__(self) -> dict[str, object]:
        """The state for another process, without pointers into the memory of this one."""
        return {key: value for key, value in vars(self).items() if key != "_reference"}
