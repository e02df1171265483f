"""Measured throws as release models predict them, for many contact parameters at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..models import (
    MODELS,
    Array,
    Body,
    FlightLaw,
    HandTrack,
    Indices,
    ReleaseBatch,
    Trajectory,
    chunks,
)
from ..planner import TICK, PlanarArm, named_model, recorded_joints
from ..problems import Contact, InputError, checked
from .measured import measured
from .throws import MeasuredThrow, ThrowData

#: Unknowns, the columns of parameter sets: mu, r_p [m], delay [s] of the opening beyond command and
#: dwell, true grip force over the measured one.
UNKNOWNS = ("friction", "patch_radius", "delay", "grip_scale")
#: Values of unknowns that are not fitted.
BASE = {"delay": 0.0, "grip_scale": 1.0}
#: Largest delay [s].
REACH = 0.05
#: Throws times parameter sets of a batch. Throws share the cost of a call, but their sets share no
#: spline then.
BATCH_SIZE = 128
#: Cutoff [Hz] of recorded joints where none is given: that of Liu and Billard.
CUTOFF = 35.0


def parameter_sets(
    friction: npt.ArrayLike,
    patch_radius: npt.ArrayLike,
    delay: npt.ArrayLike = 0.0,
    grip_scale: npt.ArrayLike = 1.0,
) -> Array:
    """Parameter sets (M, 4), columns as in UNKNOWNS, of numbers or arrays (M,)."""
    columns = np.broadcast_arrays(*np.atleast_1d(friction, patch_radius, delay, grip_scale))
    return np.column_stack([np.asarray(column, float) for column in columns])


def check_model(model: str) -> None:
    """InputError for an unknown model, or one without batches, too slow for a grid."""
    named_model(model, MODELS)
    if not MODELS[model].batches:
        quick = ", ".join(name for name, other in MODELS.items() if other.batches)
        raise InputError(f"model = {model!r}: throws one at a time, too slow here: take {quick}")


@dataclass(frozen=True, eq=False)
class Predictor:
    """Predicts the throws of a data set by any release model.

    hands: of each throw, from the opening's start on, as a spline through samples at 1 kHz that
    begin at the command or earlier.
    """

    data: ThrowData
    hands: tuple[Trajectory, ...]

    @classmethod
    def of(cls, data: ThrowData, cutoff: float | None = None) -> Predictor:
        """The throws of a data set; InputError for a motion that does not fit its arm.

        cutoff [Hz]: of recorded joints' low-pass, instead of the data's own.
        """
        hands, arm = [], None if data.arm is None else PlanarArm(data.arm)
        for throw in data.throws:
            try:
                hands.append(_sampled(arm, throw, cutoff or data.shared.cutoff or CUTOFF))
            except ValueError as error:
                raise InputError(f"{data.name}: throw {throw.name}: {error}") from None
        return cls(data, tuple(hands))

    @cached_property
    def truth(self) -> Array:
        """Measured landings (T, 2): x [m], theta [rad]; InputError for a track that never lands."""
        return measured(self.data)

    def part(self, rows: Indices) -> Predictor:
        """The predictor of some of the throws."""
        return Predictor(self.data.picked(rows), tuple(self.hands[i] for i in rows))

    def detached(self, model: str, sets: Array) -> Array:
        """CoM pose and twist (T, M, 6) of every throw at the end of the opening, with every
        parameter set (M, 4); NaN if the model fails."""
        check_model(model)
        if np.abs(sets[:, 2]).max() > REACH:
            raise InputError(f"delay = {np.abs(sets[:, 2]).max():g}: must be at most {REACH:g} s")
        detach = np.full((len(self.data.throws), len(sets), 6), np.nan)
        known = MODELS[model]
        for rows in chunks(len(self.data.throws), max(BATCH_SIZE // len(sets), 1)):
            found = known.throw(self._batch(rows, sets), known.fit_steps).detach
            detach[rows] = found.reshape(len(rows), len(sets), 6)
        return detach

    def landed(self, detach: Array) -> Array:
        """x [m], theta [rad] (..., 2) at the landing height of detach states (..., 6)."""
        shared = self.data.shared
        found = FlightLaw(shared.gravity).land(detach.reshape(-1, 6), shared.landing_height)
        return found[:, :2].reshape(*detach.shape[:-1], 2)

    def landings(self, model: str, sets: Array) -> Array:
        """x [m], theta [rad] (T, M, 2) of every throw with every parameter set (M, 4)."""
        return self.landed(self.detached(model, sets))

    def _batch(self, rows: Indices, sets: Array) -> ReleaseBatch:
        """Some throws with every parameter set as one batch, throw by throw."""
        throws, shared = [self.data.throws[i] for i in rows], self.data.shared
        reach = float(np.abs(sets[:, 2]).max()) + 2 * TICK
        longest = max(throw.grip.opening for throw in throws)
        # A recording that ends early is extrapolated by its spline: others may be longer.
        times = TICK * np.arange(np.floor(-reach / TICK), np.ceil((longest + reach) / TICK) + 1)
        poses = [self.hands[i].at(times).pose.T for i in rows]
        friction, radius, delay, scale = np.tile(sets, (len(rows), 1)).T

        def spread(values: list[Any]) -> Array:
            return np.repeat(np.array(values, float), len(sets), axis=0)

        # One throw's motion is shared by all sets.
        several = spread(poses) if len(rows) > 1 else poses[0]
        return ReleaseBatch(
            friction.size,
            Body(*spread([_body(throw) for throw in throws]).T),
            shared.contact(friction, radius),
            np.array([throw.grip for throw in throws]).repeat(len(sets)),
            Trajectory.through(times, several, delay),
            spread([throw.grip.opening for throw in throws]),
            spread([throw.grip.full for throw in throws]) * scale,
            shared.gravity,
            spread([throw.grasp.angle for throw in throws]),
        )


def _sampled(arm: PlanarArm | None, throw: MeasuredThrow, cutoff: float) -> Trajectory:
    """The hand from the opening's start on, through its poses at whole milliseconds.

    arm: of recorded joints, None for motions of the hand."""
    times, opening = throw.times - throw.opening, throw.grip.opening
    hand: HandTrack
    if arm is None:
        hand = Trajectory.through(times, throw.motion)
    else:
        hand = recorded_joints(arm, throw.times, throw.motion, throw.opening, cutoff)
    first = max(float(times[0]), -max(throw.grip.dwell, REACH) - 2 * TICK)
    last = min(float(times[-1]), opening + REACH + 2 * TICK)
    even = TICK * np.arange(np.ceil(first / TICK), np.floor(last / TICK) + 1)
    return Trajectory.through(even, hand.at(even).pose.T)


def _body(throw: MeasuredThrow) -> tuple[float, float, float]:
    """Mass, inertia, and distance from the pads to the CoM."""
    return throw.object.mass, throw.object.inertia, throw.object.com - throw.grasp.offset


def thrown(data: ThrowData, model: str, contact: Mapping[str, float]) -> Array:
    """Landings (T, 2), x [m] and theta [rad], of the throws with this contact, for synthetic data.

    contact: friction, patch_radius [m], and, unless 0 and 1, delay [s] and grip_scale.
    """
    if not {"friction", "patch_radius"} <= contact.keys() <= set(UNKNOWNS):
        raise InputError("contact: must have friction and patch_radius; may have delay, grip_scale")
    Contact(friction=contact["friction"], patch_radius=contact["patch_radius"])
    checked("delay", contact.get("delay", 0.0), float, {"meaning": "s"})
    checked("grip_scale", contact.get("grip_scale", 1.0), float, {"above": 0, "most": 1e3})
    return Predictor.of(data).landings(model, parameter_sets(**contact))[:, 0]
