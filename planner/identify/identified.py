"""Identification from measured throws: the fit, its files and words."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models.release import MODELS, STEPPED_SURFACE
from ...problems import InputError, Scene
from ...problems.files import filling
from ...problems.throws import ThrowData
from ..show import save
from .belief import Belief, applied, contact_text, prior_of, sets_at
from .conditions import SURFACE, batch_surface
from .fit import Fit, fit_to
from .grid import MISSED
from .pictures import contact_picture
from .predict import UNKNOWNS, Predictor, Progress, check_model

#: Files that may be left in the folder.
FILES = (
    "identify.json",
    "contact.toml",
    *(f"contact-{model}.png" for model in MODELS),
)


@dataclass(frozen=True)
class Identified:
    """The contact identified by one model.

    error [m]: mean pose error (position plus angle times half the length) at the fit.
    """

    model: str
    data: ThrowData
    prior: Belief | None
    fit: Fit
    error: float

    @property
    def posterior(self) -> Belief:
        """The belief after the throws."""
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
            "fit": self.fit.to_dict(),
            "prior": None if self.prior is None else self.prior.to_dict(),
            "mean_error": self.error,
        }

    def summary(self) -> str:
        """The fit as lines for people."""
        return "\n".join([f"  {MODELS[self.model].title}:", *self.fit.summary(self.error)])

    def save(self, folder: str | Path) -> None:
        """Write identify.json, the picture and contact.toml."""
        save_identified([self], Path(folder))


def identify(
    data: ThrowData,
    model: str = "",
    *,
    prior: Belief | Scene | None = None,
    delay: bool = False,
    grip_scale: bool = False,
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
    if MODELS[model].nonconvergent:
        raise InputError(
            f"model = {model!r}: cannot be fitted, its landings are no smooth function of the "
            f"parameters: take {STEPPED_SURFACE}, or compare it by `throwplan validate`"
        )
    optional = {"delay": delay, "grip_scale": grip_scale}
    names = tuple(name for name in UNKNOWNS if optional.get(name, True))
    if isinstance(prior, Scene):
        prior = prior_of(prior, names)
    elif prior is not None:
        names = prior.names
    show = about or (lambda words: lambda done, total: None)
    predictor, words = Predictor.of(data), f"fit by {model}"
    show(words)
    fit = fit_to(predictor, model, names, prior, lambda n: show(f"{words}, evaluation {n}"))
    landing = predictor.landings(model, sets_at(names, fit.posterior.mean))
    off = landing - predictor.truth.landing[:, None]
    error = float(np.nan_to_num(predictor.truth.scaled(off), nan=MISSED).mean())
    return Identified(model, data, prior, fit, error)


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


def save_identified(found: list[Identified], folder: Path) -> None:
    """Write the files of one or more models; contact.toml is that of the last."""
    with filling(folder, FILES) as scratch:
        for one in found:
            title = f"{MODELS[one.model].title}, {len(one.data.throws)} throws"
            figure = contact_picture(title, one.data.truth, one.prior, one.posterior)
            save(figure, scratch / f"contact-{one.model}.png")
        last, shared = found[-1], found[-1].data.shared
        text = f"# from {len(last.data.throws)} throws of {last.data.name}, by {last.model}\n"
        text += contact_text(last.posterior, shared.torsion, shared.faces)
        (scratch / "contact.toml").write_text(text, encoding="utf-8")
        text = json.dumps([one.to_dict() for one in found], indent=2, allow_nan=False)
        (scratch / "identify.json").write_text(text + "\n", encoding="utf-8")
