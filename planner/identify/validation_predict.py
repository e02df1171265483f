"""The predictions of a validation: those of `Predictor`, with less work for each.

All throws are predicted hundreds of times with the very same hand and grip force.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ...models import (
    BatchRelease,
    HandSamples,
    HandTrack,
    ImplicitRelease,
    ReleaseBatch,
    ReleaseCase,
    ReleaseModel,
    TableRelease,
    land,
    throw_karnopp,
    throw_sliding_pivot,
)
from ...problems import MeasuredThrow, ThrowData
from ..check import MODELS
from .grid import Progress
from .predict import REACH, STEP, Parameters, Predictions, Predictor

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int_]

#: Steps of the paper's form of the sliding pivot, which has no compiled code: landings are
#: off by 0.2 mm in the mean and 1.3 mm at most, in a quarter of the time of 400 steps.
PAPER_STEPS = 100
#: Batches in NumPy, which gain from hands that move together.
QUICKER: dict[str, Callable[[ReleaseBatch], BatchRelease]] = {
    "sp-paper": lambda batch: throw_sliding_pivot(batch, PAPER_STEPS, "paper"),
    "ls": throw_karnopp,
}


def predicted(
    predictor: Predictor, model: str, cells: Parameters, progress: Progress | None
) -> Predictions:
    """As `Predictor.predict`, only faster."""
    if model not in QUICKER and not isinstance(MODELS[model], ImplicitRelease):
        return predictor.predict(model, cells, progress)
    throws, shared = predictor.data.throws, predictor.data.shared
    detach = np.empty((len(throws), cells.count, 6))
    for n, (throw, hand) in enumerate(zip(throws, predictor.hands, strict=True)):
        if model in QUICKER:
            batch = predictor.batch(throw, hand, cells)
            together = dataclasses.replace(batch.hands, delays=0.0)
            detach[n] = QUICKER[model](dataclasses.replace(batch, hands=together)).detach
        else:
            cases = (predictor.case(throw, hand, one) for one in zip(*cells.spread(), strict=True))
            detach[n] = [detached(MODELS[model], case) for case in cases]
        if progress is not None:
            progress(n + 1, len(throws))
    landing = land(detach.reshape(-1, 6), shared.landing_height, shared.gravity)
    return Predictions(detach, landing.reshape(len(throws), cells.count, 3))


def detached(model: ReleaseModel, case: ReleaseCase) -> list[float]:
    """The state (6,) at the end of the opening; an integrator need not keep any other."""
    if isinstance(model, ImplicitRelease):
        model = dataclasses.replace(model, samples=2)
    end = model.release(case).detach
    return [end.x, end.z, end.theta, end.v_x, end.v_z, end.omega]


class KeptCurve(TableRelease):
    """The same force with its curve made once: models one by one ask for it a thousand times."""

    def __init__(self, grip: TableRelease) -> None:
        from scipy.interpolate import PchipInterpolator

        self.__dict__.update(grip.__dict__)
        self._curve = PchipInterpolator(self._times, self._forces)

    def force(self, time: npt.ArrayLike) -> Array:
        """f_N [N] at `time` [s] after the start of the fall."""
        force = self._curve(np.clip(np.asarray(time, float), 0.0, self.opening))
        return np.asarray(np.maximum(force, 0.0))


def quick_predictor(data: ThrowData) -> Predictor:
    """A predictor whose single releases are fast: splines for joints and grip force.

    The hand is sampled at 1 kHz, as it is for a batch.
    """
    throws = tuple(dataclasses.replace(throw, grip=KeptCurve(throw.grip)) for throw in data.throws)
    predictor = Predictor(dataclasses.replace(data, throws=throws))
    hands = zip(throws, predictor.hands, strict=True)
    predictor.hands = [SplinedHand(throw, hand) for throw, hand in hands]
    return predictor


class SplinedHand:
    """A hand as one spline of pose, twist and acceleration, from the command on."""

    def __init__(self, throw: MeasuredThrow, hand: HandTrack) -> None:
        from scipy.interpolate import CubicSpline, PPoly

        first = max(float(throw.times[0]) - throw.opening, -throw.grip.dwell - STEP)
        last = min(float(throw.times[-1]) - throw.opening, throw.grip.opening + REACH)
        times = np.linspace(first, last, max(round((last - first) / STEP), 4) + 1)
        pose = CubicSpline(times, hand.at(times).pose.T)
        rows = [pose.c, *(np.asarray(pose.derivative(k).c) for k in (1, 2))]
        # Lower powers only: zeros in place of the higher ones.
        full = [np.concatenate([np.zeros((4 - len(c), *c.shape[1:])), c]) for c in rows]
        self._curve = PPoly(np.concatenate(full, axis=2), times)

    def at(self, times: Array) -> HandSamples:
        """The hand at `times` (K,) [s]."""
        t = np.asarray(times, float)
        rows = self._curve(t).T
        return HandSamples(t, rows[:3], rows[3:6], rows[6:])


def part_of(predictor: Predictor, rows: Rows) -> Predictor:
    """The same for some of the throws; their hands are not made again."""
    part = copy.copy(predictor)
    part.data = predictor.data.picked(list(rows))
    part.hands = [predictor.hands[i] for i in rows]
    return part
