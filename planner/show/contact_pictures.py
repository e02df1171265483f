"""Pictures of what a pad's patch can hold: its limit surface, flat (Fig. 5) and in space."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import (
    Contact,
    KarnoppRelease,
    LimitSurface,
    Release,
    ReleaseCase,
    SteppedRelease,
    contact_twist,
    ellipsoid,
    onset,
    pivot_wrench,
)
from ...problems import Scene
from ..check import case_of, given_hand

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

#: Areas of stick, pivot and slide.
AREAS = {"stick": "#8a8f98", "pivot": "#f2a33a", "slide": "#d1495b"}
BLUE, GREEN, RED, PURPLE, BLACK = "#4c78a8", "#2a9d6f", "#d1495b", "#7b4fa3", "#222222"
#: Isolines, as shares of the grip force at which sliding begins; the pairs are drawn on CUT.
ISOLINES, CUT = (1.5, 1.25, 1.0, 0.75, 0.5, 0.25), 0.75
#: Height over width of the picture's frame.
FLAT = 0.66
#: Explicit steps of sliding whose wrenches are drawn as dots.
DOTS = 60


def given_case(scene: Scene) -> ReleaseCase:
    """The scene's release along its [motion]; InputError if it has none."""
    return case_of(scene, given_hand(scene))


def held_wrench(case: ReleaseCase, times: Array) -> Array:
    """Friction wrench (3, K) that keeps the body fixed in the hand: f_x, f_z, torque."""
    hand, h = case.hand.at(times), case.body.com_offset
    angle = hand.pose[2] + case.grasp_angle
    lever = h * np.cos(angle), h * np.sin(angle)
    wrench = pivot_wrench(case.body, case.gravity, hand.motion, hand.twist[2], *lever)
    return np.array(np.broadcast_arrays(*wrench))


def slide_onset(case: ReleaseCase, surface: LimitSurface) -> float | None:
    """Time [s] at which the limit surface no longer holds the body; None if it always does."""
    times = np.linspace(0.0, case.grip.opening, 2001)[:-1]
    needed = np.array([surface.gauge(wrench) for wrench in held_wrench(case, times).T])
    return onset(times, needed - case.contact.faces * case.grip.force(times))


def first_slip(case: ReleaseCase, run: Release, dead_zone: float) -> int | None:
    """Index of the first instant at which the contact slips by more than `dead_zone`."""
    hand = case.hand.at(run.times)
    lever = run.com[:2] - hand.pose[:2]
    slip = np.array(contact_twist(*run.com_twist, *lever)) - hand.twist
    moving = np.flatnonzero(np.linalg.norm(slip, axis=0) > dead_zone)
    return int(moving[0]) if moving.size else None


def save(figure: Figure, path: Path) -> None:
    """Write the figure."""
    figure.savefig(path, dpi=100)


# The limit surface.


def draw_limit_surface(scene: Scene, path: Path) -> None:
    """Shrinking isolines, the load, its Karnopp cut-off, and the wrench of the first slip.

    The plane is that of the load's force (f_z for a hand at rest) and torque. Wrenches
    are those on the pads, as the signs of (20): load f_ext, friction -f_s.
    """
    from matplotlib.figure import Figure

    case, surface = given_case(scene), ellipsoid(scene.patch)
    start = slide_onset(case, surface)
    moment = 0.0 if start is None else start
    load = -held_wrench(case, np.array([moment]))[:, 0]
    along = _force_axis(load)
    grip = float(case.grip.force(moment))
    shares = [share for share in ISOLINES if share * grip <= case.grip.full * (1 + 1e-9)]
    figure = Figure(figsize=(10, 7.6), layout="constrained")
    axis = figure.subplots()
    for share in shares:
        _isoline(axis, case, surface, along, grip, share)
    reach = shares[0] * grip * float(case.contact.force_limit(1.0))
    force, torque = _in_plane(load, along)
    reach = 1.12 * max(reach, abs(float(force)), abs(float(torque)) / _arm_mm(case))
    axis.set(xlim=(-reach, reach), ylim=(-reach * _arm_mm(case), reach * _arm_mm(case)))
    axis.set_box_aspect(FLAT)
    _tracks(axis, case, along, moment)
    if surface.gauge(load) > 0:
        words = "load f_ext as the grip ceases to hold it"
        _arrow(axis, _in_plane(load, along), BLACK, "f_ext", words)
        cut = load * (CUT * grip * case.contact.faces / surface.gauge(load))
        words = f"at the onset: −f_s1, the load cut off to what f_N = {CUT * grip:.3g} N holds"
        _arrow(axis, _in_plane(cut, along), BLUE, "−f_s1", words)
        _sliding_pair(axis, case, surface, load, CUT * grip)
    axis.axhline(0.0, color="#bbbbbb", lw=0.8, zorder=0)
    axis.axvline(0.0, color="#bbbbbb", lw=0.8, zorder=0)
    upright = abs(along[1]) > 0.999
    where = "f_z" if upright else f"force along {np.degrees(np.arctan2(*along[::-1])):.0f}°"
    axis.set(xlabel=f"{where} on the pads [N]", ylabel="torque on the pads [N mm]")
    axis.set_title(
        f"{scene.name}: limit surface while the grip force of a pad falls"
        + (f" (sliding begins at {1e3 * moment:.1f} ms)" if start is not None else " (holds)"),
        loc="left",
        fontsize=11,
    )
    figure.legend(loc="outside lower center", ncols=2, fontsize=9)
    save(figure, path)


def _force_axis(load: Array) -> Array:
    """Unit vector (2,) along the load's force, pointing up; z for a load without a force."""
    size = float(np.hypot(load[0], load[1]))
    if size < 1e-9:
        return np.array([0.0, 1.0])
    along = load[:2] / size
    return np.asarray(along if (along[1], along[0]) > (0.0, 0.0) else -along)


def _arm_mm(case: ReleaseCase) -> float:
    return 1e3 * float(case.contact.torsion_arm)


def _in_plane(wrench: Array, along: Array) -> tuple[Array, Array]:
    """Force along the axis [N] and torque [N mm] of wrenches (3, ...)."""
    return along[0] * wrench[0] + along[1] * wrench[1], 1e3 * wrench[2]


def _isoline(
    axis: Axes, case: ReleaseCase, surface: LimitSurface, along: Array, grip: float, share: float
) -> None:
    """All wrenches in the plane that are at the limit under `share` of `grip` per pad."""
    from matplotlib import colormaps

    angle = np.linspace(0.0, 2 * np.pi, 181)
    arm = float(case.contact.torsion_arm)
    ways = np.array([*(along[:, None] * np.cos(angle)), arm * np.sin(angle)])
    size = case.contact.faces * share * grip / np.array([surface.gauge(way) for way in ways.T])
    force, torque = _in_plane(ways * size, along)
    shade = colormaps["viridis"](0.85 - 0.85 * share / max(ISOLINES))
    axis.plot(force, torque, color=shade, lw=2.6 if share == 1.0 else 1.4)
    words = f"f_N = {share * grip:.3g} N" + (", onset" if share == 1.0 else "")
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    axis.text(
        *(force[22], torque[22]), words, color=shade, fontsize=9, ha="center", va="center", bbox=box
    )


def _tracks(axis: Axes, case: ReleaseCase, along: Array, moment: float) -> None:
    """-f_s of explicit Euler for its first steps of sliding, and of the stepping."""
    model, stepped = KarnoppRelease(), SteppedRelease().release(case)
    explicit = model.release(case)
    first = first_slip(case, explicit, model.dead_zone)
    if explicit.wrench is not None and first is not None:
        force, torque = _in_plane(-explicit.wrench[:, first + 1 : first + 1 + DOTS], along)
        label = f"−f_s of the first {DOTS} explicit steps that slide"
        axis.plot(force, torque, "x", color=RED, ms=5, mew=1, alpha=0.7, label=label)
    assert stepped.wrench is not None
    force, torque = _in_plane(-stepped.wrench[:, stepped.times >= moment], along)
    label = "−f_s by time stepping, from the onset on"
    axis.plot(force, torque, color=GREEN, lw=6, alpha=0.5, label=label)


def _arrow(axis: Axes, tip: tuple[Array, Array], colour: str, name: str, label: str) -> None:
    """An arrow from the origin, with its name beside and an entry in the legend."""
    style = {"arrowstyle": "-|>", "color": colour, "lw": 2.2, "shrinkA": 0, "shrinkB": 0}
    point = (float(tip[0]), float(tip[1]))
    axis.annotate("", point, (0, 0), arrowprops=style, zorder=5)
    axis.plot(*point, "o", color=colour, ms=6, label=label, zorder=6)
    away: dict[str, Any] = {
        "textcoords": "offset points",
        "color": colour,
        "fontsize": 11,
        "va": "top",
    }
    axis.annotate(name, point, (8, -6), **away)


def _sliding_pair(
    axis: Axes, case: ReleaseCase, surface: LimitSurface, load: Array, grip: float
) -> None:
    """(v, -f_s2): the slip that follows the cut-off, and the friction that it has at once.

    The cut-off leaves a share of the load, which moves the contact along G M^-1 G^T f_ext.
    """
    along = _force_axis(load)
    hand, h = case.hand.at(np.zeros(1)), case.body.com_offset
    angle = float(hand.pose[2, 0]) + case.grasp_angle
    g = np.array([[1, 0, h * np.sin(angle)], [0, 1, -h * np.cos(angle)], [0, 0, 1]])
    mass = np.array([case.body.mass, case.body.mass, case.body.inertia], float)
    v_x, v_z, omega = (g / mass) @ g.T @ load
    speed = float(along @ (v_x, v_z))
    wrench = -surface.sliding_wrench(np.array([*(speed * along), omega]))
    tip = _in_plane(wrench * case.contact.faces * grip, along)
    words = "one step later: −f_s2, where the surface's normal is along the first slip v"
    _arrow(axis, tip, PURPLE, "−f_s2", words)
    # v along the normal of the isoline, as it appears in the picture.
    way = np.array([speed, omega * float(case.contact.torsion_arm) / FLAT**2])
    way = 0.1 * axis.get_xlim()[1] * way / np.linalg.norm(way)
    end = (float(tip[0]) + way[0], float(tip[1]) + way[1] * _arm_mm(case))
    style = {"arrowstyle": "-|>", "color": PURPLE, "lw": 1.4, "ls": "--", "shrinkA": 0}
    axis.annotate("", end, (float(tip[0]), float(tip[1])), arrowprops=style, zorder=5)
    axis.annotate("v", end, (0, 8), textcoords="offset points", color=PURPLE, fontsize=12)


# The surface in space.


def draw_surface(axis: Any, contact: Contact, surface: LimitSurface, name: str) -> None:
    """A limit surface per newton in 3-D: f_x, f_z [N/N], torque [mm]; ring: the ellipsoid."""
    mu, arm = float(contact.friction), float(contact.torsion_arm)

    def points(shape: LimitSurface, angle: Array, height: Array) -> Array:
        ring = np.cos(height)
        ways = np.array([ring * np.cos(angle), ring * np.sin(angle), arm * np.sin(height)])
        flat = ways.reshape(3, -1)
        on = flat / np.array([shape.gauge(way) for way in flat.T])
        return np.asarray(on.reshape(ways.shape) * np.array([1, 1, 1e3])[:, None, None])

    angle, height = np.meshgrid(
        np.linspace(0, 2 * np.pi, 41), np.linspace(-np.pi / 2, np.pi / 2, 25)
    )
    axis.plot_surface(
        *points(surface, angle, height), cmap="viridis", alpha=0.8, lw=0, rstride=1, cstride=1
    )
    around = np.linspace(0, 2 * np.pi, 121)[None, :]
    ring = points(ellipsoid(contact), np.full_like(around, np.pi / 2), around)[:, 0]
    axis.plot(*ring, color=BLACK, ls="--", lw=1.4, zorder=10)
    most = mu * arm * 1e3
    ticks = np.array([-1.0, 0.0, 1.0])
    axis.set(xticks=ticks * mu, yticks=ticks * mu, zticks=ticks * most)
    axis.set(xlabel="f_x", ylabel="f_z")
    axis.xaxis.labelpad = axis.yaxis.labelpad = -4
    axis.tick_params(labelsize=8, pad=0)
    axis.view_init(elev=15, azim=-20)
    axis.set_box_aspect((1, 1, 0.8), zoom=1.2)
    axis.set_title(name, fontsize=10, y=0.98)
