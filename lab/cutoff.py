"""The low-pass of recorded joints in a fit: its cutoff, and what a fit owes to it.

A low-pass takes accelerations from the swing, and leaves some of the noise. Both move a predicted
release in one direction, the first for every throw alike, and the fit of the contact with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..models import Array
from ..problems import InputError
from .fit import FitProblem
from .throws import ThrowData

#: Cutoffs [Hz] that are compared, each 1.4 times the one below.
CUTOFFS = tuple(20.0 * 1.4**k for k in range(8))
#: Place of the first among `CUTOFFS`.
FIRST = 2
#: Factor to the cutoffs beside a given one.
FACTOR = 1.4
#: Highest cutoff, a share of the recordings' rate.
HIGHEST = 0.45


@dataclass(frozen=True)
class CutoffEffect:
    """How a fit depends on the low-pass of the recorded joints.

    cutoff [Hz]: of the fit; chosen: as the one that lands the throws nearest, not given; beside:
    pairs of other cutoffs [Hz] and mu r_p [m] with these; edge: "lowest" or "highest" of those
    that were tried, a better one may lie beyond, else empty.
    """

    cutoff: float
    chosen: bool
    beside: tuple[tuple[float, float], ...]
    edge: str = ""

    @property
    def words(self) -> str:
        """The same as a line."""
        others = ", ".join(f"{1e3 * mu_r:.4g} mm at {at:.0f} Hz" for at, mu_r in self.beside)
        origin = "the nearest landings" if self.chosen else "given"
        origin += f", the {self.edge} tried" if self.edge else ""
        effect = (
            f"mu r_p {others}; included in +-" if others else "at this rate no other is possible"
        )
        return f"recorded joints low-passed, cutoff {self.cutoff:.0f} Hz ({origin}): {effect}"


@dataclass(frozen=True)
class CutoffFit:
    """A fit at its cutoff: point (P,) and cost. spread (P, P): covariance by the cutoff."""

    problem: FitProblem
    point: Array
    cost: float
    spread: Array
    effect: CutoffEffect | None
    evaluations: int


def fit_at_cutoff(data: ThrowData, fit_problem: Callable[[float | None], FitProblem]) -> CutoffFit:
    """The fit at the data's cutoff, or at the one whose fit lands nearest to the measured landings.

    fit_problem: makes the problem with joints at a cutoff. Motions of the hand have none.
    """
    given = data.shared.cutoff
    if data.arm is None:
        problem = fit_problem(None)
        point, cost = problem.fitted()
        still = np.zeros((point.size, point.size))
        return CutoffFit(problem, point, cost, still, None, problem.evaluations)
    rate = min(1.0 / float(np.median(np.diff(throw.times))) for throw in data.throws)
    ladder = CUTOFFS if given is None else (given / FACTOR, given, FACTOR * given)
    cutoffs = [one for one in ladder if one < HIGHEST * rate or one == given]
    if not cutoffs:
        raise InputError(
            f"{data.name}: joints are recorded at {rate:.3g} Hz: must be at least "
            f"{CUTOFFS[0] / HIGHEST:.0f} Hz"
        )
    place = min(FIRST, len(cutoffs) - 1) if given is None else cutoffs.index(given)
    fits: dict[int, tuple[FitProblem, Array, float]] = {}
    start: Array | None = None
    seen = set[int]()
    while place not in seen:
        seen.add(place)
        around = range(max(place - 1, 0), min(place + 2, len(cutoffs)))
        for k in (place, *around):
            if k not in fits:
                problem = fit_problem(cutoffs[k])
                fits[k] = (problem, *problem.fitted(start))
                start = fits[k][1]
        # The costs of two fits compare with equal deviations only.
        sigma = np.min([fits[k][0].sigma for k in around], axis=0)
        costs = {k: fits[k][0].cost(fits[k][1], sigma) for k in around}
        if given is None:
            place = min(costs, key=lambda k: costs[k])
    problem, point, cost = fits[place]
    others = [k for k in (place - 1, place + 1) if k in fits]
    beside = tuple((cutoffs[k], fits[k][0].belief(fits[k][1]).product) for k in others)
    ends = {0: "lowest", len(cutoffs) - 1: "highest"} if given is None and others else {}
    edge = ends.get(place, "")
    shifts = np.array([fits[k][1] - point for k in others]).reshape(-1, point.size)
    return CutoffFit(
        problem,
        point,
        cost,
        shifts.T @ shifts / max(len(others), 1),
        CutoffEffect(cutoffs[place], given is None, beside, edge),
        sum(other.evaluations for other, *_ in fits.values()),
    )
