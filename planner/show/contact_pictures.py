"""What the pads can hold: limit surface (Fig. 5), its shapes in space (Fig. 8), beam (Fig. 9)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import (
    KarnoppRelease,
    OverhangingBeam,
    SteppedRelease,
    contact_twist,
    ellipsoid,
    held_wrench,
    slip_onset,
    surface_gauge,
)
from .style import BLACK, BLUE, GREEN, PHASES, RED, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ...models import Contact, LimitSurface, Release, ReleaseCase

Array = npt.NDArray[np.float64]

#: Isolines, as shares of the grip force at which sliding begins; the load is cut off on CUT.
ISOLINES, CUT = (1.5, 1.25, 1.0, 0.75, 0.5, 0.25), 0.75
#: Height over width of the picture's frame.
FLAT = 0.66
#: Explicit steps of sliding whose wrenches are drawn as crosses.
STEPS_DRAWN = 60


def slide_onset(case: ReleaseCase, surface: LimitSurface) -> float | None:
    """Time [s] at which the limit surface no longer holds the body; None if it always does."""
    pivot, slide = slip_onset(case, surface_gauge(surface))
    return slide if pivot is None else pivot


def first_slip(case: ReleaseCase, run: Release, dead_zone: float) -> int | None:
    """Index of the first instant at which the contact slips by more than `dead_zone`."""
    hand = case.hand.at(run.times)
    lever = run.com[:2] - hand.pose[:2]
    slip = np.array(contact_twist(*run.com_twist, *lever)) - hand.twist
    moving = np.flatnonzero(np.linalg.norm(slip, axis=0) > dead_zone)
    return int(moving[0]) if moving.size else None


def draw_limit_surface(name: str, case: ReleaseCase, path: Path) -> None:
    """Isolines of the falling grip, the load, what is left of it, and friction of two models.

    The plane is that of the load's force (f_z for a hand at rest) and torque. Wrenches
    are those on the pads, as the signs of (20): load f_ext, friction -f_s.
    """
    surface = ellipsoid(case.contact)
    start = slide_onset(case, surface)
    moment = start or 0.0
    load = -held_wrench(case, np.array([moment]))[0][:, 0]
    along, arm = _force_axis(load), 1e3 * float(case.contact.torsion_arm)

    def in_plane(wrench: Array) -> tuple[Array, Array]:
        """Force along the axis [N] and torque [N mm] of wrenches (3, ...)."""
        return along[0] * wrench[0] + along[1] * wrench[1], 1e3 * wrench[2]

    grip = float(case.grip.force(moment))
    figure = new_figure(9.1, 6.9)
    axes = figure.subplots()
    shares = [share for share in ISOLINES if share * grip <= case.grip.full * (1 + 1e-9)]
    for share in shares:
        wrenches = _at_limit(surface, along, arm, case.contact.faces * share * grip)
        _isoline(axes, *in_plane(wrenches), share, share * grip)
    force, torque = in_plane(load)
    reach = shares[0] * grip * float(case.contact.force_limit(1.0))
    reach = 1.12 * max(reach, abs(float(force)), abs(float(torque)) / arm)
    axes.set(xlim=(-reach, reach), ylim=(-reach * arm, reach * arm))
    axes.set_box_aspect(FLAT)

    explicit, stepped = KarnoppRelease(), SteppedRelease().release(case)
    run = explicit.release(case)
    first = first_slip(case, run, explicit.dead_zone)
    if run.wrench is not None and first is not None:
        crosses = in_plane(-run.wrench[:, first + 1 : first + 1 + STEPS_DRAWN])
        words = f"−f_s of the first {STEPS_DRAWN} explicit steps that slide"
        axes.plot(*crosses, "x", color=RED, ms=5, alpha=0.7, label=words)
    assert stepped.wrench is not None
    track = in_plane(-stepped.wrench[:, stepped.times >= moment])
    axes.plot(*track, color=GREEN, lw=6, alpha=0.5, label="−f_s by time stepping, from then on")
    if surface.gauge(load) > 0:
        cut = load * (CUT * grip * case.contact.faces / surface.gauge(load))
        words = f"−f_s1: what f_N = {CUT * grip:.3g} N holds of it"
        _arrow(axes, in_plane(load), BLACK, "f_ext", "f_ext: load as the grip ceases to hold it")
        _arrow(axes, in_plane(cut), BLUE, "−f_s1", words)
    axes.axhline(0.0, color="#bbbbbb", lw=0.8, zorder=0)
    axes.axvline(0.0, color="#bbbbbb", lw=0.8, zorder=0)
    angle = np.degrees(np.arctan2(*along[::-1]))
    where = "f_z" if abs(along[1]) > 0.999 else f"force along {angle:.0f}°"
    axes.set(xlabel=f"{where} on the pads [N]", ylabel="torque on the pads [N mm]")
    begins = "holds" if start is None else f"sliding begins at {1e3 * start:.1f} ms"
    title = f"{name}: limit surface while the grip force of a pad falls ({begins})"
    axes.set_title(title, loc="left", fontsize=11)
    figure.legend(loc="outside lower center", ncols=2, fontsize=9)
    save(figure, path)


def _force_axis(load: Array) -> Array:
    """Unit vector (2,) along the load's force, pointing up; z for a load without a force."""
    size = float(np.hypot(load[0], load[1]))
    if size < 1e-9:
        return np.array([0.0, 1.0])
    along = load[:2] / size
    return np.asarray(along if (along[1], along[0]) > (0.0, 0.0) else -along)


def _at_limit(surface: LimitSurface, along: Array, arm: float, normal: float) -> Array:
    """Wrenches (3, K) at the limit under a normal force [N], around the plane; arm in mm."""
    angle = np.linspace(0.0, 2 * np.pi, 181)
    ways = np.array([*(along[:, None] * np.cos(angle)), 1e-3 * arm * np.sin(angle)])
    return np.asarray(ways * normal / np.array([surface.gauge(way) for way in ways.T]))


def _isoline(axes: Axes, force: Array, torque: Array, share: float, grip: float) -> None:
    from matplotlib import colormaps

    shade = colormaps["viridis"](0.85 - 0.85 * share / max(ISOLINES))
    axes.plot(force, torque, color=shade, lw=2.6 if share == 1.0 else 1.4)
    words = f"f_N = {grip:.3g} N" + (", onset" if share == 1.0 else "")
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    place: dict[str, Any] = {"ha": "center", "va": "center", "bbox": box}
    axes.text(force[22], torque[22], words, color=shade, fontsize=9, **place)


def _arrow(axes: Axes, tip: tuple[Array, Array], colour: str, name: str, label: str) -> None:
    """An arrow from the origin, its name at the tip, and an entry in the legend."""
    point = (float(tip[0]), float(tip[1]))
    style = {"arrowstyle": "-|>", "color": colour, "lw": 2.2, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", point, (0, 0), arrowprops=style, zorder=5)
    axes.plot(*point, "o", color=colour, ms=6, label=label, zorder=6)
    axes.annotate(name, point, (8, -6), textcoords="offset points", color=colour, va="top")


def draw_surface(axes: Any, contact: Contact, surface: LimitSurface) -> None:
    """A limit surface per newton in 3-D: f_x, f_z [N/N], torque [mm]; ring: the ellipsoid."""
    mu, arm = float(contact.friction), float(contact.torsion_arm)

    def points(shape: LimitSurface, angle: Array, height: Array) -> Array:
        ring = np.cos(height)
        ways = np.array([ring * np.cos(angle), ring * np.sin(angle), arm * np.sin(height)])
        gauges = np.array([shape.gauge(way) for way in ways.reshape(3, -1).T])
        scaled = ways.reshape(3, -1) / gauges * np.array([[1.0], [1.0], [1e3]])
        return np.asarray(scaled.reshape(ways.shape))

    around = np.linspace(0, 2 * np.pi, 41), np.linspace(-np.pi / 2, np.pi / 2, 25)
    sphere = points(surface, *np.meshgrid(*around))
    axes.plot_surface(*sphere, cmap="viridis", alpha=0.8, lw=0, rstride=1, cstride=1)
    height = np.linspace(0, 2 * np.pi, 121)
    ring = points(ellipsoid(contact), np.full_like(height, np.pi / 2), height)
    axes.plot(*ring, color=BLACK, ls="--", lw=1.4, zorder=10)
    ticks = np.array([-1.0, 0.0, 1.0])
    axes.set(xticks=ticks * mu, yticks=ticks * mu, zticks=ticks * mu * arm * 1e3)
    axes.set(xlabel="f_x", ylabel="f_z")
    axes.xaxis.labelpad = axes.yaxis.labelpad = -4
    axes.tick_params(labelsize=8, pad=0)
    axes.view_init(elev=15, azim=-20)
    axes.set_box_aspect((1, 1, 0.8), zoom=1.2)


def draw_overhang(name: str, case: ReleaseCase, path: Path) -> None:
    """Two contact points under a falling grip: their forces, and when the hinge forms.

    The scene's bar, level and with its hand at rest; the points are at +-c r_p, where
    they hold the same torque as the patch.
    """
    arm = float(case.contact.torsion_arm)
    beam = OverhangingBeam(case.body, case.contact, arm, case.gravity)
    figure = new_figure(9.1, 6.9)
    sketch, axes = figure.subplots(2, 1, height_ratios=(1, 3.2))
    _sketch(sketch, beam)
    hinge, slide = _beam_forces(axes, case, beam)
    if hinge is None:
        life = "never forms: the points hold until the grip is gone"
    elif slide is not None and slide > 0.99 * hinge:
        life = f"does not form: both points slide from f_N = {slide:.3g} N on"
    else:
        life = f"from f_N = {hinge:.3g} N" + ("" if slide is None else f" down to {slide:.3g} N")
    h, r = 1e3 * float(case.body.com_offset), 1e3 * beam.half_span
    title = f"{name}: bar held level by two points at ±{r:.3g} mm, CoM at {h:.3g} mm, hand at rest"
    figure.suptitle(f"{title}\nhinge at C1 {life}", fontsize=11)
    figure.legend(loc="outside lower center", ncols=4, fontsize=9)
    save(figure, path)


def _beam_forces(
    axes: Axes, case: ReleaseCase, beam: OverhangingBeam
) -> tuple[float | None, float | None]:
    """Forces at C1 and C2 over the falling grip; f_N [N] where the hinge begins and ends."""
    times = np.linspace(0.0, case.grip.opening, 4001)
    grip = np.asarray(case.grip.force(times), float)
    limit, (still_1, still_2) = beam.point_limit(grip), beam.sticking_forces()
    hinged = limit < still_2[1]
    alpha = np.where(hinged, beam.pivot_acceleration(grip), 0.0)
    omega = np.cumsum(alpha * np.diff(times, prepend=0.0))
    turning = beam.hinge_force(grip, omega)
    f_1 = np.where(hinged, turning[1], still_1[1])
    f_1x = np.where(hinged, turning[0], 0.0)
    f_2 = np.where(hinged, limit, still_2[1])
    sliding = np.cumsum(hinged & (np.hypot(f_1, f_1x) > limit)) > 0
    starts = [float(grip[np.argmax(flag)]) if flag.any() else 0.0 for flag in (hinged, sliding)]
    hinge, slide = (start if start > 0 else None for start in starts)
    edges = [case.grip.full, *(edge for edge in (hinge, slide) if edge is not None), 0.0]
    modes = ("stick", "pivot", "slide")
    for mode, left, right in zip(modes, edges[:-1], edges[1:], strict=False):
        axes.axvspan(left, right, color=PHASES[mode], alpha=0.16, lw=0, label=mode)
    axes.plot(grip, limit, "--", color=BLACK, lw=1.2, label="±f_max of a point")
    axes.plot(grip, -limit, "--", color=BLACK, lw=1.2)
    curves = (("f_2z", f_2, RED, "-"), ("f_1z", f_1, BLUE, "-"), ("f_1x", f_1x, BLUE, ":"))
    for label, force, colour, style in curves:
        axes.plot(grip[~sliding], force[~sliding], style, color=colour, lw=2, label=label)
    for edge in edges[1:-1]:
        axes.axvline(edge, color=BLACK, lw=1.0, ls=":")
    widest = case.grip.full if hinge is None else min(case.grip.full, 1.7 * hinge)
    tallest = 1.5 * max(float(still_2[1]), 0.05 * float(beam.point_limit(widest)))
    axes.set(xlim=(widest, 0.0), ylim=(-tallest, tallest))
    axes.set(xlabel="grip force f_N of a pad [N], falling", ylabel="force on the bar [N]")
    axes.grid(alpha=0.25)
    return hinge, slide


def _sketch(axes: Axes, beam: OverhangingBeam) -> None:
    """The bar, its points and the forces on it while it sticks; distances not to scale."""
    f_1, f_2 = (float(force[1]) for force in beam.sticking_forces())
    weight = float(beam.body.mass) * beam.gravity
    span = max(abs(f_1), abs(f_2), weight, 1e-12)
    centre = 5.0 if beam.body.com_offset > beam.half_span else 0.4
    axes.fill_between([-1.6, 5.6], -0.16, 0.16, color="#cfd4da", lw=0)
    forces = ((-1.0, "C1", f_1, BLUE), (1.0, "C2", f_2, RED), (centre, "CoM", -weight, BLACK))
    for x, name, force, colour in forces:
        tip = np.sign(force) * (0.5 + 0.9 * abs(force) / span)
        style = {"arrowstyle": "-|>", "color": colour, "lw": 2.2, "shrinkA": 4, "shrinkB": 0}
        axes.plot([x], [0], "o", color=colour, ms=7)
        axes.annotate("", (x, tip), (x, 0), arrowprops=style)
        axes.text(x + 0.1, tip, f"{name}: {force + 0.0:.3g} N", color=colour, va="center")
    axes.set(xlim=(-2.2, 7.0), ylim=(-1.7, 1.7))
    axes.set_title("forces while it sticks (not to scale)", loc="left", fontsize=9)
    axes.axis("off")
