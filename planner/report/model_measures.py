"""Every method on one throw: its time, its errors, and the best of them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ...models import Release
from .model_runs import STIFFNESSES, Method, bristled, extrapolated, patched, stepped
from .model_throws import Throw, detached, off
from .model_truths import patch_truth, pivot_truth, surface_truth
from .page import Effort
from .pareto import pareto

Array = npt.NDArray[np.float64]
T = TypeVar("T")

#: Units in which people read errors: landing x, theta, detach twist, scaled landing.
SHOWN = np.array([1e3, math.degrees(1.0), 1e3, 1e3])
ERRORS = ("x [mm]", "θ [deg]", "twist [mm/s]")
#: Points of a finer patch, which tells how well the usual one is meshed.
FINE_MESH = 256
#: Seconds from which on a run is not repeated, quick and full.
LONG = (0.03, 0.2)


@dataclass(frozen=True)
class Row:
    """One method on one throw: time [s], errors (4,) by `differences`, why it is not to be
    trusted; best: the errors ('own', 'model') in whose Pareto set it is.
    """

    method: Method
    seconds: float
    own: Array
    model: Array
    trouble: str
    best: tuple[str, ...] = ()


@dataclass(frozen=True)
class Measured:
    """All of one throw. truths: detach states (6,) by law; known: how well, errors (4,)."""

    throw: Throw
    truths: Mapping[str, Array]
    known: Mapping[str, Array]
    rows: Sequence[Row]

    def apart(self, law: str) -> Array:
        """Model error (4,) of a law that is converged."""
        return off(self.throw, self.truths[law], self.truths["patch"])


def least_time(run: Callable[[], T], repeats: int, budget: float, long: float) -> tuple[float, T]:
    """Least processor time [s] of `run` after a warm one, and its result.

    At least `repeats` times, and more as long as they take less than `budget` seconds; a
    first run beyond `long` seconds is not repeated.
    """
    start = time.process_time()
    found = run()
    first = time.process_time() - start
    if first > long:
        return first, found
    seconds: list[float] = []
    while len(seconds) < repeats or (sum(seconds) < budget and len(seconds) < 50):
        start = time.process_time()
        run()
        seconds.append(time.process_time() - start)
    return min(seconds), found


def measure(
    throw: Throw, ways: Sequence[Method], effort: Effort, tick: Callable[[], None]
) -> Measured:
    """Converged answers of one throw, then every method."""
    case, fine = throw.case, effort.of(5000, 10_000)
    truths = {"sp": pivot_truth(case), "ls": surface_truth(case), "patch": patch_truth(case)}
    truths["ils"] = detached(extrapolated(stepped, fine, case))
    for stiffness in STIFFNESSES:
        run = partial(bristled, stiffness)
        truths[f"{stiffness:g}"] = detached(extrapolated(run, effort.of(100, 2000), case))
    located = next(w for w in reversed(ways) if w.family == "sp, RK4, events located")
    second = {
        "sp": detached(located.run(case)),
        "ls": truths["ils"],
        "patch": detached(extrapolated(patched, effort.of(500, 2000), case)),
    }
    known = {law: off(throw, end, truths[law]) for law, end in second.items()}
    if not effort.quick:
        known["mesh"] = off(throw, patch_truth(case, FINE_MESH), truths["patch"])
    known["ils"] = known["ls"]
    tick()
    repeats, long = effort.of(1, 3), LONG[effort.of(0, 1)]
    rows = []
    for method in ways:
        seconds, release = least_time(partial(method.run, case), repeats, long / 5, long)
        rows.append(_row(throw, method, seconds, release, truths))
        tick()
    return Measured(throw, truths, known, marked(rows, known))


def _row(
    throw: Throw, method: Method, seconds: float, release: Release, truths: Mapping[str, Array]
) -> Row:
    end, trouble = detached(release), release.trouble
    own, model = off(throw, end, truths[method.law]), off(throw, end, truths["patch"])
    if not np.isfinite(own).all() and not trouble:
        trouble = "no landing: the object never comes down to that height"
    return Row(method, seconds, own, model, trouble)


def marked(rows: Sequence[Row], known: Mapping[str, Array]) -> list[Row]:
    """The rows with their Pareto sets: of one law for the own error, of all for the model's.

    Rows in trouble are in none; errors below what is known of the answer are equal.
    """
    sound = [i for i, row in enumerate(rows) if not row.trouble]
    best: dict[int, tuple[str, ...]] = dict.fromkeys(range(len(rows)), ())
    laws = {rows[i].method.law.replace("ils", "ls") for i in sound}
    for law in sorted(laws & {"sp", "ls", "patch"}):
        some = [i for i in sound if rows[i].method.law.replace("ils", "ls") == law]
        errors = [max(float(rows[i].own[3]), float(known[law][3])) for i in some]
        for k in pareto([rows[i].seconds for i in some], errors):
            best[some[k]] += ("own",)
    # The patch's own rows are the measure, not models of it.
    some = [i for i in sound if rows[i].method.law != "patch"]
    for k in pareto([rows[i].seconds for i in some], [float(rows[i].model[3]) for i in some]):
        best[some[k]] += ("model",)
    return [replace(row, best=best[i]) for i, row in enumerate(rows)]
