"""Measured throws as release models predict them, for many contact parameters at once."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import (
    BatchRelease,
    Body,
    Contact,
    HandTrack,
    PatchRelease,
    Path,
    ReleaseBatch,
    ReleaseCase,
    land,
    throw_karnopp,
    throw_limit_surface,
    throw_sliding_pivot,
)
from ...problems import InputError, MeasuredThrow, ThrowData
from ..check import MODELS, recorded_joints
from ..compile import compiled_steps

Array = npt.NDArray[np.float64]

#: Sampling of the hands around the opening [s], and how far a delay may reach [s].
STEP, REACH = 0.001, 0.05


@dataclass(frozen=True)
class Parameters:
    """Contact parameters to predict with, each (M,).

    friction mu; patch_radius r_p [m]; delay [s]: the opening comes that much later than
    command and dwell say; grip_scale: the true grip force over the measured one.
    """

    friction: Array
    patch_radius: Array
    delay: Array = field(default_factory=lambda: np.zeros(1))
    grip_scale: Array = field(default_factory=lambda: np.ones(1))

    @property
    def count(self) -> int:
        """M."""
        return int(np.broadcast(*self.columns).size)

    @property
    def columns(self) -> tuple[Array, Array, Array, Array]:
        """friction, patch_radius, delay, grip_scale."""
        return self.friction, self.patch_radius, self.delay, self.grip_scale

    def spread(self) -> tuple[Array, Array, Array, Array]:
        """The columns, each (M,)."""
        full = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in self.columns))
        return full[0].copy(), full[1].copy(), full[2].copy(), full[3].copy()


@dataclass(frozen=True)
class Predictions:
    """detach (T, M, 6): CoM pose and twist; landing (T, M, 3): x [m], theta [rad], flight
    time [s] at the data's landing height; NaN where a model gave nothing."""

    detach: Array
    landing: Array


#: Models that take many parameters at once; every other of `simulate.MODELS` one by one.
BATCHES: dict[str, Callable[[ReleaseBatch], BatchRelease]] = {
    "sp": lambda batch: throw_sliding_pivot(batch, even=compiled_steps("sp", batch.hands)),
    "sp-paper": lambda batch: throw_sliding_pivot(batch, 100, "paper"),
    "ls": throw_karnopp,
    "ls-step": lambda batch: throw_limit_surface(
        batch, even=compiled_steps("ls-step", batch.hands)
    ),
    "patch": lambda batch: _plain(PatchRelease().batch(batch)),
}


def model_names() -> list[str]:
    """Models that may be asked for."""
    return list(MODELS)


def check_model(model: str) -> None:
    """InputError for a model that is not there."""
    if model not in MODELS:
        near = difflib.get_close_matches(model, MODELS, 1, 0.4)
        hint = f", did you mean '{near[0]}'?" if near else ""
        raise InputError(f"model = {model!r}: must be one of {', '.join(MODELS)}{hint}")


class Predictor:
    """The throws of a data set, ready to be thrown by any model.

    Raises InputError for a motion that does not fit its arm.
    """

    def __init__(self, data: ThrowData) -> None:
        self.data = data
        self.hands: list[HandTrack] = []
        for throw in data.throws:
            try:
                self.hands.append(_hand(data, throw))
            except ValueError as error:
                raise InputError(f"{data.name}: throw {throw.name}: {error}") from None

    def predict(
        self,
        model: str,
        parameters: Parameters,
        progress: Callable[[int, int], None] | None = None,
    ) -> Predictions:
        """Every throw with every parameter set: (T, M)."""
        check_model(model)
        count, sets = len(self.data.throws), parameters.count
        detach = np.full((count, sets, 6), np.nan)
        for number, states in enumerate(self._thrown(model, parameters)):
            detach[number] = states
            if progress is not None:
                progress(number + 1, count)
        shared = self.data.shared
        landing = land(detach.reshape(-1, 6), shared.landing_height, shared.gravity)
        return Predictions(detach, landing.reshape(count, sets, 3))

    def _thrown(self, model: str, parameters: Parameters) -> Iterator[Array]:
        for throw, hand in zip(self.data.throws, self.hands, strict=True):
            if model in BATCHES:
                yield BATCHES[model](self.batch(throw, hand, parameters)).detach
            else:
                yield self._one_by_one(model, throw, hand, parameters)

    def batch(self, throw: MeasuredThrow, hand: HandTrack, parameters: Parameters) -> ReleaseBatch:
        """One throw with M parameter sets as a batch."""
        friction, radius, delay, scale = parameters.spread()
        shared, grip, count = self.data.shared, throw.grip, parameters.count
        reach = min(REACH, float(np.abs(delay).max()) + 2 * STEP)
        if np.abs(delay).max() > REACH:
            raise InputError(f"delay = {np.abs(delay).max():g}: must be at most {REACH:g} s")
        times = np.arange(-reach, grip.opening + reach + STEP, STEP)
        return ReleaseBatch(
            count,
            Body(*self._body(throw)),
            Contact(friction, radius, shared.torsion, shared.faces),
            grip,
            Path.through(times, hand.at(times).pose.T, delay),
            np.full(count, grip.opening),
            grip.full * scale,
            shared.gravity,
            throw.grasp.angle,
        )

    def case(self, throw: MeasuredThrow, hand: HandTrack, sets: tuple[float, ...]) -> ReleaseCase:
        """One throw with one parameter set (friction, patch_radius, delay, grip_scale)."""
        friction, radius, delay, scale = sets
        shared = self.data.shared
        contact = Contact(friction * scale, radius, shared.torsion, shared.faces)
        late = _Delayed(hand, delay)
        body = Body(*self._body(throw))
        return ReleaseCase(body, contact, throw.grip, late, shared.gravity, throw.grasp.angle)

    def _one_by_one(
        self, model: str, throw: MeasuredThrow, hand: HandTrack, parameters: Parameters
    ) -> Array:
        found = []
        # Splines instead of an arm's kinematics at every call, as in a batch.
        hand = replace(self.batch(throw, hand, parameters).hands, delays=0.0)
        for sets in zip(*parameters.spread(), strict=True):
            end = MODELS[model].release(self.case(throw, hand, sets)).detach
            found.append([end.x, end.z, end.theta, end.v_x, end.v_z, end.omega])
        return np.array(found)

    @staticmethod
    def _body(throw: MeasuredThrow) -> tuple[float, float, float]:
        thrown = throw.object
        return thrown.mass, thrown.inertia, thrown.com - throw.grasp.offset


@dataclass(frozen=True)
class _Delayed:
    """A hand whose opening comes `delay` [s] later than thought."""

    hand: HandTrack
    delay: float

    def at(self, times: Array) -> Any:
        return self.hand.at(np.asarray(times) + self.delay)


def _hand(data: ThrowData, throw: MeasuredThrow) -> HandTrack:
    """The hand of a throw, from the opening's start on."""
    if data.arm is None:
        return Path.through(throw.times - throw.opening, throw.motion)
    joints = throw.motion
    return recorded_joints(data.arm, throw.times, joints, throw.opening, data.shared.cutoff)


def _plain(detach: Array) -> BatchRelease:
    return BatchRelease(detach, np.zeros(len(detach), bool))
