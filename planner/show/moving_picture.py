"""throw.gif, and the frames of the same picture as a film."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..check import SentThrow
from .picture import bar_corners, draw_surroundings, frame_stage, hand_corners
from .style import ARM
from .style import PHASES as COLOURS
from .timeline import PHASES, Timeline, timeline

if TYPE_CHECKING:
    from PIL import Image

Pixels = npt.NDArray[np.uint8]

#: Playback speed against real time, and the frames of throw.gif.
SLOW, FRAMES, FPS = 0.2, 90, 20
#: Of the colours of throw.gif within a cell of this width, of 255, the most frequent is used.
CELL = 12
#: What is drawn at this height or above it is drawn for every frame, the rest once.
FRONT = 3


def draw_throw_moving(throw: SentThrow, path: Path) -> None:
    """The throw as an animation at a fifth of its speed, ending a moment after landing."""
    line = timeline(throw)
    last = len(line.times) - 1
    shown = np.unique(np.linspace(0, last, FRAMES).astype(int))
    shown = np.concatenate([shown, np.full(12, last)])
    fps = max(5.0, min(FPS, len(shown) * SLOW / line.times[-1]))
    first, *others = indexed(list(frames(throw, line, shown)))
    duration = 1000 // round(fps)
    first.save(path, save_all=True, append_images=others, duration=duration, loop=0, optimize=False)


def indexed(pictures: Sequence[Pixels]) -> list[Image.Image]:
    """The pictures over one palette of 256 colours: those seen most, one of each cell."""
    from PIL import Image

    seen = np.zeros(1 << 24, bool)
    for picture in pictures:
        seen[_codes(picture)] = True
    known = np.flatnonzero(seen)
    place = np.zeros(1 << 24, np.intp)
    place[known] = np.arange(known.size)
    count = np.zeros(known.size, np.int64)
    for picture in pictures:
        count += np.bincount(place[_codes(picture)].ravel(), minlength=known.size)
    colours = np.stack([known & 255, known >> 8 & 255, known >> 16], axis=1)
    often = colours[np.argsort(-count, kind="stable")]
    _, first = np.unique(often // CELL, axis=0, return_index=True)
    palette = often[np.sort(first)[:256]]
    nearest = np.zeros(1 << 24, np.uint8)
    nearest[known] = ((colours[:, None] - palette) ** 2).sum(axis=2).argmin(axis=1)
    images = [Image.fromarray(nearest[_codes(picture)]) for picture in pictures]
    for image in images:
        image.putpalette(palette.astype(np.uint8).tobytes())
    return images


def _codes(picture: Pixels) -> npt.NDArray[np.uint32]:
    """Colours (H, W) as one number each: red + 256 green + 65536 blue."""
    return np.asarray(picture.view("<u4")[..., 0] & 0xFFFFFF)


def frames(throw: SentThrow, line: Timeline, shown: npt.NDArray[np.int_]) -> Iterator[Pixels]:
    """The instants `shown` of the throw as pixels (H, W, 4), RGBA, one after another.

    What lies behind everything that moves is drawn once and kept.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

    figure = Figure(figsize=(7.2, 5.4), dpi=80, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    stage, scene = figure.subplots(), throw.scene
    draw_surroundings(stage, scene, throw.target)
    frame_stage(stage, scene, line)
    bar = Polygon(np.zeros((4, 2)), closed=True, zorder=6)
    trail = stage.plot([], [], color="#222222", lw=0.8, zorder=3)[0]
    arm = stage.plot([], [], "-o", color=ARM, lw=5, ms=5, solid_capstyle="round", zorder=4)[0]
    hand = Polygon(np.zeros((4, 2)), closed=True, color=ARM, zorder=4)
    stage.add_patch(bar)
    stage.add_patch(hand)
    label = stage.text(0.02, 0.97, "", transform=stage.transAxes, va="top", fontsize=10)

    def show(i: int) -> None:
        bar.set_xy(bar_corners(scene.object, line.com[:, i]))
        phase = PHASES[line.phase[i]]
        bar.set_color(COLOURS[phase])
        trail.set_data(line.com[0, : i + 1], line.com[1, : i + 1])
        if line.arm is not None:
            arm.set_data(*line.arm[i])
        hand.set_xy(hand_corners(scene, line.hand[:, i]))
        label.set_text(f"t = {1e3 * line.times[i]:.0f} ms   {phase}")

    show(0)
    # The layout is found once, not for every frame.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    front = sorted(
        (artist for artist in stage.get_children() if artist.get_zorder() >= FRONT),
        key=lambda artist: artist.get_zorder(),
    )
    for artist in front:
        artist.set_animated(True)
    canvas.draw()
    behind = canvas.copy_from_bbox(figure.bbox)
    for i in shown:
        show(int(i))
        canvas.restore_region(behind)
        for artist in front:
            stage.draw_artist(artist)
        yield np.array(canvas.buffer_rgba())
