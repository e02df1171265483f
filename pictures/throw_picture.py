"""A throw in its plane: throw.png, and throw.gif, which moves."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..models import Array, Indices
from ..planner import Timeline, column_of, measures_of, palm_corners, timeline
from .drawings import bar_path, cup_profile, draw_bars, draw_cup
from .style import ARM, BLACK, GREEN, ORANGE, PHASES, RED, literal_texts, new_figure, own_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from PIL import Image

    from ..planner import Throw
    from ..problems import Object, Pose, Scene


Pixels = npt.NDArray[np.uint8]

#: Colour of obstacles.
OBSTACLE = "#d9b8a6"
#: Number of drawn poses of the held bar.
CARRIED = 6
#: Number of drawn poses of the flying bar.
FLYING = 7
#: Number of drawn poses of the bar after its landing.
LANDED = 6
#: Look of the line through an arm's joints.
ARM_LINE: dict[str, Any] = {"color": ARM, "lw": 5, "ms": 5, "solid_capstyle": "round"}
#: Playback speed of moving pictures over real time.
SLOW = 0.2


@own_style()
def draw_throw(
    throw: Throw, load: tuple[Array, Array] | None = None, short_of: Pose | None = None
) -> Figure:
    """The throw as one picture: the plane, the release seen from the hand, plots over time.

    load: times [s] and load of a robust plan's window, see
    `load_curve`. short_of: the target that the throw misses, of one that is the nearest found.
    """
    line, scene = timeline(throw), throw.scene
    dx, dtheta = throw.deciding.miss(throw.target)
    angle = "" if throw.target.theta is None else f", {np.degrees(abs(dtheta)):.3f} deg"
    title = f"{scene.name}: lands {1e3 * abs(dx):.3f} mm{angle} from the target\n"
    if short_of is not None:
        title = f"{scene.name}: the throw found that lands nearest to {short_of.words}\n"
    title += f"{_flight_words(throw)}{line.end and f'; {line.end}'}\n{_grip_words(throw)}"
    figure = new_figure(12.5, 7.8, title)
    halves = figure.add_gridspec(1, 2, width_ratios=(1.7, 1))
    grid = halves[1].subgridspec(4, 1, height_ratios=(1.4, 1, 1, 1))
    stage = figure.add_subplot(halves[0])
    draw_surroundings(stage, scene, throw.target)
    _draw_arms(stage, scene, line)
    _draw_bars(stage, scene.object, line)
    frame_stage(stage, scene, throw.target, line)
    _draw_release(figure.add_subplot(grid[0]), scene, line)
    plots = [figure.add_subplot(grid[i]) for i in (1, 2, 3)]
    for axes in plots[:2]:
        axes.sharex(plots[2])
        axes.tick_params(labelbottom=False)
    _draw_plots(plots, line)
    if load is not None:
        times, use = 1e3 * load[0], load[1]
        plots[-1].axvspan(times[0], times[-1], color=GREEN, alpha=0.12, lw=0)
        label = f"load while the pads may open,\nat most {100 * use.max():.1f} %"
        plots[-1].plot(times, use, color=GREEN, lw=2, label=label)
        plots[-1].legend(fontsize=8)
    lay_out(figure)
    name_obstacles(stage, scene, throw.target)
    return figure


def lay_out(figure: Figure) -> None:
    """Compute the layout once; then the limits of equal axes, which its passes widen.

    Their tick labels may be a digit longer then: there is room at the sides.
    """
    figure.set_layout_engine("constrained", rect=(0.008, 0.0, 0.984, 1.0))
    with literal_texts(figure):
        figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes in figure.axes:
        axes.autoscale_view()


def name_obstacles(stage: Axes, scene: Scene, target: Pose) -> None:
    """The obstacles' names where they are seen, once the limits of the axes are known."""
    (x_low, x_high), (z_low, z_high) = stage.get_xlim(), stage.get_ylim()
    ends, step = np.array([[x_low, z_low], [x_high, z_high]]), 0.03 * (z_high - z_low)
    taken = list[tuple[float, float]]()
    for obstacle, (outline, _) in zip(scene.obstacle, _outlines(scene, target), strict=True):
        low, high = np.clip([outline.min(axis=0), outline.max(axis=0)], *ends)
        if (high <= low).any():
            continue
        (x, z), (wide, tall) = (low + high) / 2, high - low
        look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 7}
        # One below the other, where they stand one behind the other.
        while any(abs(x - a) < 4 * step and abs(z - b) < step for a, b in taken):
            z -= step
        taken.append((x, z))
        words = textwrap.shorten(obstacle.name, 30, placeholder="...")
        stage.text(
            x, z, words, rotation=90 if tall > wide else 0, color="#7a5c4a", clip_on=True, **look
        )


def _flight_words(throw: Throw) -> str:
    """Speed and turning rate at detach, time and turns of the flight."""
    flight = throw.landing_time - throw.detach_time
    ends = throw.flight(np.array([0.0, flight]))[2]
    v_x, v_z, omega = throw.deciding.release.com_twist[:, -1]
    return (
        f"leaves the hand at {np.hypot(v_x, v_z):.2f} m/s, turning {omega:.1f} rad/s; "
        f"flies {1e3 * flight:.0f} ms, {abs(ends[1] - ends[0]) / (2 * np.pi):.2f} turns"
    )


def _grip_words(throw: Throw) -> str:
    """Largest use of the grip's friction, the rest, and the scene's reserve, as text."""
    measures, reserve = measures_of(throw), throw.scene.gripper.sticking_margin
    use, time = measures.value("grip")[0], measures.time("grip")[0]
    left = f"{100 * (1 - use):.0f} % are left, {100 * reserve:g} % are asked for"
    return (
        f"grip: at most {100 * use:.0f} % of its friction limit before the opening, at "
        f"{time:.2f} s; {left}"
    )


def hand_corners(scene: Scene, pose: Array) -> Array:
    """Corners (N, 2) of the palm, or of a small pad for a free hand."""
    if scene.arm is not None:
        return np.asarray(palm_corners(scene.arm.tool, pose[:, None])[:, 0].T)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    corners = 0.02 * np.array([[-1, -0.7], [1, -0.7], [1, 0.7], [-1, 0.7]])
    return np.asarray(pose[:2] + corners @ np.array([[cos, sin], [-sin, cos]]))


def draw_surroundings(stage: Axes, scene: Scene, target: Pose) -> None:
    """Target, cup, floor, base column, obstacles: where the plane cuts them, or beside it."""
    if scene.opening is not None:
        draw_cup(stage, scene.opening)
    if scene.bounds.floor is not None:
        stage.axhline(scene.bounds.floor, color="#b0a99f", lw=1, ls="--", zorder=1, label="floor")
    if (column := column_of(scene)) is not None:
        radius, height = column
        sides, ends = [-radius, radius, radius, -radius], [0.0, 0.0, height, height]
        stage.fill(sides, ends, color="#e4e1dc", zorder=0, label="base column")
    filled: dict[str, Any] = {"color": OBSTACLE, "alpha": 0.6, "label": "obstacle"}
    pale: dict[str, Any] = {"fill": False, "ec": OBSTACLE, "ls": "--"}
    pale["label"] = "obstacle beside the plane"
    for outline, is_cut in _outlines(scene, target):
        look = filled if is_cut else pale
        stage.fill(*outline.T, zorder=0, **look)
        look["label"] = None
    x, (half, turn) = target.plane_x, target.half_widths
    if target.theta is not None:
        ghost: dict[str, Any] = {"fill": False, "ls": "--", "color": "k", "zorder": 7}
        if turn:
            ghost["label"] = "target's extreme angles"
        for theta in sorted({target.theta - turn, target.theta + turn}):
            draw_bars(stage, scene.object, np.array([x, target.z, theta]), **ghost)
            ghost["label"] = None
    mark = "k|-" if half else "k+"
    stage.plot([x - half, x + half], [target.z] * 2, mark, ms=11, zorder=8, label="target")


def _outlines(scene: Scene, target: Pose) -> list[tuple[Array, bool]]:
    """Of each obstacle the outline (N, 2) [m] in the plane of a throw to the target, and whether
    the plane cuts it: its section, or what is seen of it from the plane's right."""
    plane = scene.aimed_at(target).aim.plane
    solids = [plane.seen(obstacle.solid) for obstacle in scene.obstacle]
    each = ((solid, solid.section()) for solid in solids)
    return [(solid.outline(), False) if cut is None else (cut, True) for solid, cut in each]


def frame_stage(stage: Axes, scene: Scene, target: Pose, line: Timeline) -> None:
    """Equal axes around the moving bodies and fixed ones up to 0.4 m away; the legend below."""
    low, high = line.extent(scene)
    outlines = [outline for outline, _ in _outlines(scene, target)]
    if scene.opening is not None:
        outlines.append(cup_profile(scene.opening))
    if (column := column_of(scene)) is not None:
        outlines.append(np.array([[-column[0], 0.0], column]))
    if scene.bounds.floor is not None:
        outlines.append(np.array([[low[0], scene.bounds.floor]]))
    points = np.clip(np.vstack([*outlines, [low, high]]), low - 0.4, high + 0.4)
    low, high = points.min(axis=0) - 0.06, points.max(axis=0) + 0.06
    # Not as limits, which Matplotlib would warn to widen for equal axes.
    stage.dataLim.set_points(np.array([low, high]))
    stage.margins(0.0)
    stage.autoscale_view()
    stage.set(xlabel="x [m]", ylabel="z [m]")
    # Filling its place: the layout makes no room for labels around a shrunken one.
    stage.set_aspect("equal", adjustable="datalim")
    stage.grid(alpha=0.25)
    figure: Any = stage.figure
    entries = stage.get_legend_handles_labels()
    if len(entries[0]) > 1:
        below: dict[str, Any] = {"loc": "outside lower center", "frameon": False, "fontsize": 8}
        figure.legend(*entries, ncols=int(figure.get_figwidth() / 1.8), **below)


def _draw_release(axes: Axes, scene: Scene, line: Timeline) -> None:
    """The bar between the pads at some instants of the opening, in the hand's frame.

    The carried bar is horizontal; the title has its slip and pivot angle.
    """
    from matplotlib.patches import Circle

    begin, end = (line.index(line.marks[name]) for name in ("opening", "detach"))
    angle = line.hand[2] + scene.grasp.angle
    x, z = line.com[:2] - line.hand[:2]
    cos, sin = np.cos(angle), np.sin(angle)
    in_hand = np.array([cos * x + sin * z, cos * z - sin * x, line.com[2] - angle])
    palm = hand_corners(scene, np.array([0.0, 0.0, -scene.grasp.angle]))
    axes.fill(*palm.T, color=ARM, alpha=0.4, lw=0, zorder=1)
    for i in np.linspace(begin, end, 5).astype(int):
        colour = PHASES[line.phase_name(i)]
        look: dict[str, Any] = {"fc": (colour, 0.1), "ec": colour, "lw": 1.2, "zorder": 3}
        draw_bars(axes, scene.object, in_hand[:, i], **look)
    pad = float(scene.patch.patch_radius)
    axes.add_patch(Circle((0.0, 0.0), pad, fill=False, color=BLACK, ls=":", zorder=4))
    axes.plot(*in_hand[:2, begin : end + 1], color=BLACK, lw=1.2, zorder=4)
    axes.plot(*in_hand[:2, end], "o", color=BLACK, ms=3, zorder=4)
    # The axes keep their width, for the title.
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.margins(0.04)
    axes.set_xlabel("in the hand's frame [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    cos, sin = np.cos(in_hand[2, end]), np.sin(in_hand[2, end])
    # Motion of the pads' centre along and across the bar.
    across = np.array([[cos, sin], [-sin, cos]]) @ in_hand[:2, end] - in_hand[:2, begin]
    pivot = np.degrees(in_hand[2, end] - in_hand[2, begin])
    opening = 1e3 * (line.times[end] - line.times[begin])
    title = f"between the pads (dotted) while they open, {opening:.0f} ms:\n"
    title += f"slips {1e3 * np.linalg.norm(across):.2f} mm, pivots {round(pivot, 1) + 0.0:.1f} deg"
    axes.set_title(title, loc="left", fontsize=9)


def _draw_arms(stage: Axes, scene: Scene, line: Timeline) -> None:
    """The arm (or hand) at rest, as the opening starts and at detach."""
    thin = {"lw": 1.6, "ms": 3}
    looks: dict[str, dict[str, Any]] = {"at rest": {**thin, "ls": ":"}, "opening": thin}
    for name in ("at rest", "opening", "detach"):
        i, look = line.index(line.marks.get(name, 0.0)), ARM_LINE | looks.get(name, {})
        hand = {"fill": name == "detach", "ls": look.get("ls", "-"), "color": ARM, "lw": 1.6}
        if line.arm is None:
            hand["label"] = f"hand, {name}"
        else:
            stage.plot(*line.arm[i], marker="o", label=f"arm, {name}", **look)
        stage.fill(*hand_corners(scene, line.hand[:, i]).T, zorder=2, **hand)


def _draw_bars(stage: Axes, bar: Object, line: Timeline) -> None:
    """Poses of the bar, coloured by phase, and the CoM's path."""
    stage.plot(line.com[0], line.com[1], color=BLACK, lw=0.9, zorder=3)
    detach, last = line.index(line.marks["detach"]), len(line.times) - 1
    carried = np.linspace(0, line.index(line.marks["opening"]), CARRIED).astype(int)[:-1]
    landing = line.index(line.marks["landing"])
    indices = np.union1d(carried, np.linspace(detach, landing, FLYING).astype(int))
    if landing < last:
        indices = np.union1d(indices, np.linspace(landing, last, LANDED).astype(int))
    changes = np.flatnonzero(np.diff(line.phase)) + 1
    for i in np.union1d(indices, changes):
        colour = PHASES[line.phase_name(i)]
        draw_bars(stage, bar, line.com[:, i], color=colour, alpha=0.75, lw=0.5, zorder=5)
    for i in np.unique(line.phase, return_index=True)[1]:
        name = line.phase_name(i)
        stage.plot([], [], color=PHASES[name], lw=5, label=f"bar, {name}")


def _draw_plots(axes: list[Axes], line: Timeline) -> None:
    """Grip force, turning rates and friction use from 120 ms before the command."""
    grip, rate, use = axes
    t = 1e3 * line.times
    grip.plot(t, np.where(line.times <= line.marks["detach"], line.grip, 0.0), color=ARM)
    grip.set_ylabel("f_N [N]")
    rate.plot(t, line.hand_rate, color=ARM, label="hand")
    rate.plot(t, line.object_rate, color=GREEN, label="object")
    low, high = rate.get_ylim()
    if high - low < 1.0:
        rate.set_ylim((low + high - 1.0) / 2, (low + high + 1.0) / 2)
    rate.set_ylabel("ω [rad/s]")
    use.plot(t, np.minimum(line.force_use, 3.0), color=RED, label="force")
    use.plot(t, np.minimum(line.torque_use, 3.0), color=ORANGE, label="torque")
    use.axhline(1.0, color="k", lw=0.8)
    use.set(ylabel="friction use", xlabel="t [ms]", ylim=(0, 1.6))
    beyond = "above 1 it slips; infinite where the grip force falls to 0"
    use.set_title(beyond, loc="left", fontsize=8)
    for axis in (rate, use):
        axis.legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.set_xlim(1e3 * line.marks["command"] - 120.0, 1e3 * line.marks["landing"])
        for moment in line.marks.values():
            axis.axvline(1e3 * moment, color="#999999", lw=0.8, ls=":")
    # At different places: the moments may be close together.
    words: dict[str, Any] = {"rotation": 90, "va": "top", "fontsize": 7}
    places = {"command": (0.97, "right"), "opening": (0.55, "right"), "detach": (0.97, "left")}
    for name, (height, side) in places.items():
        where = 1e3 * line.marks[name], height
        grip.annotate(name, where, xycoords=("data", "axes fraction"), ha=side, **words)


@own_style()
def draw_throw_moving(throw: Throw, path: Path) -> None:
    """The throw as a GIF at a fifth of its speed, until shortly after its end."""
    from PIL import Image

    line = timeline(throw)
    last = len(line.times) - 1
    # At least five frames a second of the film.
    count = max(90, round(5 * line.times[-1] / SLOW))
    indices = np.append(np.unique(np.linspace(0, last, count).astype(int)), np.full(12, last))
    fps = max(5.0, min(20.0, len(indices) * SLOW / line.times[-1]))
    # The first instant of each phase and the last instant show all colours.
    typical = np.append(np.unique(line.phase, return_index=True)[1], last)
    palette = _palette(np.vstack(list(_frames(throw, line, typical))))
    images = (
        Image.fromarray(pixels).convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE)
        for pixels in _frames(throw, line, indices)
    )
    duration = 1000 // round(fps)
    first = next(images)
    first.save(path, save_all=True, append_images=images, duration=duration, loop=0, optimize=False)


def _palette(pixels: Pixels) -> Image.Image:
    """At most 256 colours, the most frequent of each cell of 16 values a channel.

    Exact for white and the phases: Pillow looks up a palette's colours in coarser cells only.
    """
    from PIL import Image

    counts: Any = Image.fromarray(pixels).convert("RGB").getcolors(pixels.size)
    cells: dict[tuple[int, ...], tuple[int, ...]] = {}
    for _, colour in sorted(counts, reverse=True):
        cells.setdefault(tuple(value // 16 for value in colour), colour)
    palette = Image.new("P", (1, 1))
    palette.putpalette(list(itertools.chain.from_iterable(cells.values()))[: 3 * 256])
    return palette


def _frames(throw: Throw, line: Timeline, indices: Indices) -> Iterator[Pixels]:
    """These instants of the throw as pixels (H, W, 4), RGBA, one after another.

    The background is drawn once.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.patches import PathPatch

    figure = new_figure(7.2, 5.4)
    figure.set_dpi(80)
    canvas: Any = FigureCanvasAgg(figure)
    stage, scene = figure.subplots(), throw.scene
    draw_surroundings(stage, scene, throw.target)
    frame_stage(stage, scene, throw.target, line)
    bar: Any = stage.add_patch(PathPatch(bar_path(scene.object, line.com[:, 0]), zorder=6))
    trail = stage.plot([], [], color=BLACK, lw=0.8, zorder=3)[0]
    arm = stage.plot([], [], "-o", zorder=4, **ARM_LINE)[0]
    hand = stage.fill([], [], color=ARM, zorder=4)[0]
    label = stage.text(0.02, 0.97, "", transform=stage.transAxes, va="top", fontsize=10)

    def show(i: int) -> None:
        phase = line.phase_name(i)
        bar.set(path=bar_path(scene.object, line.com[:, i]), color=PHASES[phase])
        trail.set_data(line.com[0, : i + 1], line.com[1, : i + 1])
        if line.arm is not None:
            arm.set_data(*line.arm[i])
        hand.set_xy(hand_corners(scene, line.hand[:, i]))
        label.set_text(frame_words(line, i))

    show(0)
    lay_out(figure)
    name_obstacles(stage, scene, throw.target)
    children = sorted(stage.get_children(), key=lambda artist: artist.get_zorder())
    # Grid, floor and fixed bodies are behind; the trail is the first that moves.
    front = [artist for artist in children if artist.get_zorder() >= trail.get_zorder()]
    for artist in front:
        artist.set_animated(True)
    canvas.draw()
    behind = canvas.copy_from_bbox(figure.bbox)
    for i in indices:
        show(int(i))
        canvas.restore_region(behind)
        for artist in front:
            stage.draw_artist(artist)
        yield np.array(canvas.buffer_rgba())


def frame_words(line: Timeline, i: int) -> str:
    """Time, phase and playback speed of a frame."""
    phase = line.phase_name(i)
    phase = line.end if phase == "landed" else phase
    return f"t = {1e3 * line.times[i]:.0f} ms   {phase}   {1 / SLOW:.0f} times slower"
