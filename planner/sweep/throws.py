"""The throws of a sweep: sampled parameters in, landings and success out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ...models import (
    MODELS,
    Array,
    Body,
    Contact,
    Flags,
    HandMotion,
    Path,
    ReleaseBatch,
    land,
    pivot_wrench,
)
from ...problems import InputError, Pose, Scene
from ..check import TICK, Throw, cup_entries, friction_use
from ..result import Plan
from .samples import Sampler

#: Delays tried for the largest one that still lands inside [s], and for the pictures.
FURTHEST = 0.05
#: Of a model's `sweep_steps` the first is taken that leaves 95 % of `PROBES` throws within
#: `SHARE` of the tolerance of the next.
PROBES, SHARE = 64, 0.1
#: Cells of the hand's tabulated motion are this long at most [s].
CELL = 1e-4
#: The hand's acceleration may step at a cell's ends: it is taken this far [s] inside them.
INSIDE_CELL = 1e-10
#: The full grip is checked where this share of its largest use is needed, at this many
#: instants at most.
USED, INSTANTS = 0.5, 120


@dataclass(frozen=True)
class Outcomes:
    """N landings: pose (N, 3), x [m], theta [rad] and flight time [s] at the target's height,
    NaN for one that never comes down there; in_tolerance, in_cup (no contact with wall or
    rim on the way in; true without a cup), held (until its opening), each (N,).
    """

    pose: Array
    in_tolerance: Flags
    in_cup: Flags
    held: Flags

    @staticmethod
    def joined(parts: Sequence[Outcomes]) -> Outcomes:
        """All of several."""
        names = [field.name for field in fields(Outcomes)]
        return Outcomes(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


@dataclass(frozen=True)
class CarryHold:
    """The hand where its motion needs most of the grip: times (T,) from the planned opening
    [s], hand (5, T): theta, omega, a_x, a_z, alpha. full [N]: the grip of one pad.
    """

    times: Array
    hand: Array
    full: float

    @classmethod
    def of(cls, throw: Throw, latest: float) -> CarryHold:
        """Of a throw, from rest to `latest` [s] after its opening."""
        scene, opening_time = throw.scene, throw.opening_time
        times = np.arange(0.0, max(opening_time + latest, 0.0) + TICK / 2, TICK)
        hand = throw.mover.hand(throw.to_rest).at(times)
        use = np.hypot(*friction_use(scene, hand))
        kept = np.flatnonzero(use >= USED * use.max())
        thinned = kept[:: -(-kept.size // INSTANTS)]
        chosen = np.union1d(thinned, np.argmax(use))
        rows = np.array([hand.pose[2], hand.twist[2], *hand.acceleration])
        return cls(times[chosen] - opening_time, rows[:, chosen], scene.gripper.profile().full)

    def held(self, batch: ReleaseBatch, angle: Array, delays: Array) -> Flags:
        """Which of N throws stick until they open, `delays` (N,) [s] after the planned time.

        angle (N,): of the object's axis against the hand's.
        """
        worst, body = np.zeros(delays.size), batch.body
        for time, column in zip(self.times, self.hand.T, strict=True):
            hand = HandMotion(*column)
            theta, h = hand.theta + angle, body.com_offset
            x_r, z_r = h * np.cos(theta), h * np.sin(theta)
            wrench = pivot_wrench(body, batch.gravity, hand, hand.omega, x_r, z_r)
            use = batch.contact.utilisation_squared(*wrench, self.full)
            worst = np.where(time <= delays, np.maximum(worst, use), worst)
        return np.asarray(worst <= 1.0)


@dataclass(frozen=True)
class Thrower:
    """Throws a plan's motion with other values of the parameters `names`, by `model`.

    Small, to be sent to other processes. hands: counted from the planned opening.
    mean_delay [s]: what the plan's opening command is early by; flight [s]: of the plan's own
    throw. steps: over the opening, 0
    for the model's own.
    """

    scene: Scene
    target: Pose
    model: str
    names: tuple[str, ...]
    hands: Path
    carry: CarryHold
    mean_delay: float
    flight: float
    steps: int = 0

    def throw(self, values: Array) -> Outcomes:
        """N throws: values (N, P) of the parameters, columns as `names`, SI units."""
        columns = self.columns(values)
        batch = self.batch(columns)
        detach = self._detach(batch)
        # Friction knows relative motion only: a hand that is off its path, or moves off it
        # steadily, takes the whole release along.
        for i, axis in enumerate("xz"):
            drift = columns[f"hand_v{axis}"]
            detach[:, i] += columns[f"hand_{axis}"] + drift * batch.opening
            detach[:, 3 + i] += drift
        late = columns["delay"] - self.mean_delay
        if self.target.speed:
            # As the target sees it, counted from where it is when the planned throw lands.
            opened = late + columns["opening"] - self.scene.gripper.profile().opening
            detach[:, 0] -= self.target.speed * (opened - self.flight)
            detach[:, 3] -= self.target.speed
        landing = land(detach, self.target.z, self.scene.gravity)
        com = columns["com_offset"] + self.scene.grasp.offset
        return Outcomes(
            landing,
            self._in_tolerance(landing),
            self._in_cup(detach, landing, com),
            self.carry.held(batch, batch.grasp_angle, late),
        )

    def columns(self, values: Array) -> dict[str, Array]:
        """All parameters (N,) by name: those given, and the plan's own."""
        known = self.scene.values | {"delay": self.mean_delay}
        columns = {name: np.full(len(values), value) for name, value in known.items()}
        return columns | dict(zip(self.names, values.T, strict=True))

    def batch(self, columns: dict[str, Array]) -> ReleaseBatch:
        """The releases for parameters (N,) by name, by hands that are where they should be."""
        scene, contact = self.scene, self.scene.contact
        profile, friction = scene.gripper.profile(), columns["friction"]
        hands = self.hands.later(columns["delay"] - self.mean_delay)
        if "hand_omega" in self.names:
            still = np.zeros(len(friction))
            hands = replace(hands, drift=np.array([still, still, columns["hand_omega"]]))
        com_offset = columns["com_offset"] + scene.grasp.offset - columns["grasp_offset"]
        return ReleaseBatch(
            count=friction.size,
            body=Body(columns["mass"], columns["inertia"], com_offset),
            contact=Contact(friction, columns["patch_radius"], contact.torsion, contact.faces),
            grip=profile,
            hands=hands,
            opening=columns["opening"],
            force=np.full(friction.size, profile.full),
            gravity=scene.gravity,
            # The pads are round: a hand that is turned is an object held at another angle.
            grasp_angle=columns["grasp_angle"] + columns["hand_theta"],
        )

    def _detach(self, batch: ReleaseBatch) -> Array:
        """Detach states (N, 6)."""
        # A CoM behind the pads is one ahead of them on a bar that is turned round.
        turn = np.where(batch.body.com_offset < 0, math.pi, 0.0)
        body = replace(batch.body, com_offset=np.abs(batch.body.com_offset))
        batch = replace(batch, body=body, grasp_angle=batch.grasp_angle + turn)
        detach = MODELS[self.model].throw(batch, self.steps).detach
        detach[:, 2] -= turn
        return detach

    def nominal(self, count: int = 1) -> Array:
        """Values (count, P) that the plan was made with."""
        values = self.scene.values | {"delay": self.mean_delay}
        return np.tile([values[name] for name in self.names], (count, 1))

    def with_parameter(self, name: str) -> Thrower:
        """The same with one more parameter, the last."""
        return replace(self, names=(*self.names, name))

    def succeeds(self, landings: Outcomes) -> Flags:
        """Which throws (N,) succeed: into the cup, or inside the tolerance; held until opened."""
        inside = landings.in_tolerance if self.scene.cup is None else landings.in_cup
        return np.asarray(inside & landings.held)

    def _in_tolerance(self, landing: Array) -> Flags:
        tolerance, target = self.scene.tolerance, self.target
        inside = np.abs(landing[:, 0] - target.plane_x) <= tolerance.position
        if target.theta is not None:
            inside &= np.abs(landing[:, 1] - target.theta) <= tolerance.angle
        return np.asarray(inside)

    def _in_cup(self, detach: Array, landing: Array, com: Array) -> Flags:
        if self.scene.cup is None:
            return np.isfinite(landing[:, 0])
        return cup_entries(self.scene, detach, landing[:, 2], com) > 0.0


def thrower_of(plan: Plan, model: str, sampler: Sampler) -> Thrower:
    """A thrower of a solved plan's own motion.

    InputError for a plan without a throw.
    """
    if plan.throw is None or not plan.solved:
        raise InputError(f"plan: status {plan.status}: there is no throw to sweep")
    scene, mean = plan.scene, plan.scene.mean_delay
    throw = replace(plan.throw.final, scene=scene)
    low, high = sampler.reach("delay", mean)
    low, high = min(-FURTHEST, low - mean), max(FURTHEST, high - mean)
    opening = scene.gripper.profile().opening
    longest = max(opening, sampler.reach("opening", opening)[1])
    start, rest = throw.opening_time, throw.to_rest.end
    span = max(start + low, 0.0), min(start + high + longest, rest)
    carry = CarryHold.of(throw, min(high, rest - start))
    hands = tabulated(throw, span)
    flight = throw.landing.flight_time
    thrower = Thrower(scene, plan.goal, model, sampler.names, hands, carry, mean, flight)
    return _settled(thrower, sampler)


def _settled(thrower: Thrower, sampler: Sampler) -> Thrower:
    """The thrower with as many steps as the scene's tolerance needs."""
    tolerance = thrower.scene.tolerance
    probes = np.vstack([thrower.nominal(), sampler.draw(0, PROBES - 1)])
    coarse, poses = thrower, None
    for steps in MODELS[thrower.model].sweep_steps:
        fine = replace(thrower, steps=steps)
        found = fine.throw(probes).pose[:, :2]
        if poses is not None:
            moved = np.abs(found - poses) / (tolerance.position, tolerance.angle)
            if thrower.target.theta is None:
                moved = moved[:, :1]
            if np.quantile(np.nan_to_num(moved.max(axis=1)), 0.95) <= SHARE:
                return coarse
        coarse, poses = fine, found
    return coarse


def tabulated(throw: Throw, span: tuple[float, float]) -> Path:
    """The hand of a throw over `span` [s] of its own clock, counted from its opening.

    At rest before time 0 and after the end. Its pieces are divided evenly. Kinks: where the
    acceleration of a free hand steps; samples have none.
    """
    motion = throw.to_rest
    times, hand = motion.breaks, throw.mover.hand(motion)
    inside = times[(times > span[0]) & (times < span[1])]
    ends = np.concatenate([[span[0]], inside, [span[1]]])
    parts = np.maximum(np.ceil(np.diff(ends) / CELL - 1e-9), 1).astype(int)
    pieces = [
        np.linspace(begin, end, count, endpoint=False)
        for begin, end, count in zip(ends[:-1], ends[1:], parts, strict=True)
    ]
    edges = np.concatenate([*pieces, [span[1]]])
    start, end = (hand.at(side) for side in (edges[:-1] + INSIDE_CELL, edges[1:] - INSIDE_CELL))
    slope = (end.acceleration - start.acceleration) / np.diff(edges)
    cells = np.stack([slope / 6, start.acceleration / 2, start.twist, start.pose])
    knots, kinks = edges - throw.opening_time, np.empty(0) if throw.path.held else motion.kinks
    kinks = kinks[(kinks > span[0]) & (kinks < span[1])] - throw.opening_time
    # At rest before and after: cells of the pose alone.
    if span[0] <= 0.0:
        knots = np.append(knots[0] - 1.0, knots)
        cells = np.insert(cells, 0, 0.0, axis=2)
        cells[-1, :, 0] = start.pose[:, 0]
    if span[1] >= motion.end:
        knots = np.append(knots, knots[-1] + 1.0)
        cells = np.insert(cells, cells.shape[2], 0.0, axis=2)
        cells[-1, :, -1] = end.pose[:, -1]
    return Path(knots, cells[..., None], kinks)
