"""Between scenes and beliefs: a scene's doubt as a prior, a posterior as a scene's doubt."""

from __future__ import annotations

import dataclasses
import json
import math
import textwrap

import numpy as np
import numpy.typing as npt

from ...problems import Distribution, Scene, Uncertainty, uncertainty_table
from .fit_belief import Belief

Array = npt.NDArray[np.float64]
#: Two unknowns and their correlation.
Pair = tuple[str, str, float]

#: Standard deviations taken where a scene says nothing: relative ones, and the delay's [s].
ASSUMED = {"friction": 0.4, "patch_radius": 0.4, "delay": 0.01, "grip_scale": 0.1}
#: Normal distributions stand for those of the logarithms while what that adds to the
#: product of friction and radius is below this share of its own deviation.
NARROW = 0.3
#: Values that stand for a wider one.
SAMPLES = 99
#: Correlations closer to one are not written.
STRONGEST = 0.9999


def prior_of(scene: Scene, names: tuple[str, ...]) -> Belief:
    """What a scene says of the unknowns: its [contact], and its [uncertainty] if it has one.

    What that does not name is taken 40 % uncertain (friction, patch_radius), 10 ms (delay)
    and 10 % (the grip force's scale).
    """
    section = scene.uncertainty or Uncertainty(delay=Distribution(uniform=0.01))
    mean, deviations = [], []
    for name in names:
        spread = None if name == "grip_scale" else getattr(section, name)
        if spread is None:
            value = {"delay": 0.0, "grip_scale": 1.0}.get(name) or scene.values.get(name, 0.0)
            deviation = ASSUMED[name]
        else:
            about = spread.about(scene.values[name])
            value, deviation = about.expected, about.deviation
            if name != "delay" and about.samples:
                logs = np.log(about.samples)
                value, deviation = math.exp(logs.mean()), float(logs.std())
            elif name != "delay":
                deviation /= value
            elif scene.uncertainty is None:
                deviation = ASSUMED[name]
        mean.append(value if name == "delay" else math.log(value))
        deviations.append(max(deviation, 1e-6))
    matrix = np.eye(len(names))
    for one, other, number in section.correlation:
        if one in names and other in names:
            i, j = names.index(one), names.index(other)
            matrix[i, j] = matrix[j, i] = number
    scale = np.array(deviations)
    return Belief(names, np.array(mean), matrix * np.outer(scale, scale))


def applied(belief: Belief, scene: Scene) -> Scene:
    """The scene with the belief as its [contact] and in its [uncertainty].

    A wrong scale of the grip force acts as another friction and is put there. What else
    the scene leaves uncertain stays.
    """
    known = belief.effective
    contact = dataclasses.replace(
        scene.contact,
        friction=known.value("friction"),
        patch_radius=known.value("patch_radius"),
    )
    old = scene.uncertainty
    spreads = {} if old is None else {name: getattr(old, name) for name in old.names}
    pairs = [] if old is None else [p for p in old.correlation if not {*p[:2]} & {*known.names}]
    own = uncertainty_of(belief)
    spreads |= {name: getattr(own, name) for name in own.names}
    section = Uncertainty(**spreads, correlation=(*pairs, *own.correlation))
    return scene.replace(contact=contact, uncertainty=section)


def uncertainty_of(belief: Belief) -> Uncertainty:
    """The belief as a section [uncertainty]; its means are the scene's values to be.

    Normal distributions, or where friction and radius are known much worse than their
    product samples of the log-normal ones, so that the product keeps its own doubt.
    """
    known = belief.effective
    both = known.deviation("friction") * known.deviation("patch_radius")
    wide = both > NARROW * known.product_deviation
    spreads: dict[str, Distribution] = {}
    for name in known.names:
        value, deviation = known.value(name), max(known.deviation(name), 1e-6)
        if name == "delay":
            spreads[name] = Distribution(normal=deviation, mean=value)
        elif wide:
            spreads[name] = Distribution(samples=_log_normal(value, deviation))
        else:
            spreads[name] = Distribution(normal=value * deviation)
    pairs: list[Pair] = []
    for i, one in enumerate(known.names):
        for other in known.names[i + 1 :]:
            number = float(np.clip(known.correlation(one, other), -STRONGEST, STRONGEST))
            if abs(number) > 0.01:
                pairs.append((one, other, round(number, 4)))
    return Uncertainty(**spreads, correlation=_possible(known, pairs))


def _possible(
    known: Belief, pairs: list[tuple[str, str, float]]
) -> tuple[tuple[str, str, float], ...]:
    """Correlations that together are those of some distribution, a little weaker if need be."""
    shrink = 1.0
    while True:
        matrix = np.eye(len(known.names))
        weaker = [(one, other, round(shrink * value, 4)) for one, other, value in pairs]
        for one, other, value in weaker:
            i, j = known.index(one), known.index(other)
            matrix[i, j] = matrix[j, i] = value
        if np.linalg.eigvalsh(matrix).min() > 1e-6:
            return tuple(weaker)
        shrink *= 0.999


def _log_normal(value: float, deviation: float) -> tuple[float, ...]:
    """Values of equal weight of a log-normal distribution, within the range of a scene's."""
    from scipy.special import ndtri

    scores = ndtri((np.arange(SAMPLES) + 0.5) / SAMPLES)
    shares = np.clip(np.exp(deviation * scores), 0.02, 50.0)
    return tuple(float(f"{value * share:.6g}") for share in shares)


def contact_text(belief: Belief, torsion: float, faces: int) -> str:
    """The sections [contact] and [uncertainty] for a scene file."""
    known = belief.effective
    lines = [
        "# In place of the [contact] and [uncertainty] of a scene. The doubt is that of the mean",
        "# by this model: not the scatter from throw to throw, nor the model's own error.",
        "[contact]",
        f"friction = {known.value('friction'):.6g}",
        f"patch_radius = {known.value('patch_radius'):.6g} # m",
        f"torsion = {torsion:g}",
        f"faces = {faces}",
        "",
        "[uncertainty]",
    ]
    table = uncertainty_table(uncertainty_of(belief))
    for key, value in table.items():
        if isinstance(value, dict):
            words = ", ".join(f"{name} = {_plain(number)}" for name, number in value.items())
            lines.append(f"{key} = {{ {words} }}")
        else:
            lines.append(f"{key} = {json.dumps(value)}")
    return "\n".join(lines) + "\n"


def _plain(value: object) -> str:
    """A number or a list of them as TOML has it."""
    if isinstance(value, list):
        words = ", ".join(_plain(number) for number in value)
        if len(words) < 80:
            return f"[{words}]"
        inside = textwrap.fill(words, 98, initial_indent="  ", subsequent_indent="  ")
        return f"[\n{inside},\n]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
