"""Sampled releases: what a scene can throw, and starting points for the NLP.

Random states of the coordinates at the start of the opening, kept when limits, grip,
run-up and room to brake allow them, are thrown through the non-smooth sliding pivot
as one batch. The landing nearest a target then starts the NLP.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import HandMotion, HandSamples, SlidingPivot, land, rk4_step
from ...problems import Scene
from ..check import Mover, friction_use
from ..ocp import BRAKE_SHARE
from .release_room import clears_column, clears_palm
from .run_up import run_up
from .sparse import sparse_parents

Array = npt.NDArray[np.float64]

#: Runge-Kutta steps of the opening in the table.
TABLE_STEPS = 12
#: Nearest landings among which starting points are chosen, and how far apart these are: as a
#: share of the table's range of some coordinate, rate or the flight time.
POOL, DIFFERENT = 400, 0.15
#: Share of a table drawn beside releases whose landings are sparse, and in how many rounds.
SPARSE_SHARE, ROUNDS = 0.6, 6
#: How much nearer [m, scaled error] a landing must be for a throw that meets column or hand.
DETOUR = 0.1
#: How near, in shares of the limits' range.
NEARNESS = (0.01, 0.1)


@dataclass(frozen=True)
class Releases:
    """Feasible sampled releases: (N, n) coordinates, rates and accelerations at the
    opening's start, run-up time (N,), detach states (N, 6): x, z, theta, v_x, v_z, omega,
    and whether (N,) the bar clears the base column on the run-up, and then the hand's body.
    """

    q: Array
    dq: Array
    ddq: Array
    run_up: Array
    detach: Array
    clear: npt.NDArray[np.bool_]

    # Of the last height asked for: a plan asks several times for one.
    _last: dict[str, Any] = field(default_factory=dict, repr=False, init=False)

    def landings(self, height: float, gravity: float) -> tuple[Array, Array, Array]:
        """x [m], theta [rad] and flight time [s] of coming down through `height`; NaN if not."""
        x, theta, time = self._at(height, gravity)["landings"]
        return x, theta, time

    def flight_time(self, index: int, height: float, gravity: float) -> float:
        """How long release `index` flies down to `height` [s]; NaN if it does not."""
        return float(self.landings(height, gravity)[2][index])

    def shares(self, height: float, gravity: float) -> Array:
        """Coordinates, rates and flight times (N, 2n + 1), each as a share of its range."""
        last = self._at(height, gravity)
        if "shares" not in last:
            states = np.hstack([self.q, self.dq, last["landings"][2][:, None]])
            spread = np.nanmax(states, axis=0) - np.nanmin(states, axis=0)
            last["shares"] = states / np.maximum(spread, 1e-9)
        return np.asarray(last["shares"])

    def _at(self, height: float, gravity: float) -> dict[str, Any]:
        if self._last.get("for") != (height, gravity):
            self._last.clear()
            found = land(self.detach, height, gravity).T.copy()
            self._last.update({"for": (height, gravity), "landings": found})
        return self._last

    def picked(self, chosen: npt.NDArray[Any]) -> Releases:
        """Some of the releases: flags (N,) or indices."""
        return Releases(*(getattr(self, name)[chosen] for name in ARRAYS))


#: What a table of releases holds.
ARRAYS = ("q", "dq", "ddq", "run_up", "detach", "clear")


def joined(*parts: Releases) -> Releases:
    """The releases of all parts, one after the other."""
    return Releases(*(np.concatenate([getattr(p, name) for p in parts]) for name in ARRAYS))


class ReleaseSampler:
    """Draws feasible releases of a scene."""

    def __init__(self, scene: Scene, mover: Mover) -> None:
        self.scene = scene
        self.mover = mover
        self.profile = scene.gripper.profile()
        self.release = SlidingPivot(scene.body, scene.patch, scene.gravity)

    def draw(self, count: int, seed: int = 0) -> Releases:
        """Releases from `count` tried states; fewer come back.

        The first of them evenly in the states, then, in rounds, beside the releases whose
        landings are sparse: those at the edge of what is in reach above all.
        """
        rng = np.random.default_rng(seed)
        beside = int(SPARSE_SHARE * count / ROUNDS)
        table = self._evenly(count - ROUNDS * beside, rng)
        for _ in range(ROUNDS if len(table.q) else 0):
            # Where most come down: the table serves all heights.
            height = float(np.quantile(table.detach[:, 1], 0.05))
            x, theta, _ = table.landings(height, self.scene.gravity)
            parents = sparse_parents(x, theta, beside, rng)
            table = joined(table, self.beside(table, parents, rng))
        return table

    def _evenly(self, count: int, rng: np.random.Generator) -> Releases:
        """Releases from `count` states all over the limits; the last few let go at rest."""
        limits, n = self.mover.planning, self.mover.size
        q = rng.uniform(limits.q_min, limits.q_max, (count, n))
        dq = rng.uniform(-limits.dq, limits.dq, (count, n))
        ddq = rng.uniform(-0.9, 0.9, (count, n)) * limits.ddq
        still = slice(count - max(count // 20, 1), count)
        dq[still], ddq[still] = 0.0, 0.0
        if self.mover.start is not None:
            q[-1] = self.mover.start
        return self._kept(q, dq, ddq, self.run_up_time(dq, ddq, rng), rng)

    def beside(
        self, table: Releases, parents: npt.NDArray[np.int_], rng: np.random.Generator
    ) -> Releases:
        """Releases from states near those of `parents` (indices), some nearer, some farther."""
        limits, n = self.mover.planning, self.mover.size
        size = (len(parents), n)
        low, high = map(math.log, NEARNESS)
        width = np.exp(rng.uniform(low, high, (len(parents), 1)))
        q = table.q[parents] + width * (limits.q_max - limits.q_min) * rng.normal(size=size)
        dq = table.dq[parents] + width * 2 * limits.dq * rng.normal(size=size)
        ddq = table.ddq[parents] + width * 2 * limits.ddq * rng.normal(size=size)
        dq, ddq = np.clip(dq, -limits.dq, limits.dq), np.clip(ddq, -limits.ddq, limits.ddq)
        return self._kept(q, dq, ddq, self.run_up_time(dq, ddq, rng), rng)

    def _kept(
        self, q: Array, dq: Array, ddq: Array, duration: Array, rng: np.random.Generator
    ) -> Releases:
        """The feasible ones of some states, thrown."""
        if self.mover.start is not None:
            # From a given start the way may be long: up to the longest carry.
            longest = self.scene.mesh.carry_max
            duration = np.maximum(duration, 0.25)
            duration = duration * (longest / duration) ** rng.uniform(0.0, 1.0, duration.size)
        keep = self.within_limits(q, dq, ddq, duration)
        q, dq, ddq, duration = q[keep], dq[keep], ddq[keep], duration[keep]
        if len(q):
            keep = self.held(q, dq, ddq)
            q, dq, ddq, duration = q[keep], dq[keep], ddq[keep], duration[keep]
        if len(q) == 0:
            return Releases(q, dq, ddq, duration, np.zeros((0, 6)), np.zeros(0, bool))
        states = self.throw(q, dq, ddq)
        opening = self.profile.opening
        end, rate = q + opening * (dq + opening * ddq / 2), dq + opening * ddq
        clear = clears_palm(self.scene, self.mover, end, rate, states)
        path = run_up(self.mover.start, q, dq, ddq, duration[:, None])
        clear &= clears_column(self.scene, self.mover, path, duration[:, None])
        return Releases(q, dq, ddq, duration, states, clear)

    def run_up_time(self, dq: Array, ddq: Array, rng: np.random.Generator) -> Array:
        """Run-up time that keeps the run-up's mean acceleration under the limits."""
        needed = (np.abs(dq) / self.mover.planning.ddq).max(axis=1)
        longer = needed * rng.uniform(1.3, 2.2, needed.size)
        return np.asarray(np.clip(longer, 0.12, self.scene.mesh.carry_max))

    def within_limits(
        self, q: Array, dq: Array, ddq: Array, duration: Array
    ) -> npt.NDArray[np.bool_]:
        """Limits at the run-up's start, at both ends of the opening and after braking."""
        limits, opening = self.mover.planning, self.profile.opening
        end = q + dq * opening + ddq * opening**2 / 2
        rate = dq + ddq * opening
        stop = end + rate * np.abs(rate) / (2 * BRAKE_SHARE * limits.ddq)
        positions = [q, end, stop]
        if self.mover.start is None:
            positions.append(run_up(None, q, dq, ddq, duration[:, None])[0])
        inside = np.ones(q.shape, dtype=bool)
        for position, speed in ((q, dq), (end, rate)):
            low, high = limits.velocity(position)
            inside &= (speed >= low) & (speed <= high)
        for position in positions:
            inside &= (position >= limits.q_min) & (position <= limits.q_max)
        if self.mover.start is not None:
            # From a given start: as far as the run-up's time allows.
            gap = np.abs(q - self.mover.start - dq * duration[:, None] / 2)
            inside &= gap <= 0.15 * limits.ddq * duration[:, None] ** 2
        return np.asarray(inside.all(axis=1))

    def _hand(self, q: Array, dq: Array, ddq: Array, t: float) -> tuple[Array, Array, HandMotion]:
        """Hand pose (3, N), twist (3, N) and motion at time t."""
        outputs = self.mover.motion((q + dq * t + ddq * t * t / 2).T, (dq + ddq * t).T, ddq.T)
        pose, twist, acceleration = (np.array(o) for o in outputs)
        return pose, twist, HandMotion(pose[2], twist[2], *acceleration)

    def grip_use(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Friction use (N,) of the held bar under full grip; 1 slips."""
        pose, twist, acceleration = (np.array(o) for o in self.mover.motion(q.T, dq.T, ddq.T))
        hand = HandSamples(np.zeros(len(q)), pose, twist, acceleration)
        return np.asarray(np.hypot(*friction_use(self.scene, hand)))

    def held(self, q: Array, dq: Array, ddq: Array) -> npt.NDArray[np.bool_]:
        """Whether the full grip holds the bar at the opening's start, and it is off the floor."""
        keep = self.grip_use(q, dq, ddq) <= 1 - self.scene.mesh.sticking_margin
        pose, _, hand = self._hand(q, dq, ddq, 0.0)
        theta = hand.theta + self.scene.grasp.angle
        workspace = self.scene.workspace
        if workspace is not None and workspace.floor is not None:
            reach = self.scene.object.length - self.scene.grasp.offset
            keep &= pose[1] + reach * np.sin(theta) > workspace.floor + self.scene.object.width / 2
        return np.asarray(keep)

    def throw(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Detach states (N, 6) by the exact sliding pivot."""
        opening, steps = self.profile.opening, TABLE_STEPS
        times = np.linspace(0.0, opening, 2 * steps + 1)
        forces = self.profile.force(times)
        state = [np.zeros(len(q)) for _ in range(6)]
        state[2] = np.full(len(q), self.scene.grasp.angle)
        hand = self._hand(q, dq, ddq, 0.0)[2]
        for i in range(steps):
            middle = self._hand(q, dq, ddq, times[2 * i + 1])[2]
            pose, twist, end = self._hand(q, dq, ddq, times[2 * i + 2])
            state = rk4_step(
                self.release.rates,
                state,
                [hand, middle, end],
                list(forces[2 * i : 2 * i + 3]),
                opening / steps,
            )
            hand = end
        return np.array(self.release.com_state(state, pose, twist, hand)).T


def distances(
    releases: Releases,
    scene: Scene,
    x: float,
    height: float,
    theta: float | None,
    *,
    detour: float = DETOUR,
) -> Array:
    """Scaled distances [m] (39) (N,) of the landings; inf where there is none.

    Throws whose bar meets column or hand count as `detour` [m] farther.
    """
    land_x, land_theta, time = releases.landings(height, scene.gravity)
    distance = np.abs(land_x - x)
    if theta is not None:
        distance = distance + np.abs(land_theta - theta) * scene.object.length / 2
    distance = np.where(np.isfinite(time), distance, np.inf)
    return np.asarray(distance + np.where(releases.clear, 0.0, detour))


def nearest(
    releases: Releases,
    scene: Scene,
    x: float,
    height: float,
    theta: float | None,
    count: int,
) -> tuple[npt.NDArray[np.int_], Array]:
    """Indices and scaled distances [m] (39) of `count` near landings, nearest first.

    Throws whose bar clears column and hand come first where they are not much farther. Each
    differs from those before it; where there are too few such among the nearest, others
    like them fill up.
    """
    distance = distances(releases, scene, x, height, theta)
    size = min(max(POOL, count), len(distance))
    if size == 0:
        return np.zeros(0, int), np.zeros(0)
    pool = np.argpartition(distance, size - 1)[:size]
    pool = pool[np.argsort(distance[pool], kind="stable")]
    pool = pool[np.isfinite(distance[pool])]
    if count > 1 and len(pool):
        pool = pool[_different(releases.shares(height, scene.gravity)[pool], count)]
    found = pool[:count]
    return found, distance[found] - np.where(releases.clear[found], 0.0, DETOUR)


def _different(states: Array, count: int) -> npt.NDArray[np.int_]:
    """Indices of at most `count` rows, in order, that differ; filled up with other rows."""
    chosen: list[int] = []
    free = np.ones(len(states), bool)
    while len(chosen) < count and free.any():
        i = int(free.argmax())
        chosen.append(i)
        free &= np.abs(states - states[i]).max(axis=1) > DIFFERENT
    others = np.setdiff1d(np.arange(len(states)), chosen)[: count - len(chosen)]
    return np.sort(np.concatenate([np.array(chosen, int), others]))
