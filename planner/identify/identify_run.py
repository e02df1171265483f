"""Identification from measured throws: the grid, the fit, and what comes of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems import InputError, Scene, ThrowData
from .factors import SURFACE
from .fit import Fit, costs_at, fit_to, unknowns
from .fit_belief import Belief, parameters_at
from .fit_scene import applied, prior_of
from .fit_starts import STARTS, starts_from_grid, starts_from_prior
from .grid import (
    FRICTION,
    PATCH_RADIUS,
    PATIENCE,
    Grid,
    Progress,
    estimated_seconds,
    grid_of,
    mean_error,
)
from .measured import Measured, measured
from .predict import BATCHES, Predictor, check_model

Array = npt.NDArray[np.float64]

#: Why one model is not fitted.
NO_FIT = "model = 'ls': only its grid: its landings are no smooth function of the parameters"
#: The grid's axes.
AXES = (FRICTION, PATCH_RADIUS)
#: Evaluations that a fit takes, about, for estimating its time.
FIT_EVALUATIONS = 12
#: Points of each profile, and how far it goes, in standard deviations.
PROFILE_POINTS, PROFILE_REACH = 21, 3.0


@dataclass(frozen=True)
class Profile:
    """The fit's cost along one combination: its value, and the cost above the best one.

    The other unknowns follow as they would for a normal distribution.
    """

    value: Array
    cost: Array


@dataclass(frozen=True)
class Identified:
    """What was found about the contact by one model.

    grid: the error landscape, None if it was not asked for or would take too long; fit:
    None where that would take too long, and for `ls`; error [m]: mean scaled error at the
    fit; each [s]: time of one prediction by a slow model, from a subset; whole [s]: what
    the grid would take with it; profiles: the fit's cost along product, friction and
    patch_radius.
    """

    model: str
    data: ThrowData
    prior: Belief | None
    grid: Grid | None
    fit: Fit | None
    error: float | None
    each: float | None = None
    whole: float | None = None
    profiles: dict[str, Profile] = dataclasses.field(default_factory=dict)

    @property
    def posterior(self) -> Belief:
        """What is believed after the throws."""
        assert self.fit is not None, "this model was too slow for a fit"
        return self.fit.posterior

    def apply(self, scene: Scene) -> Scene:
        """The scene with the posterior as its contact and uncertainty."""
        return applied(self.posterior, scene)

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units, radians; deviations of logarithms are relative."""
        return {
            "model": self.model,
            "data": self.data.name,
            "throws": len(self.data.throws),
            "truth": self.data.truth or None,
            "grid": None if self.grid is None else self.grid.to_dict(),
            "fit": None if self.fit is None else self.fit.to_dict(),
            "prior": None if self.prior is None else self.prior.to_dict(),
            "mean_error": self.error,
            "subset": None
            if self.each is None
            else {"seconds_per_throw": self.each, "extrapolated_seconds": self.whole},
        }

    def summary(self) -> str:
        """The grid and the fit in some lines for people."""
        lines = [f"  {self.model}:"]
        if self.each is not None and self.whole is not None:
            lines.append(
                f"    {1e3 * self.each:.3g} ms a throw, timed on a subset; the grid of "
                f"{400 * len(self.data.throws):,} predictions would take {self.whole / 60:.3g} min "
                "(extrapolated)" + ("" if self.grid is not None else ", not run")
            )
        if self.grid is not None:
            told = self.grid.to_dict()
            lost = f", {told['missed']} do not land" if told["missed"] else ""
            lines += [
                f"    grid: least mean error {100 * told['least_error']:.3f} cm (most "
                f"{100 * told['most_error']:.3f}) at friction {told['friction']:.3g}, patch_radius "
                f"{1e3 * told['patch_radius']:.3g} mm, mu r_p {1e3 * told['product']:.3g} mm",
                f"    {told['predictions']:,} predictions in {told['seconds']:.1f} s, "
                f"{1e3 * told['time_per_throw']:.3g} ms a throw{lost}",
            ]
        if self.fit is not None and self.error is not None:
            lines += _fit_words(self.fit, self.error)
        elif self.model == "ls":
            lines.append("    no fit: its landings are no smooth function of the parameters")
        return "\n".join(lines)

    def save(self, folder: str | Path) -> None:
        """Write identify.json, the grid, the pictures and contact.toml."""
        from .identify_files import save_identified

        save_identified([self], Path(folder))


def _fit_words(fit: Fit, error: float) -> list[str]:
    """The fit for people; error [m]: mean scaled error of its landings."""
    belief, parts = fit.posterior, []
    for name, value in belief.values().items():
        deviation = belief.deviation(name)
        if name == "delay":
            parts.append(f"delay {1e3 * value:.2f} +- {1e3 * deviation:.2f} ms")
            continue
        unit, factor = (" mm", 1e3) if name == "patch_radius" else ("", 1.0)
        parts.append(f"{name} {factor * value:.4g}{unit} +- {100 * deviation:.2g} %")
    lines = [
        f"    fit: {', '.join(parts)}",
        f"    mu r_p {1e3 * belief.product:.4g} mm +- {100 * belief.product_deviation:.2g} %, "
        f"mean error {100 * error:.3f} cm; {fit.derivatives}, {fit.evaluations} evaluations, "
        f"{fit.seconds:.1f} s",
    ]
    if max(fit.scatter) > 1.0:
        lines.append(
            f"    residuals are {fit.scatter[0]:.1f} (x) and {fit.scatter[1]:.1f} (theta) times "
            "the measurement's noise: the model errs, or the noise is larger"
        )
    if fit.at_bound:
        lines.append(f"    {', '.join(fit.at_bound)}: at the edge of what is searched")
    return lines


def identify(
    data: ThrowData,
    model: str = "ls-step",
    *,
    prior: Belief | Scene | None = None,
    delay: bool = False,
    grip_scale: bool = False,
    grid: bool = True,
    executor: Executor | None = None,
    workers: int = 1,
    about: Callable[[str], Progress] | None = None,
) -> Identified:
    """Friction and patch radius, and a delay and the grip force's scale if asked for.

    prior: a belief of just these unknowns, or a scene whose [contact] and [uncertainty] say
    it. executor, workers: who shares the grid. about(words) gives the progress of a part.
    InputError for an unknown model and where the throws cannot tell the unknowns.
    """
    check_model(model)
    surfaces = data.factors.get(SURFACE, [])
    if len(surfaces) > 1:
        raise InputError(
            f"{SURFACE}: one contact cannot be that of {', '.join(surfaces)}: give throws of one"
        )
    names = unknowns(delay, grip_scale)
    if isinstance(prior, Scene):
        prior = prior_of(prior, names)
    elif prior is not None:
        names = prior.names
    show = about or (lambda words: lambda done, total: None)
    predictor, truth = Predictor(data), measured(data)
    each = estimated_seconds(predictor, model, truth)
    whole = None if each is None else each * len(data.throws) * 400
    found: Grid | None = None
    calls = FIT_EVALUATIONS * len(data.throws) * (1 + 2 * len(names))
    slow = each is not None and each * calls > PATIENCE

    def landscape(fixed: tuple[float, float]) -> Grid | None:
        if not grid or (whole is not None and whole > PATIENCE):
            return None
        spread = executor if model in BATCHES else None
        many = workers if spread is not None else 1
        line = show(f"grid by {model}")
        return grid_of(predictor, model, truth, AXES, fixed, spread, many, line)

    # A delay or scale that is fitted comes first: the grid is at its value.
    if model == "ls":
        if not grid:
            raise InputError(NO_FIT)
        slow = True
    if slow or (len(names) == 2 and prior is None):
        found = landscape((0.0, 1.0))
    if slow:
        return Identified(model, data, prior, found, None, None, each, whole)
    show(f"fit by {model}")
    starts = _starts(predictor, model, truth, names, prior, found)
    fit = fit_to(predictor, model, truth, names, starts, prior)
    belief = fit.posterior
    error, _ = mean_error(predictor, model, truth, parameters_at(names, belief.mean))
    profiles = _profiles(predictor, model, truth, fit, prior) if model in BATCHES else {}
    if found is None:
        found = landscape((belief.value("delay"), belief.value("grip_scale")))
    return Identified(model, data, prior, found, fit, error, each, whole, profiles)


def _starts(
    predictor: Predictor,
    model: str,
    truth: Measured,
    names: tuple[str, ...],
    prior: Belief | None,
    grid: Grid | None,
) -> Array:
    """Where the fit starts (S, P): at the prior, or at the grid's best cells."""
    if prior is not None:
        return starts_from_prior(predictor, model, truth, prior)
    if grid is None:
        return starts_from_grid(predictor, model, truth, names)
    return grid.starts(STARTS)


def _profiles(
    predictor: Predictor, model: str, truth: Measured, fit: Fit, prior: Belief | None
) -> dict[str, Profile]:
    """The fit's cost along mu r_p, along mu and along r_p."""
    belief = fit.posterior
    reach = np.linspace(-PROFILE_REACH, PROFILE_REACH, PROFILE_POINTS)
    combinations = {
        "product": {"friction": 1.0, "patch_radius": 1.0, "grip_scale": 1.0},
        "friction": {"friction": 1.0, "grip_scale": 1.0},
        "patch_radius": {"patch_radius": 1.0},
    }
    found = {}
    for name, weights in combinations.items():
        w = np.array([weights.get(unknown, 0.0) for unknown in belief.names])
        deviation = float(np.sqrt(w @ belief.covariance @ w))
        # A factor of three either way at most: beyond it nothing is believed anyway.
        steps = reach * min(deviation, 1.1 / PROFILE_REACH)
        moves = belief.covariance @ w / deviation**2
        points = belief.mean + steps[:, None] * moves
        cost = costs_at(predictor, model, truth, fit.sigma, belief.names, prior, points)
        found[name] = Profile(np.exp(points @ w), cost - cost.min())
    return found
