"""A scene's [calibration] from measured throws: bias and region, their words, files and picture."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models import MODELS, Array, Flags
from ..pictures import BLUE, GREEN, GREY, RED, new_figure, own_style, save_figure
from ..planner import region_words
from ..problems import Calibration, InputError, Scene, as_scene, checked, filling, write_json
from ..workers import Progress
from .belief import applied, contact_text
from .identification import no_progress
from .residuals import Residuals, planned_residuals, recorded_residuals
from .throws import ThrowData, load_throws

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Files of a calibration's folder.
FILES = ("calibrate.json", "calibration.toml", "calibration.png")
#: Factors from metres and radians to millimetres and degrees.
UNITS = np.array([1e3, math.degrees(1.0)])
#: Candidates along each component, odd; the region's half widths are rounded up by one step.
SIDE = 61
#: Least variance [m², rad²]: that of equal residuals is 0.
TINY = 1e-24
#: Most residuals times candidates at once.
CHUNK = 4_000_000
#: Most enlargements and refinements of the grid of candidates.
ROUNDS = 40


@dataclass(frozen=True)
class Calibrated:
    """The calibration of a scene by measured throws.

    source: name of the data; residuals: measured less predicted landings; section: [calibration];
    scene: the one that was given, with the contact fitted to the throws if it was.
    """

    source: str
    residuals: Residuals
    section: Calibration
    scene: Scene

    def apply(self, scene: Scene | str | Path) -> Scene:
        """A scene with this [calibration], and the contact fitted to the throws if it was."""
        scene, fit = as_scene(scene), self.residuals.fit
        return (scene if fit is None else applied(fit, scene)).replace(calibration=self.section)

    @property
    def guaranteed(self) -> float | None:
        """Lowest probability that an exchangeable throw lands in the region; None where friction
        was fitted to the throws: theory has no bound then, the level is approximate."""
        known = self.section
        rank = Calibration.rank(known.throws, known.level)
        return None if known.fitted else rank / (known.throws + 1)

    def to_dict(self) -> dict[str, Any]:
        """As JSON: SI units, radians."""
        known = self.section
        return {
            "scene": self.scene.name,
            "data": self.source,
            "throws": known.throws,
            "level": known.level,
            "guaranteed": self.guaranteed,
            "fitted": known.fitted,
            "bias": {
                name: {"value": value, "low": low, "high": high}
                for name, value, (low, high) in (
                    ("x", known.x, known.x_interval),
                    ("theta", known.theta, known.theta_interval),
                )
            },
            "region": {"position": known.position, "angle": known.angle},
            "speed": list(known.speed),
            "rate": list(known.rate),
            "residuals": [
                {"throw": name, "x": dx, "theta": dtheta}
                for name, (dx, dtheta) in zip(
                    self.residuals.names, self.residuals.landing.tolist(), strict=True
                )
            ],
        }

    def summary(self) -> str:
        """Bias, region, guarantee and assumptions as lines for people."""
        known, degree = self.section, math.degrees(1.0)
        x, theta = (1e3 * v for v in known.x_interval), (degree * v for v in known.theta_interval)
        by = MODELS[known.model].title
        sure = "level approximate: friction was fitted to these throws, for each to the others"
        if self.guaranteed is not None:
            k, n = Calibration.rank(known.throws, known.level), known.throws
            sure = f"guaranteed for at least {100 * self.guaranteed:.1f} % ({k} of {n + 1})"
        low, high = known.speed
        least, most = (degree * rate for rate in known.rate)
        return "\n".join(
            [
                f"{self.scene.name}: {known.throws} throws of {self.source}, predicted by {by}",
                f"  bias x {1e3 * known.x:+.1f} mm ({' to '.join(f'{v:+.1f}' for v in x)}), theta "
                f"{degree * known.theta:+.2f} deg ({' to '.join(f'{v:+.2f}' for v in theta)}), "
                f"{100 * known.level:g} % intervals",
                f"  {region_words(known)} of an aim shifted by the bias; {sure}",
                "  assumes throws like these in any order (exchangeable): same object, gripper and "
                f"robot,\n    speed at detach {low:.2f} to {high:.2f} m/s, turning rate "
                f"{least:.0f} to {most:.0f} deg/s; a plan outside warns",
            ]
        )

    def text(self) -> str:
        """[calibration] for a scene file; with [contact] and [uncertainty] if they were fitted."""
        fit, known = self.residuals.fit, self.scene
        before = "" if fit is None else contact_text(fit, known.contact, known.uncertainty) + "\n"
        return f"{before}# From {self.source}.\n{self.section.text}\n"

    def save(self, folder: str | Path) -> None:
        """Write calibrate.json, calibration.toml and the picture."""
        with filling(Path(folder), FILES) as scratch:
            save_figure(_picture(self), scratch / "calibration.png")
            (scratch / "calibration.toml").write_text(self.text(), encoding="utf-8")
            write_json(scratch / "calibrate.json", self.to_dict())


def calibrate(
    data: ThrowData | str | Path,
    scene: Scene | str | Path,
    level: float = 0.9,
    *,
    fit: bool = False,
    about: Callable[[str], Progress] | None = None,
) -> Calibrated:
    """Bias and region of a scene's landings from measured throws.

    data: measured throws, their folder, or a CSV file with the columns plan (a plan.json or its
    folder), x [m] and theta [rad] of the landing in the throw's plane. level: share of new throws
    that land in the region, 0.5 to 0.999. fit: friction and patch radius are fitted to these throws
    too, for each residual to the others; needs recordings. about(words) gives the progress of a
    part. A throw with a recorded grip force is predicted by its own.

    Raises InputError for too few throws for the level, for throws of another object or median grip
    force than the scene's, for a throw that the model lands nowhere, and for wrong files.
    """
    scene, level = as_scene(scene), checked("level", level, float, Calibration.LEVEL)
    if scene.motion is not None:
        raise InputError(f"{scene.place}: has a [motion]: only plans of [hand] or [robot] aim")
    if isinstance(data, str | Path) and Path(data).is_dir():
        data = load_throws(data)
    if isinstance(data, ThrowData):
        source = data.name
        Calibration.check_level(len(data.throws), level)
        found = recorded_residuals(data, scene, fit, about or no_progress)
    elif fit:
        raise InputError(f"fit: {data} has no recordings: give a folder of measured throws")
    else:
        source, found = Path(data).name, planned_residuals(Path(data), scene)
        Calibration.check_level(len(found.names), level)
    if found.fit is not None:
        scene = applied(found.fit, scene)
    return Calibrated(source, found, _section(found, scene, level), scene)


def _section(found: Residuals, scene: Scene, level: float) -> Calibration:
    """The section [calibration] of residuals."""
    half = conformal_region(found.landing, level)
    mean, error = found.landing.mean(axis=0), _mean_error(found.landing, level)
    x, theta = np.column_stack([mean - error, mean + error]).tolist()
    speed, rate = np.column_stack([found.twist.min(axis=0), found.twist.max(axis=0)]).tolist()
    grip, contact = scene.gripper.profile(), scene.contact
    return Calibration(
        throws=len(found.names),
        level=level,
        x=float(mean[0]),
        theta=float(mean[1]),
        x_interval=tuple(x),
        theta_interval=tuple(theta),
        position=float(half[0]),
        angle=float(half[1]),
        speed=tuple(speed),
        rate=tuple(rate),
        mass=scene.object.mass,
        com=scene.object.com,
        force=grip.full,
        opening=grip.opening,
        friction=contact.friction,
        patch_radius=contact.patch_radius,
        model=scene.tolerance.model,
        torsion=contact.torsion,
        faces=contact.faces,
        fitted=found.fit is not None,
    )


def _mean_error(residuals: Array, level: float) -> Array:
    """Half widths (2,) of Student's interval of the mean of residuals (N, 2)."""
    from scipy.special import stdtrit

    count = len(residuals)
    quantile = float(stdtrit(count - 1, 0.5 + level / 2))
    return np.asarray(quantile * residuals.std(axis=0, ddof=1) / math.sqrt(count))


@own_style()
def _picture(found: Calibrated) -> Figure:
    """Residuals, their mean with its interval, and the region about it."""
    known = found.section
    points, (x, theta) = found.residuals.landing * UNITS, np.array(known.bias) * UNITS
    wide, high = np.array([known.position, known.angle]) * UNITS
    figure = new_figure(6.4, 5.6, f"{found.source}: {region_words(known)}")
    axis = figure.add_subplot()
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.axvline(0.0, color=GREY, lw=0.8)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * (wide, high)
    label = f"region: {100 * known.level:g} % of new throws"
    corners += x, theta
    axis.fill(*corners.T, color=GREEN, alpha=0.12, lw=0)
    axis.plot(*corners.T, color=GREEN, lw=1.6, label=label)
    axis.plot(*points.T, "o", color=BLUE, ms=5, mec="white", label="residual of a throw")
    intervals = np.array([known.x_interval, known.theta_interval]) * UNITS[:, None]
    errors = np.abs(intervals - np.array([[x], [theta]]))
    axis.errorbar(
        x, theta, errors[1][:, None], errors[0][:, None], color=RED, capsize=4, label="bias"
    )
    axis.set(xlabel="x measured − predicted [mm]", ylabel="θ measured − predicted [deg]")
    axis.grid(alpha=0.25)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def conformal_region(residuals: Array, level: float) -> Array:
    """Half widths (2,) of the smallest box about the mean that holds the full conformal region of
    the next residual: no distribution is assumed.

    residuals (N, 2), N at least what the level needs. A new residual less the mean of these is
    inside with a probability of `level` or more.

    The score of a residual among N + 1 is its distance from their mean, in standard deviations of
    each component, the larger component: a symmetric function of all N + 1. A candidate belongs to
    the region if its score among the N measured ones and itself is at most the k-th smallest of
    theirs. If all N + 1 are exchangeable this holds for the true one with a probability of
    k / (N + 1) or more, in finite samples and for any distribution, although the mean comes from
    the same throws (Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World, 2005).
    Split conformal prediction would need throws of their own for the mean; the jackknife+
    guarantees 1 - 2 alpha only (Barber, Candes, Ramdas and Tibshirani, 2021).
    """
    about = residuals - residuals.mean(axis=0)
    rank, ticks = Calibration.rank(len(about), level), np.linspace(-1.0, 1.0, SIDE)
    shares = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    # A component without scatter still has a width.
    reach = 3.0 * np.abs(about).max(axis=0) + 1e-9
    for _ in range(ROUNDS):
        held = np.abs(shares[_belongs(about, shares * reach, rank)] * reach).max(axis=0)
        held += 2.0 * reach / (SIDE - 1)
        if (held >= reach).any():
            reach = np.where(held >= reach, 2.0 * reach, reach)
        elif (held > 0.9 * reach).all():
            break
        else:
            reach = 1.05 * held
    return np.asarray(held)


def _belongs(about: Array, candidates: Array, rank: int) -> Flags:
    """Flags (M,) of the candidates (M, 2) whose score among N residuals (N, 2) about their mean and
    itself is at most the `rank`-th smallest of these."""
    count, flags = len(about), list[Flags]()
    for part in np.array_split(candidates, max(count * len(candidates) // CHUNK, 1)):
        mean = part / (count + 1)
        square = ((about**2).sum(axis=0) + part**2) / (count + 1) - mean**2
        spread = np.sqrt(np.maximum(square, TINY))
        own = (np.abs(part - mean) / spread).max(axis=1)
        others = (np.abs(about - mean[:, None]) / spread[:, None]).max(axis=2)
        flags.append((others < own[:, None]).sum(axis=1) < rank)
    return np.concatenate(flags)
