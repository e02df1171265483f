"""The release models by name, for commands, tables and pictures.

A new model is a module with a class for one case (and perhaps batches), and an entry of `MODELS`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, cast

from .cases import BatchRelease, CaseModel, Release, ReleaseBatch, ReleaseCase
from .limit_surface import SteppedRelease
from .own import OwnRelease
from .patch import PatchRelease
from .published_surface import ImplicitRelease, KarnoppRelease
from .sliding_pivot import SlidingPivot, SlidingPivotRelease


class BatchModel(CaseModel, Protocol):
    """A release model that throws N bodies at once."""

    def throw(self, batch: ReleaseBatch, steps: int) -> BatchRelease:
        """The batch in `steps` steps of each opening."""


@dataclass(frozen=True)
class ReleaseModel:
    """A release model with its settings.

    name: key in commands and scenes; title: in text; law: its friction; method: its solution;
    colour: in pictures; model: for one case, and, if it has batches, for N. steps: of an opening in
    a batch; fit_steps: in fits, which repeat throws hundreds of times; 0: the model's own. chunk:
    throws of a sweep in some tenths of a second. nonconvergent: its result does not settle with its
    steps, so that it has neither sweeps nor derivatives; decides: a scene's
    tolerance may ask for it, and the core throws it exactly (`EXACT` in planner/throw).
    """

    name: str
    title: str
    law: str
    method: str
    colour: str
    model: CaseModel
    batches: bool = True
    steps: int = 0
    fit_steps: int = 0
    chunk: int = 64
    nonconvergent: bool = False
    decides: bool = False

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case."""
        return self.model.release(case)

    def throw(self, batch: ReleaseBatch, steps: int = 0) -> BatchRelease:
        """The releases of a batch, in the usual number of steps unless told otherwise.

        Raises TypeError for a model without batches.
        """
        if not self.batches:
            raise TypeError(f"{self.name} throws no batches")
        return cast(BatchModel, self.model).throw(batch, steps or self.steps)

    def summary(self) -> str:
        """Title, law and method in one line."""
        return f"{self.title}: {self.law}; {self.method}"

    @property
    def quick(self) -> bool:
        """Whether it throws grids of contact parameters in seconds."""
        return self.batches and self.chunk >= 1000

    def with_pressure(self, pressure: str) -> ReleaseModel:
        """The model with 'uniform' or 'hertz' pressure of the pads; itself if it has no points."""
        if pressure == "uniform" or not isinstance(self.model, PatchRelease):
            return self
        return replace(self, model=replace(self.model, pressure=pressure))


#: The model of the NLP.
SLIDING_PIVOT = "sp"
#: The model nearest to real pads; it decides on plans unless a scene names another.
STEPPED_SURFACE = "ls-step"

_SURFACE = "an ellipsoid of force and torque"
_SMOOTHED = f"{_SURFACE}, smoothed over the slip speed"
_CUT = "Runge-Kutta, steps cut at events"
_KARNOPP = "explicit Euler, Karnopp's dead zone"

#: All models, as tables show them.
MODELS = {
    model.name: model
    for model in (
        ReleaseModel(
            SLIDING_PIVOT,
            "sliding pivot",
            "the bar sticks, pivots about the pads, slides (Liu and Billard)",
            _CUT,
            "#e0912f",
            SlidingPivotRelease(),
            steps=48,
            chunk=1024,
            decides=True,
        ),
        ReleaseModel(
            "sp-paper",
            "sliding pivot, paper's form",
            "the same, with the paper's jump of the rates as sliding begins",
            _CUT,
            "#8c6bb1",
            SlidingPivotRelease("paper"),
            steps=400,  # it jumps, so it needs more of them
            # Landings are off by 0.2 mm in the mean and 1.3 mm at most, in a quarter of the time.
            fit_steps=100,
            chunk=2048,
        ),
        ReleaseModel(
            "ls",
            "limit surface, explicit",
            _SURFACE,
            _KARNOPP,
            "#d1495b",
            KarnoppRelease(),
            chunk=2048,
            nonconvergent=True,
        ),
        ReleaseModel(
            "ls-smooth",
            "smoothed limit surface, explicit",
            _SMOOTHED,
            _KARNOPP,
            "#b5838d",
            KarnoppRelease(half_band=0.01),
            batches=False,
            nonconvergent=True,
        ),
        ReleaseModel(
            "ils",
            "smoothed limit surface, implicit",
            _SMOOTHED,
            "LSODA",
            "#2a9d6f",
            ImplicitRelease(),
            batches=False,
        ),
        ReleaseModel(
            STEPPED_SURFACE,
            "limit surface, time stepping",
            _SURFACE,
            "Moreau-Jean steps",
            "#4c78a8",
            SteppedRelease(),
            steps=120,
            chunk=1024,
            decides=True,
        ),
        ReleaseModel(
            "patch",
            "patch of points",
            "64 points with Coulomb friction: the measure of model errors",
            "backward Euler",
            "#6b705c",
            PatchRelease(),
            steps=500,
        ),
        ReleaseModel(
            "lugre",
            "bristles (LuGre)",
            "64 points with bristles",
            "backward Euler",
            "#118ab2",
            PatchRelease(stiffness=1e7),
            steps=500,
        ),
    )
}


def own_model(law: type[SlidingPivot]) -> ReleaseModel:
    """The model of a user's own law."""
    name, words = law.__name__, (law.__doc__ or "a law of one's own").splitlines()[0].rstrip(".")
    model = OwnRelease(law)
    return ReleaseModel(name, name, words, "Runge-Kutta", "#444444", model, steps=1, decides=True)


#: Models with batches, for sweeps, `simulate_batch` and the verdict on a plan.
BATCH_MODELS = {n: m for n, m in MODELS.items() if m.batches and not m.nonconvergent}
DECIDING = tuple(name for name, model in MODELS.items() if model.decides)
