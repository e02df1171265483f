"""Random feasible releases: evenly within the limits, and beside those with sparse landings.

Random states of the coordinates at the start of the opening, kept when limits, grip, run-up and
brake allow them, are thrown through the non-smooth sliding pivot as one batch.
"""

from __future__ import annotations

import dataclasses
import io
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ....cache import cache_folder, keep, kept
from ....models import Array, Flags, HandSamples, Indices, Trajectory
from ....models.release import MODELS, SLIDING_PIVOT, ReleaseBatch
from ....problems import Scene
from ...ocp import BRAKE_SHARE
from ...throw import Manipulator, friction_use
from ...verdict import tool_speeds
from ..library import digest_of
from .release_table import ARRAYS, Releases, joined
from .run_ups import clears_carried, clears_thrown, run_up

#: Version of stored tables; raise it after a change of how releases are drawn or thrown.
FORMAT = 1
#: Parts of a scene that releases do not depend on: what chooses among throws, where they
#: land. Of [nlp] they depend on `carry_max` alone.
CHOICE = {"cost", "choice", "torque", "uncertainty", "robust", "nlp", "constraints", "release"}
LANDING = {"target", "tolerance", "cup", "bin", "landing", "obstacle", "rest", "calibration"}
#: Bins of landings on each axis.
BINS = 40


@dataclasses.dataclass(frozen=True)
class SamplingSettings:
    """Settings of a table of releases.

    steps: of the opening, along `pieces` cubic pieces of the hand's motion. sparse_share: of the
    table, drawn in `rounds` beside releases with sparse landings. widths: least and largest
    standard deviation of these draws, as shares of the limits' range. boundary_weight: factor on
    the probability of a bin beside an empty one.
    """

    steps: int = 12
    pieces: int = 6
    sparse_share: float = 0.6
    rounds: int = 6
    widths: tuple[float, float] = (0.01, 0.1)
    boundary_weight: float = 3.0


SETTINGS = SamplingSettings()


class ReleaseSampler:
    """Draws feasible releases of a scene."""

    def __init__(self, scene: Scene, manipulator: Manipulator) -> None:
        self.scene = scene
        self.manipulator = manipulator
        self.profile = scene.gripper.profile()

    def draw(self, count: int, seed: int = 0) -> Releases:
        """Releases from `count` tried states; fewer come back.

        The first are drawn evenly over all states, the others, in rounds, beside releases with
        sparse landings, above all at the reach's boundary.
        """
        rng = np.random.default_rng(seed)
        rounds = SETTINGS.rounds
        beside = int(SETTINGS.sparse_share * count / rounds)
        table = self._evenly(count - rounds * beside, rng)
        for _ in range(rounds if len(table.q) else 0):
            # The table serves all heights: at this one most releases land.
            height = float(np.quantile(table.detach[:, 1], 0.05))
            x, theta, _ = table.landings(height, self.scene.flight)
            if table.clear.any():
                x = np.where(table.clear, x, np.nan)
            parents = sparse_parents(x, theta, beside, rng)
            table = joined(table, self.perturb(table, parents, rng))
        return table

    def _evenly(self, count: int, rng: np.random.Generator) -> Releases:
        """Releases from `count` states evenly within the limits; the last few let go at rest."""
        limits, n = self.manipulator.planning, self.manipulator.size
        q = rng.uniform(limits.q_min, limits.q_max, (count, n))
        dq = rng.uniform(-limits.dq, limits.dq, (count, n))
        ddq = rng.uniform(-0.9, 0.9, (count, n)) * limits.ddq
        still = slice(count - max(count // 20, 1), count)
        dq[still], ddq[still] = 0.0, 0.0
        if self.manipulator.start is not None:
            q[-1] = self.manipulator.start
        return self._kept(q, dq, ddq, rng)

    def perturb(self, table: Releases, parents: Indices, rng: np.random.Generator) -> Releases:
        """Releases from states near those of `parents` (indices), some nearer, some farther."""
        limits, n = self.manipulator.planning, self.manipulator.size
        size = (len(parents), n)
        low, high = map(math.log, SETTINGS.widths)
        width = np.exp(rng.uniform(low, high, (len(parents), 1)))
        q = table.q[parents] + width * (limits.q_max - limits.q_min) * rng.normal(size=size)
        dq = table.dq[parents] + width * 2 * limits.dq * rng.normal(size=size)
        ddq = table.ddq[parents] + width * 2 * limits.ddq * rng.normal(size=size)
        dq, ddq = np.clip(dq, -limits.dq, limits.dq), np.clip(ddq, -limits.ddq, limits.ddq)
        return self._kept(q, dq, ddq, rng)

    def _kept(self, q: Array, dq: Array, ddq: Array, rng: np.random.Generator) -> Releases:
        """The feasible ones of some states, thrown."""
        # The run-up's mean acceleration stays under the limits.
        duration = (np.abs(dq) / self.manipulator.planning.ddq).max(axis=1)
        duration = duration * rng.uniform(1.3, 2.2, duration.size)
        duration = np.clip(duration, 0.12, self.scene.nlp.carry_max)
        if self.manipulator.start is not None:
            # The way from a given start may take up to the longest carry.
            longest = self.scene.nlp.carry_max
            duration = np.maximum(duration, 0.25)
            duration = duration * (longest / duration) ** rng.uniform(0.0, 1.0, duration.size)
        keep = self.within_limits(q, dq, ddq, duration)
        q, dq, ddq, duration = q[keep], dq[keep], ddq[keep], duration[keep]
        if len(q):
            keep = self.can_hold(q, dq, ddq)
            q, dq, ddq, duration = q[keep], dq[keep], ddq[keep], duration[keep]
        if len(q) == 0:
            return Releases(q, dq, ddq, duration, np.zeros((0, 6)), np.zeros(0, bool))
        states = self.throw(q, dq, ddq)
        end, rate, _ = self.opened(q, dq, ddq)
        clear = clears_thrown(self.scene, self.manipulator, end, rate, states)
        path = run_up(self.manipulator, q, dq, ddq, duration[:, None])
        clear &= clears_carried(self.scene, self.manipulator, path, duration[:, None])
        return Releases(q, dq, ddq, duration, states, clear)

    def opened(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, Array]:
        """Coordinates and rates (N, n) at the opening's end, and coordinates after braking."""
        opening = self.profile.opening
        end, rate = q + dq * opening + ddq * opening**2 / 2, dq + ddq * opening
        braking = rate * np.abs(rate) / (2 * BRAKE_SHARE * self.manipulator.planning.ddq)
        return end, rate, end + braking

    def within_limits(self, q: Array, dq: Array, ddq: Array, duration: Array) -> Flags:
        """Limits at the run-up's start, at both ends of the opening and after braking."""
        limits, (end, rate, stop) = self.manipulator.planning, self.opened(q, dq, ddq)
        positions = [q, end, stop]
        if self.manipulator.start is None:
            positions.append(run_up(self.manipulator, q, dq, ddq, duration[:, None])[0])
        inside = np.ones(q.shape, dtype=bool)
        for position, speed in ((q, dq), (end, rate)):
            low, high = limits.velocity(position)
            inside &= (speed >= low) & (speed <= high)
            inside &= self._tool_fits(position, speed)[:, None]
        for position in positions:
            inside &= (position >= limits.q_min) & (position <= limits.q_max)
        if self.manipulator.start is not None:
            # The run-up from a given start must not accelerate too fast.
            gap = np.abs(q - self.manipulator.start - dq * duration[:, None] / 2)
            inside &= gap <= 0.15 * limits.ddq * duration[:, None] ** 2
        return np.asarray(inside.all(axis=1))

    def _tool_fits(self, q: Array, dq: Array) -> Flags:
        """Whether (N,) flange and pads' centre keep the tool's speed."""
        scene = self.scene
        if scene.tool_speed is None or scene.arm is None:
            return np.ones(len(q), bool)
        pose, twist, _ = self.manipulator.motion(q.T, dq.T, 0 * q.T)
        return np.asarray(tool_speeds(scene.arm.tool, pose, twist) <= scene.tool_speed)

    def _hand(self, q: Array, dq: Array, ddq: Array, t: float) -> HandSamples:
        """The hands (N,) at time t."""
        outputs = self.manipulator.motion((q + dq * t + ddq * t * t / 2).T, (dq + ddq * t).T, ddq.T)
        return HandSamples(t, *(np.array(o) for o in outputs))

    def grip_use(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Friction use (N,) of the held bar under full grip; 1 slips."""
        return friction_use(self.scene, self._hand(q, dq, ddq, 0.0))

    def can_hold(self, q: Array, dq: Array, ddq: Array) -> Flags:
        """Whether the full grip holds the bar at the opening's start, and it is off the floor."""
        keep = self.grip_use(q, dq, ddq) <= 1 - self.scene.gripper.sticking_margin
        pose = self._hand(q, dq, ddq, 0.0).pose
        theta = pose[2] + self.scene.grasp.angle
        floor = self.scene.bounds.floor
        if floor is not None:
            reach = self.scene.object.length - self.scene.grasp.offset
            keep &= pose[1] + reach * np.sin(theta) > floor + self.scene.object.width / 2
        return np.asarray(keep)

    def throw(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Detach states (N, 6) by the exact sliding pivot, with graded steps."""
        scene, grip, count = self.scene, self.profile, len(q)
        times = np.linspace(0.0, grip.opening, SETTINGS.pieces + 1)
        hands = [self._hand(q, dq, ddq, t) for t in times]
        pose, twist, acceleration = (
            np.stack([getattr(hand, name) for hand in hands], axis=1)
            for name in ("pose", "twist", "acceleration")
        )
        jerk = np.diff(acceleration, axis=1) / np.diff(times)[:, None]
        pieces = np.stack([jerk / 6, acceleration[:, :-1] / 2, twist[:, :-1], pose[:, :-1]])
        batch = ReleaseBatch(
            count,
            scene.body,
            scene.patch,
            grip,
            Trajectory(times, pieces, np.empty(0)),
            np.full(count, grip.opening),
            np.full(count, grip.full),
            scene.gravity,
            scene.grasp.angle,
        )
        return MODELS[SLIDING_PIVOT].throw(batch, SETTINGS.steps).detach


def sparse_parents(x: Array, theta: Array, count: int, rng: np.random.Generator) -> Indices:
    """Indices (count,) of landings, drawn so that all filled bins away from the boundary are
    equally likely. x (N,) [m], theta (N,) [rad]; entries that are not finite are not taken.
    """
    finite = np.flatnonzero(np.isfinite(x) & np.isfinite(theta))
    if len(finite) == 0:
        return np.zeros(0, int)
    i, j = _bins(x[finite]), _bins(theta[finite])
    filled = np.zeros((BINS + 2, BINS + 2))
    np.add.at(filled, (i + 1, j + 1), 1.0)
    empty = filled == 0
    edge = np.zeros_like(empty)
    for axis in (0, 1):
        for step in (-1, 1):
            edge |= np.roll(empty, step, axis)
    weight = np.where(edge, SETTINGS.boundary_weight, 1.0)[i + 1, j + 1] / filled[i + 1, j + 1]
    return np.asarray(rng.choice(finite, count, p=weight / weight.sum()))


def _bins(values: Array) -> Indices:
    low, width = values.min(), max(float(np.ptp(values)), 1e-9)
    return np.asarray(np.minimum(((values - low) / width * BINS).astype(int), BINS - 1))


def stored_releases(scene: Scene, count: int, seed: int, draw: Callable[[], Releases]) -> Releases:
    """The table of a scene from the cache, or drawn and put there.

    A damaged file is drawn again; without a cache folder nothing is kept.
    """
    folder = cache_folder()
    if folder is None:
        return draw()
    parts = f"releases {FORMAT}", repr((scene.nlp.carry_max, count, seed))
    name = f"{digest_of(scene.unnamed, CHOICE | LANDING, *parts)}.npz"
    found = _read(folder / name)
    if found is None:
        found = draw()
        arrays = {key: getattr(found, key) for key in ARRAYS}
        data = io.BytesIO()
        np.savez(data, **arrays)
        keep(folder, name, data.getvalue())
    return found


def _read(path: Path) -> Releases | None:
    """The table in a file; None if it is not there or not whole."""
    data = kept(path)
    if data is None:
        return None
    with np.load(io.BytesIO(data)) as arrays:
        return Releases(*(arrays[key] for key in ARRAYS))
