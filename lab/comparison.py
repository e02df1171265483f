"""Release models compared on the same throws, by their fits and by throws left out of the fits."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any

import numpy as np

from ..models import BATCH_MODELS, Array, Indices
from ..pictures import Row, Table
from ..workers import Progress
from .identification import Identified, identify, no_progress
from .measured import conditions, pose_errors
from .throws import ThrowData

#: Models that are compared: those that can be fitted in seconds.
FITTED = tuple(name for name, model in BATCH_MODELS.items() if model.quick)
#: Number of parts of the throws; each is predicted by the fit to the others.
PARTS = 6
#: Draws of a bootstrap.
DRAWS = 2000


def compare(
    data: ThrowData, about: Callable[[str], Progress] | None = None, **options: Any
) -> tuple[list[Identified], Table]:
    """The fits of all models of `FITTED`, and a table of their errors.

    about(words) gives the progress of a part; options: of `identify`. The table has the mean of
    the absolute errors and their standard deviation, and the mean pose error (position plus angle
    times half the length) with its 95 % interval: at the fit; of throws whose conditions were left
    out of it; and how much the latter is above that of the model that errs least. Without two
    conditions the last two have no number.
    """
    show = about or no_progress
    found = [identify(data, model, about=about, **options) for model in FITTED]
    apart = [left_out(one, show(f"{one.model}: throws left out of the fit")) for one in found]
    least = min((errors for errors in apart if errors is not None), key=np.mean, default=None)
    known, rows = conditions(data), list[Row]()
    for one, errors in zip(found, apart, strict=True):
        x, theta = np.abs(one.off).T * [[1e3], [np.degrees(1.0)]]
        row: Row = {
            "model": one.model,
            "mu r_p [mm]": 1e3 * one.posterior.product,
            "x [mm]": (float(np.nanmean(x)), float(np.nanstd(x))),
            "theta [deg]": (float(np.nanmean(theta)), float(np.nanstd(theta))),
            "pose error [mm]": _interval(1e3 * one.pose_errors, known),
            "left out [mm]": None,
            "above the least [mm]": None,
            "no landing": one.missed,
        }
        if errors is not None and least is not None:
            row["left out [mm]"] = _interval(1e3 * errors, known)
            row["above the least [mm]"] = _interval(1e3 * (errors - least), known)
        rows.append(row)
    caption = "Mean absolute errors ± standard deviation; mean pose error (95 % interval)"
    return found, Table("comparison", caption, rows)


def left_out(found: Identified, progress: Progress) -> Array | None:
    """Pose errors (T,) [m] of throws by fits to throws of other conditions.

    None with fewer than two conditions. The joints' low-pass is that of the fit to all.
    """
    known = conditions(found.data)
    part = _parts(known)
    if not part.any():
        return None
    landed = found.predictor.landed(found.predict_left_out(part, progress))
    return pose_errors(found.data, landed - found.predictor.truth)


def _parts(known: Sequence[Hashable]) -> Indices:
    """The part (T,) of each throw, 0 to PARTS - 1 at most: equal conditions are in one part."""
    names = list(dict.fromkeys(known))
    order = np.random.default_rng(0).permutation(len(names))
    part = {names[i]: k % PARTS for k, i in enumerate(order)}
    return np.array([part[name] for name in known])


def _interval(values: Array, known: Sequence[Hashable]) -> tuple[float, float, float]:
    """The mean of values (T,) and the ends of its 95 % interval.

    Conditions are resampled, not throws: the errors of repeated throws are alike.
    """
    names = {name: i for i, name in enumerate(dict.fromkeys(known))}
    member = np.array([names[name] for name in known])
    totals, counts = np.bincount(member, values), np.bincount(member)
    drawn = np.random.default_rng(0).integers(len(names), size=(DRAWS, len(names)))
    means = totals[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return float(values.mean()), float(low), float(high)
