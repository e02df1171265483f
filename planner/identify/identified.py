"""Identification from measured throws: the grid, the fit, their files and words."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...models.release import MODELS, STEPPED_SURFACE
from ...problems import InputError, Scene
from ...problems.files import filling
from ...problems.throws import ThrowData
from ..show import save
from .belief import Belief, applied, contact_text, prior_of, sets_at
from .factors import SURFACE, usual_surface
from .fit import Fit, fit_to
from .grid import AXES, MISSED, Grid, grid_of
from .pictures import contact_picture
from .predict import UNKNOWNS, Predictor, Progress, check_model

#: Reason why a model that does not converge is not fitted.
NO_FIT = "its landings are no smooth function of the parameters"
#: Files that may be left in the folder.
FILES = (
    "identify.json",
    "contact.toml",
    *(f"grid-{model}.csv" for model in MODELS),
    *(f"contact-{model}.png" for model in MODELS),
)


@dataclass(frozen=True)
class Identified:
    """The contact identified by one model.

    grid: the error landscape, None if not requested; fit: None for a model that does not converge;
    error [m]: mean pose error (position plus angle times half the length) at the fit.
    """

    model: str
    data: ThrowData
    prior: Belief | None
    grid: Grid | None = field(repr=False)
    fit: Fit | None
    error: float | None

    @property
    def posterior(self) -> Belief:
        """The belief after the throws."""
        assert self.fit is not None, NO_FIT
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
        }

    def summary(self) -> str:
        """The grid and the fit as lines for people."""
        lines, grid, fit = [f"  {MODELS[self.model].title}:"], self.grid, self.fit
        if grid is not None:
            lines += grid.summary()
        if fit is not None and self.error is not None:
            lines += fit.summary(self.error)
        else:
            lines.append(f"    no fit: {NO_FIT}")
        return "\n".join(lines)

    def save(self, folder: str | Path) -> None:
        """Write identify.json, the grid, the pictures and contact.toml."""
        save_identified([self], Path(folder))


def identify(
    data: ThrowData,
    model: str = "",
    *,
    prior: Belief | Scene | None = None,
    delay: bool = False,
    grip_scale: bool = False,
    grid: bool = True,
    about: Callable[[str], Progress] | None = None,
) -> Identified:
    """Fit friction and patch radius, and on request a delay and the grip force's scale.

    model: of the release; if empty the one that the prior scene's tolerance names, or the limit
    surface. prior: a belief of these unknowns, or a scene whose [contact] and [uncertainty] are
    one. about(words) gives the progress of a part. InputError for an unknown model, and if the
    throws cannot tell the unknowns.
    """
    if not model:
        model = prior.tolerance.model if isinstance(prior, Scene) else STEPPED_SURFACE
    check_model(model)
    surfaces = data.factors.get(SURFACE, [])
    if len(surfaces) > 1:
        raise InputError(
            f"{SURFACE}: one contact cannot be that of {', '.join(surfaces)}: give throws of one"
        )
    known = MODELS[model]
    if known.nonconvergent and not grid:
        raise InputError(f"model = {model!r}: only its grid: {NO_FIT}")
    optional = {"delay": delay, "grip_scale": grip_scale}
    names = tuple(name for name in UNKNOWNS if optional.get(name, True))
    if isinstance(prior, Scene):
        prior = prior_of(prior, names)
    elif prior is not None:
        names = prior.names
    show = about or (lambda words: lambda done, total: None)
    predictor = Predictor.of(data)
    fit, error, fixed = None, None, (0.0, 1.0)
    if not known.nonconvergent:
        words = f"fit by {model}"
        show(words)
        fit = fit_to(predictor, model, names, prior, lambda n: show(f"{words}, evaluation {n}"))
        belief = fit.posterior
        fixed = belief.value("delay"), belief.value("grip_scale")
        landing = predictor.landings(model, sets_at(names, belief.mean))
        off = landing - predictor.truth.landing[:, None]
        error = float(np.nan_to_num(predictor.truth.scaled(off), nan=MISSED).mean())
    landscape = None
    if grid:
        landscape = grid_of(predictor, model, AXES, fixed, show(f"grid by {model}"))
    return Identified(model, data, prior, landscape, fit, error)


def one_surface(data: ThrowData) -> ThrowData:
    """The throws on the surface that most are on: one contact fits one surface."""
    return data.picked(usual_surface(data))


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


def save_identified(found: list[Identified], folder: Path) -> None:
    """Write the files of one or more models; contact.toml is that of the last."""
    with filling(folder, FILES) as scratch:
        for one in found:
            if one.grid is not None:
                _write_grid(one.grid, scratch / f"grid-{one.model}.csv")
            belief = None if one.fit is None else one.fit.posterior
            title = f"{MODELS[one.model].title}, {len(one.data.throws)} throws"
            figure = contact_picture(title, one.data.truth, one.grid, one.prior, belief)
            save(figure, scratch / f"contact-{one.model}.png")
        last = next((one for one in reversed(found) if one.fit is not None), None)
        if last is not None:
            shared = last.data.shared
            head = f"# from {len(last.data.throws)} throws of {last.data.name}, by {last.model}\n"
            text = head + contact_text(last.posterior, shared.torsion, shared.faces)
            (scratch / "contact.toml").write_text(text, encoding="utf-8")
        text = json.dumps([one.to_dict() for one in found], indent=2, allow_nan=False)
        (scratch / "identify.json").write_text(text + "\n", encoding="utf-8")


def _write_grid(grid: Grid, path: Path) -> None:
    """A row per cell: friction, patch_radius [m], mean pose error [m], throws without landing."""
    mu, radius = (v.ravel() for v in np.meshgrid(grid.friction, grid.patch_radius, indexing="ij"))
    rows = np.column_stack([mu, radius, grid.error.ravel(), grid.missed.ravel()])
    names = "friction,patch_radius_m,mean_error_m,missed"
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.9g")
