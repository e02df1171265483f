"""Limits on N throws of one motion until the pads are open: grip, torques, floor, column.

Bounds over all throws find the instants at which grip or torque may exceed its limit; single throws
are measured at these instants only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ...core import library
from ...models import Array, Body, Flags, HandMotion, HandSamples, Indices, held_wrench
from ..throw import (
    CARRY_STEP,
    TICK,
    BatchFlights,
    ThrowBatch,
    column_of,
    load_torques,
    torque_limits,
)
from ..throw.clearance import (
    bar_room,
    column_distance,
    held_bar,
    lowest_of_bar,
    reach_of_bar,
)

#: Time [s] after the start of the opening of the last measurement of the grip use.
AFTER_OPENING = 1e-12
#: Use of grip or torque above which single throws are measured: 1 less rounding.
MEASURED_USE = 1 - 1e-9
#: Number of parts in which held bars are measured; more parts take less memory.
PARTS = 16


@dataclass(frozen=True)
class _Loads:
    """Held bodies of N throws: mass, mass times h, inertia about the pads, angle to the hand, and
    the largest force and torque of the full grip; each (N,)."""

    mass: Array
    lever: Array
    inertia: Array
    angle: Array
    force: Array
    torque: Array

    @classmethod
    def of(cls, batch: ThrowBatch, flights: BatchFlights) -> _Loads:
        """The bodies of a batch's flights."""
        column, contact, h = flights.columns, batch.scene.contact, flights.com_offset
        mass = column["mass"]
        force = column["friction"] * contact.faces * batch.scene.gripper.profile().full
        torque = force * contact.torsion * column["patch_radius"]
        inertia = column["inertia"] + mass * h * h
        return cls(mass, mass * h, inertia, flights.grasp_angle, force, torque)

    def wrench(self, hand: HandMotion, gravity: float) -> tuple[Array, Array, Array]:
        """Force [N] and torque [N m] at the pads that hold N bodies without slip."""
        h = self.lever / self.mass
        body = Body(self.mass, self.inertia - self.lever * h, h)
        return held_wrench(body, gravity, hand, self.angle)

    def use(self, hand: HandMotion, gravity: float) -> Array:
        """Squared use (N,) of the full grip's friction."""
        f_x, f_z, torque = self.wrench(hand, gravity)
        return np.asarray((f_x**2 + f_z**2) / self.force**2 + (torque / self.torque) ** 2)


def _spread(values: Array) -> tuple[float, float]:
    """Middle of the range of values, and half its width."""
    low, high = float(values.min()), float(values.max())
    return (low + high) / 2, (high - low) / 2


def _bounds(loads: _Loads, hand: HandSamples, gravity: float) -> tuple[Array, Array, Array, Array]:
    """Bounds for N bodies at instants (K,): a force f_x, f_z [N], the largest difference of any
    body's force to it, and the largest |torque| [N m], each (K,)."""
    (m, dm), (mh, dmh), (j, dj) = map(_spread, (loads.mass, loads.lever, loads.inertia))
    angle, da = _spread(loads.angle)
    theta, (a_x, a_z, alpha) = hand.pose[2] + angle, hand.acceleration
    cos, sin, square, a_z = np.cos(theta), np.sin(theta), hand.twist[2] ** 2, a_z + gravity
    pull, swing = np.hypot(a_x, a_z), np.hypot(alpha, square)
    f_x = m * a_x - mh * (alpha * sin + square * cos)
    f_z = m * a_z + mh * (alpha * cos - square * sin)
    off = dm * pull + (dmh + abs(mh) * da) * swing
    torque = np.abs(j * alpha - mh * (a_x * sin - a_z * cos))
    torque += dj * np.abs(alpha) + (dmh + abs(mh) * da) * pull
    return f_x, f_z, off, torque


@dataclass(frozen=True)
class Carry:
    """Judges throws of a batch until detach; caches the quantities of the motion."""

    batch: ThrowBatch

    def slips(self, flights: BatchFlights) -> Flags:
        """Flags (N,) of the throws that slip under full grip before the opening."""
        loads, hand, gravity = _Loads.of(self.batch, flights), self._hand, self.batch.scene.gravity
        f_x, f_z, off, torque = _bounds(loads, hand, gravity)
        force = (np.hypot(f_x, f_z) + off) / loads.force.min()
        use = np.hypot(force, torque / loads.torque.min())
        until, slips = flights.opened, np.zeros(len(flights.late), bool)
        for k in np.flatnonzero((use > MEASURED_USE) & (hand.times < until.max())).tolist():
            now = HandMotion(*(float(v[k]) for v in _rows(hand)))
            slips |= (loads.use(now, gravity) > 1.0) & (hand.times[k] < until)
        at = self.batch.hands.shifted(flights.late).at(np.full(len(until), AFTER_OPENING))
        return np.asarray(slips | (loads.use(HandMotion(*_rows(at)), gravity) > 1.0))

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

    # Torques.

    def strains(self, flights: BatchFlights) -> Flags:
        """Flags (N,) of the throws that need a torque above a joint's limit."""
        times, free, by_force, limits = self._torques
        loads, gravity = _Loads.of(self.batch, flights), self.batch.scene.gravity
        hand = self.batch.throw.hand(times)
        f_x, f_z, off, torque = _bounds(loads, hand, gravity)
        (torque_of_x, torque_of_z, torque_of_turn) = by_force
        middle = free + torque_of_x * f_x + torque_of_z * f_z
        wide = np.hypot(torque_of_x, torque_of_z) * off + np.abs(torque_of_turn) * torque
        use = ((np.abs(middle) + wide) / limits[:, None]).max(axis=0)
        strains = np.zeros(len(flights.late), bool)
        for k in np.flatnonzero(use > MEASURED_USE).tolist():
            # The object loads the joints until the pads are open.
            now = HandMotion(*(float(v[k]) for v in _rows(hand)))
            load = np.array(loads.wrench(now, gravity))
            total = free[:, k, None] + np.einsum("wj,wn->jn", by_force[:, :, k], load)
            loaded = (np.abs(total) > limits[:, None]).any(axis=0)
            strains |= loaded & (times[k] <= flights.freed)
        for k in np.flatnonzero((np.abs(free) > limits[:, None]).any(axis=0)).tolist():
            strains |= times[k] >= flights.opened
        return strains

    @cached_property
    def _torques(self) -> tuple[Array, Array, Array, Array]:
        """Times (K,) [s]; torques (n, K) [N m] with an empty hand; torques by force along x, z and
        torque of a load (3, n, K); limits (n,) [N m]."""
        throw = self.batch.throw
        times = np.arange(0.0, throw.path.end + TICK / 2, TICK)
        limits = torque_limits(throw.scene)
        assert limits is not None
        return times, *load_torques(throw.scene, throw.manipulator, throw.path, times), limits

    # Floor, column, obstacles and links.

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
        if scene.workspace is not None and scene.workspace.floor is not None:
            height = lowest_of_bar(scene.object, com) - scene.workspace.floor
            clearance = np.minimum(clearance, height)
        column = column_of(scene)
        if column is not None:
            clearance = np.minimum(clearance, column_distance(scene.object, com, *column))
        # The motion of bar and links reduces the clearance between ticks.
        return np.asarray(clearance - self._swing * TICK)

    @cached_property
    def _swing(self) -> float:
        """Upper bound on the speed [m/s] of any point of the held bar until the latest opening."""
        twist = self.batch.throw.hand(np.arange(0.0, self._latest + TICK, TICK)).twist
        return float((np.hypot(*twist[:2]) + self._far * np.abs(twist[2])).max())


def _rows(hand: HandSamples) -> tuple[Array, ...]:
    """theta, omega, a_x, a_z, alpha."""
    return hand.pose[2], hand.twist[2], *hand.acceleration
