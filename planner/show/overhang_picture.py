"""The picture of the overhanging beam (Fig. 9): why a release pivots."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...models import OverhangingBeam, ReleaseCase
from ...problems import Scene
from .contact_pictures import AREAS, BLACK, BLUE, RED, given_case, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_overhang(scene: Scene, path: Path) -> None:
    """Two contact points under a falling grip: who carries what, and when the hinge forms.

    The scene's bar, level and with its hand at rest; the points are at +-c r_p, where
    they hold the same torque as the patch.
    """
    from matplotlib.figure import Figure

    case = given_case(scene)
    beam = OverhangingBeam(case.body, case.contact, scene.patch.torsion_arm, case.gravity)
    figure = Figure(figsize=(10, 7.6), layout="constrained")
    sketch, axis = figure.subplots(2, 1, height_ratios=(1, 3.2))
    _sketch(sketch, beam)
    hinge, slide = _beam_forces(axis, case, beam)
    h, r = 1e3 * float(case.body.com_offset), 1e3 * beam.half_span
    figure.suptitle(
        f"{scene.name}: bar held level by two points at ±{r:.3g} mm, CoM at {h:.3g} mm, "
        f"hand at rest\nhinge at C1 {_span(hinge, slide)}",
        fontsize=11,
    )
    figure.legend(loc="outside lower center", ncols=4, fontsize=9)
    save(figure, path)


def _span(hinge: float | None, slide: float | None) -> str:
    """The hinge's life in words, in f_N of one pad [N]."""
    if hinge is None:
        return "never forms: the points hold until the grip is gone"
    if slide is not None and slide > 0.99 * hinge:
        return f"does not form: both points slide from f_N = {slide:.3g} N on"
    return f"from f_N = {hinge:.3g} N" + ("" if slide is None else f" down to {slide:.3g} N")


def _beam_forces(
    axis: Axes, case: ReleaseCase, beam: OverhangingBeam
) -> tuple[float | None, float | None]:
    """Forces at C1 and C2 over the falling grip; f_N [N] where the hinge begins and ends."""
    times = np.linspace(0.0, case.grip.opening, 4001)
    grip = np.asarray(case.grip.force(times), float)
    limit, (still_1, still_2) = beam.point_limit(grip), beam.sticking_forces()
    hinged = limit < still_2[1]
    # The rate that the hinged bar has gathered by then.
    alpha = np.where(hinged, beam.pivot_acceleration(grip), 0.0)
    dt = np.diff(times, prepend=0.0)
    omega = np.cumsum(alpha * dt)
    turning = beam.hinge_force(grip, omega)
    f_1 = np.where(hinged, turning[1], still_1[1])
    f_1x = np.where(hinged, turning[0], 0.0)
    lost = hinged & (np.hypot(f_1, f_1x) > limit)
    sliding = np.cumsum(lost) > 0
    starts = [float(grip[np.argmax(flag)]) if flag.any() else None for flag in (hinged, sliding)]
    hinge, slide = (start if start is None or start > 0 else None for start in starts)
    edges = [case.grip.full, *(edge for edge in (hinge, slide) if edge is not None), 0.0]
    for name, left, right in zip(AREAS, edges[:-1], edges[1:], strict=False):
        axis.axvspan(left, right, color=AREAS[name], alpha=0.16, lw=0, label=name)
    axis.plot(grip, limit, "--", color=BLACK, lw=1.2, label="±f_max of a point")
    axis.plot(grip, -limit, "--", color=BLACK, lw=1.2)
    f_2 = np.where(hinged, limit, still_2[1])
    inside = ~sliding
    axis.plot(grip[inside], f_2[inside], color=RED, lw=2.4, label="f_2z")
    axis.plot(grip[inside], f_1[inside], color=BLUE, lw=2.4, label="f_1z")
    axis.plot(grip[inside], f_1x[inside], ":", color=BLUE, lw=1.6, label="f_1x")
    for edge in edges[1:-1]:
        axis.axvline(edge, color=BLACK, lw=1.0, ls=":")
    widest = case.grip.full if hinge is None else min(case.grip.full, 1.7 * hinge)
    tallest = 1.5 * max(float(still_2[1]), 0.05 * float(beam.point_limit(widest)))
    axis.set(xlim=(widest, 0.0), ylim=(-tallest, tallest))
    axis.set(xlabel="grip force f_N of a pad [N], falling", ylabel="force on the bar [N]")
    axis.grid(alpha=0.25)
    return hinge, slide


def _sketch(axis: Axes, beam: OverhangingBeam) -> None:
    """The bar, its points and the forces on it while it sticks; distances not to scale."""
    f_1, f_2 = (float(force[1]) for force in beam.sticking_forces())
    weight = float(beam.body.mass) * beam.gravity
    span = max(abs(f_1), abs(f_2), weight, 1e-12)
    axis.fill_between([-1.6, 5.6], -0.16, 0.16, color="#cfd4da", lw=0)
    for x, name, force, colour in (
        (-1.0, "C1", f_1, BLUE),
        (1.0, "C2", f_2, RED),
        (5.0 if beam.body.com_offset > beam.half_span else 0.4, "CoM", -weight, BLACK),
    ):
        axis.plot([x], [0], "o", color=colour, ms=7)
        tip = np.sign(force) * (0.5 + 0.9 * abs(force) / span)
        style = {"arrowstyle": "-|>", "color": colour, "lw": 2.2, "shrinkA": 4, "shrinkB": 0}
        axis.annotate("", (x, tip), (x, 0), arrowprops=style)
        axis.text(
            x + 0.1, tip, f"{name}: {force + 0.0:.3g} N", color=colour, va="center", fontsize=9
        )
    axis.set(xlim=(-2.2, 7.0), ylim=(-1.7, 1.7))
    axis.set_title("forces while it sticks (not to scale)", loc="left", fontsize=9)
    axis.axis("off")
