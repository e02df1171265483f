"""Identification from measured throws: what it found, its words and files."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models import MODELS, STEPPED_SURFACE, Array, Indices, ReadOnly
from ..pictures import BLUE, GREEN, GREY, Table, new_figure, own_style, save_figure
from ..problems import InputError, Scene, as_scene, filling, write_json
from ..workers import Progress
from .belief import Belief, applied, contact_text, prior_of, sets_at
from .cutoff import CutoffEffect, fit_at_cutoff
from .fit import FitProblem
from .measured import SURFACE, batch_surface, pose_errors
from .predict import UNKNOWNS, Predictor, check_model
from .throws import ThrowData

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Files of an identification's folder.
FILES = (
    *("identify.json", "contact.toml", "comparison.csv"),
    *(f"contact-{model}.png" for model in MODELS),
)


@dataclass(frozen=True)
class Identified(ReadOnly):
    """The contact identified by one model.

    prior, posterior: the beliefs before and after the throws; off (T, 2): predicted less measured x
    [m], theta [rad] at the fit, NaN where the model predicts no landing; sigma: (x [m], theta
    [rad]) of the residuals; scatter: sigma over the measurement's noise, 1 or more; cost: of the
    least squares; cutoff: None for motions of the hand; at_bound: unknowns that ended at a bound of
    their range; evaluations: of the model; seconds: of the fit.
    """

    model: str
    data: ThrowData
    prior: Belief | None
    posterior: Belief
    off: Array
    sigma: tuple[float, float]
    scatter: tuple[float, float]
    cost: float
    cutoff: CutoffEffect | None
    at_bound: tuple[str, ...]
    evaluations: int
    seconds: float

    @property
    def pose_errors(self) -> Array:
        """Pose errors (T,) [m]: position plus angle times half the length; 10 without a landing."""
        return pose_errors(self.data, self.off)

    @cached_property
    def predictor(self) -> Predictor:
        """Predicts the throws as in the fit, the joints low-passed at its cutoff."""
        return Predictor.of(self.data, None if self.cutoff is None else self.cutoff.cutoff)

    def predict_left_out(self, part: Indices, progress: Progress) -> Array:
        """CoM pose and twist (T, 6) of each throw at detach, by a fit to the throws of other parts.

        part (T,): number of each throw's part, from 0. Each fit begins anew: it owes nothing to the
        throws that it predicts. The low-pass is that of the fit to all. progress(done, parts).
        """
        detach, count = np.empty((len(part), 6)), int(part.max()) + 1
        names = self.posterior.names
        for k in range(count):
            mine, others = (
                self.predictor.part(np.flatnonzero(rows)) for rows in (part == k, part != k)
            )
            problem = FitProblem(others, self.model, names, self.prior, lambda number: None)
            sets = sets_at(names, problem.fitted()[0])
            detach[part == k] = mine.detached(self.model, sets)[:, 0]
            progress(k + 1, count)
        return detach

    @property
    def error(self) -> float:
        """Mean pose error [m]."""
        return float(self.pose_errors.mean())

    @property
    def missed(self) -> int:
        """Number of throws without a predicted landing."""
        return int((~np.isfinite(self.off).all(axis=1)).sum())

    def apply(self, scene: Scene | str | Path) -> Scene:
        """The scene with the posterior as its contact and uncertainty."""
        return applied(self.posterior, as_scene(scene))

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units, radians; deviations of logarithms are relative."""
        return {
            "model": self.model,
            "data": self.data.name,
            "throws": len(self.data.throws),
            "truth": self.data.truth or None,
            "fit": {
                **self.posterior.to_dict(),
                "sigma": {"x": self.sigma[0], "theta": self.sigma[1]},
                "scatter": {"x": self.scatter[0], "theta": self.scatter[1]},
                "cost": self.cost,
                "missed": self.missed,
                "cutoff": None if self.cutoff is None else asdict(self.cutoff),
                "at_bound": list(self.at_bound),
                "evaluations": self.evaluations,
                "seconds": self.seconds,
            },
            "prior": None if self.prior is None else self.prior.to_dict(),
            "mean_error": self.error,
            "errors": {
                name: {"mean": float(np.nanmean(size)), "std": float(np.nanstd(size))}
                for name, size in zip(("x", "theta"), np.abs(self.off).T, strict=True)
            },
        }

    def summary(self) -> str:
        """The fit as lines for people."""
        belief, parts = self.posterior, []
        for name, value in belief.values().items():
            deviation = belief.deviation(name)
            if name == "delay":
                parts.append(f"delay {1e3 * value:.2f} +- {1e3 * deviation:.2f} ms")
                continue
            unit, factor = (" mm", 1e3) if name == "patch_radius" else ("", 1.0)
            parts.append(f"{name} {factor * value:.4g}{unit} +- {100 * deviation:.2g} %")
        low, high = 1e3 * belief.product_interval
        lines = [
            f"  {MODELS[self.model].title}:",
            f"    fit: {', '.join(parts)}",
            f"    mu r_p {1e3 * belief.product:.4g} mm +- {100 * belief.product_deviation:.2g} % "
            f"(95 %: {low:.3g} to {high:.3g} mm)",
            f"    mean pose error {100 * self.error:.3f} cm; {self.evaluations} evaluations, "
            f"{self.seconds:.1f} s",
        ]
        if self.cutoff is not None:
            lines.append(f"    {self.cutoff.words}")
        if max(self.scatter) > 1.0:
            x, theta = self.scatter
            # No model errs by more than 30 times the noise.
            wrong = ", or units, turns or clocks are wrong" if max(x, theta) > 30.0 else ""
            lines.append(
                f"    residuals are {x:.1f} (x) and {theta:.1f} (theta) times the measurement's "
                f"noise: the model errs, or the noise is larger{wrong}"
            )
        if self.at_bound:
            lines.append(
                f"    {', '.join(self.at_bound)}: at the bound of the search: give a --prior, or "
                "other throws"
            )
        return "\n".join(lines)

    def save(self, folder: str | Path) -> None:
        """Write identify.json, the picture and contact.toml."""
        save_identified([self], None, Path(folder))


def identify(
    data: ThrowData,
    model: str = "",
    *,
    prior: Belief | Scene | str | Path | None = None,
    delay: bool = False,
    grip_scale: bool = False,
    about: Callable[[str], Progress] | None = None,
) -> Identified:
    """Fit friction and patch radius, and on request a delay and the grip force's scale.

    model: of the release; if empty the one that the prior scene's tolerance names, or the limit
    surface. prior: a belief of these unknowns, or a scene whose [contact] and [uncertainty] are
    one. delay [s]: of the opening beyond the fall of the recorded force, 0 unless fitted.
    about(words) gives the progress of a part. InputError for an unknown model, and if the throws
    cannot tell the unknowns.
    """
    if isinstance(prior, Scene | str | Path):
        prior = as_scene(prior)
    if not model:
        model = prior.tolerance.model if isinstance(prior, Scene) else STEPPED_SURFACE
    _check_fit(data, model)
    optional = {"delay": delay, "grip_scale": grip_scale}
    names = tuple(name for name in UNKNOWNS if optional.get(name, True))
    if isinstance(prior, Scene):
        prior = prior_of(prior, names)
    elif prior is not None:
        names = prior.names
    show = about or no_progress
    words, start = f"fit by {model}", time.perf_counter()
    show(words)

    def fit_problem(cutoff: float | None) -> FitProblem:
        at = "" if cutoff is None else f", joints low-passed at {cutoff:.0f} Hz"
        progress = lambda n: show(f"{words}{at}, evaluation {n}")  # noqa: E731
        return FitProblem(Predictor.of(data, cutoff), model, names, prior, progress)

    fit = fit_at_cutoff(data, fit_problem)
    problem, point = fit.problem, fit.point
    problem.check(point)
    off, (low, high) = problem.missed_by(point[None])[0], problem.bounds
    at_bound = np.minimum(point - low, high - point) / (high - low) < 1e-3
    scatter, sigma = problem.sigma / problem.noise, problem.sigma
    return Identified(
        model,
        data,
        prior,
        Belief(names, point, problem.covariance(point) + fit.spread),
        off,
        (float(sigma[0]), float(sigma[1])),
        (float(scatter[0]), float(scatter[1])),
        fit.cost,
        fit.effect,
        tuple(np.array(names)[at_bound].tolist()),
        fit.evaluations,
        time.perf_counter() - start,
    )


def no_progress(words: str) -> Progress:
    """An `about` that shows nothing."""
    return lambda done, total: None


def _check_fit(data: ThrowData, model: str) -> None:
    """InputError for a model that cannot be fitted, and for throws on several surfaces."""
    check_model(model)
    surfaces = data.factors.get(SURFACE, [])
    if len(surfaces) > 1:
        raise InputError(
            f"{SURFACE}: one contact cannot be that of {', '.join(surfaces)}: give throws of one"
        )
    if MODELS[model].nonconvergent:
        raise InputError(
            f"model = {model!r}: cannot be fitted, its landings are no smooth function of the "
            f"parameters: take {STEPPED_SURFACE}"
        )


def one_surface(data: ThrowData) -> ThrowData:
    """The throws on the surface that most are on: one contact fits one surface."""
    return data.picked(batch_surface(data))


def summary_of(found: list[Identified]) -> str:
    """The data's own lines, then what each model found."""
    data = found[0].data
    surface = data.factors.get(SURFACE, [""])[0]
    lines = [f"{data.name}: {len(data.throws)} throws" + (f" on {surface}" if surface else "")]
    if {"friction", "patch_radius"} <= set(data.truth):
        known = [f"{name} {data.truth[name]:g}" for name in UNKNOWNS if name in data.truth]
        product = data.truth["friction"] * data.truth["patch_radius"]
        lines.append(f"  truth: {', '.join(known)}; mu r_p {1e3 * product:.4g} mm")
    lines += [one.summary() for one in found]
    return "\n".join([*lines, *(f"  note: {words}" for words in data.notes)])


def save_identified(
    found: list[Identified], table: Table | None, folder: Path, scene: Scene | None = None
) -> None:
    """Write the files of one or more models, and a table that compares them; contact.toml is that
    of the last, with all else that the [uncertainty] of a scene has."""
    with filling(folder, FILES) as scratch:
        for one in found:
            save_figure(_contact_picture(one), scratch / f"contact-{one.model}.png")
        last, shared = found[-1], found[-1].data.shared
        text = f"# from {len(last.data.throws)} throws of {last.data.name}, by {last.model}\n"
        known = None if scene is None else applied(last.posterior, scene).uncertainty
        text += contact_text(last.posterior, shared, known)
        (scratch / "contact.toml").write_text(text, encoding="utf-8")
        write_json(scratch / "identify.json", [one.to_dict() for one in found])
        if table is not None:
            table.write(scratch)


@own_style()
def _contact_picture(found: Identified) -> Figure:
    """Prior and fit with 95 % regions over mu and r_p, and the truth of a synthetic data set."""
    fit, truth = found.posterior, found.data.truth
    title = f"{MODELS[found.model].title}, {len(found.data.throws)} throws"
    words = f"fit: μ r_p {1e3 * fit.product:.3f} mm ± {100 * fit.product_deviation:.1f} %"
    figure = new_figure(7.6, 6.0, f"{title}\n{words}")
    axis = figure.add_subplot()
    if found.prior is not None:
        _draw_belief(axis, found.prior, "prior, 95 % region", GREY)
    _draw_belief(axis, fit, "fit, 95 % region", GREEN)
    limits = axis.get_xlim(), axis.get_ylim()
    x = np.geomspace(max(limits[0][0], 1e-3), max(limits[0][1], 2e-3), 200)
    axis.plot(x, 1e3 * fit.product / x, color=GREY, ls=":", lw=1, label="equal μ r_p")
    axis.set(xlim=limits[0], ylim=limits[1])
    if {"friction", "patch_radius"} <= set(truth):
        mu, radius = truth["friction"] * truth.get("grip_scale", 1.0), 1e3 * truth["patch_radius"]
        axis.plot(mu, radius, "*", color=BLUE, ms=14, mec="white", ls="none", label="truth")
    axis.set(xlabel="friction μ", ylabel="patch radius r_p [mm]")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _draw_belief(axis: Axes, belief: Belief, label: str, colour: str) -> None:
    """A belief's mean and 95 % region."""
    known = belief.effective
    outline = known.ellipse()
    axis.plot(outline[:, 0], 1e3 * outline[:, 1], color=colour, lw=1.8, zorder=4)
    place = known.value("friction"), 1e3 * known.value("patch_radius")
    axis.plot(*place, "o-", color=colour, ms=7, mec="white", label=label, zorder=5)
