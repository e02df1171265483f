"""The throws of a sweep: sampled parameters in, landings and success out."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from ...models import MODELS, SLIDING_PIVOT, Body, Contact, Path, ReleaseBatch, land
from ...problems import InputError, Pose, Scene
from ..check import cup_entries
from ..compile import PAYS_FROM, compiled_steps
from ..result import Plan
from .carry_hold import CarryHold, carry_hold
from .disturbed_hands import tabulate
from .kinked_batch import kinked_steps
from .uncertain import Sampler

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: Delays tried for the largest one that still lands inside [s], and for the pictures.
FURTHEST = 0.05
#: Of a model's `sweep_steps` the first is taken that leaves 95 % of `PROBES` throws within
#: `SHARE` of the tolerance of the next.
PROBES, SHARE = 64, 0.1


@dataclass(frozen=True)
class Landings:
    """N landings: pose (N, 3), x [m], theta [rad] and flight time [s] at the target's height,
    NaN for one that never comes down there; in_tolerance, in_cup (no contact with wall or
    rim on the way in; true without a cup), held (until its opening), each (N,).
    """

    pose: Array
    in_tolerance: Flags
    in_cup: Flags
    held: Flags

    def __getitem__(self, which: slice) -> Landings:
        """Some of them."""
        return Landings(*(getattr(self, field.name)[which] for field in fields(self)))

    @staticmethod
    def joined(parts: list[Landings]) -> Landings:
        """All of several."""
        names = [field.name for field in fields(Landings)]
        return Landings(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


@dataclass(frozen=True)
class Thrower:
    """Throws a plan's motion with other values of the parameters `names`, by `model`.

    Light enough to be sent to other processes. mean_delay [s]: what the plan's opening
    command is early by. steps: over the opening, 0 for the model's own; compiled:
    whether those run in compiled code, where that is to be had.
    """

    scene: Scene
    target: Pose
    model: str
    names: tuple[str, ...]
    hands: Path
    carry: CarryHold
    mean_delay: float
    steps: int = 0
    compiled: bool = False

    def throw(self, values: Array) -> Landings:
        """N throws: values (N, P) of the parameters, columns as `names`, SI units."""
        columns = self._columns(values)
        batch = self._batch(columns)
        detach = self._detach(batch)
        # Friction knows relative motion only: a hand that is beside its path, or moves off
        # it steadily, takes the whole release along.
        for i, axis in enumerate("xz"):
            drift = columns[f"hand_v{axis}"]
            detach[:, i] += columns[f"hand_{axis}"] + drift * batch.opening
            detach[:, 3 + i] += drift
        landing = land(detach, self.target.z, self.scene.gravity)
        com = columns["com_offset"] + self.scene.grasp.offset
        delays = columns["delay"] - self.mean_delay
        angle, gravity = batch.grasp_angle, batch.gravity
        return Landings(
            landing,
            self._in_tolerance(landing),
            self._in_cup(detach, landing, com),
            self.carry.held(batch.body, batch.contact, gravity, angle, delays),
        )

    def _columns(self, values: Array) -> dict[str, Array]:
        """All parameters (N,) by name: those given, and the plan's own."""
        known = self.scene.values | {"delay": self.mean_delay}
        columns = {name: np.full(len(values), value) for name, value in known.items()}
        return columns | dict(zip(self.names, values.T, strict=True))

    def _batch(self, columns: dict[str, Array]) -> ReleaseBatch:
        """The releases, by hands that are where they were planned to be."""
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
        even = compiled_steps(self.model, batch.hands) if self.compiled else None
        if self.model == SLIDING_PIVOT and self.hands.kinks.size:
            even = partial(kinked_steps, kinks=self._kinks)
        detach = MODELS[self.model].throw(batch, self.steps, even).detach
        detach[:, 2] -= turn
        return detach

    def _kinks(self, batch: ReleaseBatch) -> Array:
        """When the hands' accelerations step [s after each opening]: (J, N)."""
        return np.asarray(self.hands.kinks[:, None] - batch.hands.delays)

    def nominal(self, count: int = 1) -> Array:
        """Values (count, P) that the plan was made with."""
        values = self.scene.values | {"delay": self.mean_delay}
        return np.tile([values[name] for name in self.names], (count, 1))

    def with_parameter(self, name: str) -> Thrower:
        """The same with one more parameter, the last."""
        return replace(self, names=(*self.names, name))

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


def thrower_of(plan: Plan, model: str, sampler: Sampler, samples: int) -> Thrower:
    """A thrower of a solved plan's own motion for that many samples.

    InputError for a plan without a throw.
    """
    if plan.throw is None or not plan.solved:
        raise InputError(f"plan: status {plan.status}: there is no throw to sweep")
    scene, mean = plan.scene, plan.scene.mean_delay
    throw = replace(plan.throw.final, scene=scene)
    spreads = dict(zip(sampler.names, sampler.spreads, strict=True))
    low, high = -FURTHEST, FURTHEST
    if "delay" in spreads:
        # Far enough for any draw: a normal one leaves 9 deviations once in 10^19.
        delay = spreads["delay"]
        reach = [end - mean for end in delay.reach]
        room = 0.0 if delay.normal is None else 9.0 * delay.normal
        low, high = min(low, reach[0] - room), max(high, reach[1] + room)
    span = spreads.get("opening")
    longest = scene.gripper.profile().opening
    if span is not None:
        room = 0.0 if span.normal is None else 9.0 * span.normal
        longest = max(longest, span.reach[1] + room)
    opening_time, rest = throw.opening_time, throw.to_rest.end
    covered = (max(opening_time + low, 0.0), min(opening_time + high + longest, rest))
    thrower = Thrower(
        scene,
        plan.target,
        model,
        sampler.names,
        tabulate(throw, covered),
        carry_hold(throw, min(high, rest - opening_time)),
        mean,
    )
    thrower = _settled(thrower, sampler)
    # Decided, and compiled, once: workers' results must not differ by a digit.
    kinked = model == SLIDING_PIVOT and thrower.hands.kinks.size > 0
    pays = samples >= PAYS_FROM and "hand_omega" not in sampler.names and not kinked
    return replace(thrower, compiled=pays and compiled_steps(model, thrower.hands) is not None)


def _settled(thrower: Thrower, sampler: Sampler) -> Thrower:
    """The thrower with enough steps for the scene's tolerance."""
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
