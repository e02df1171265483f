"""The throw as a moving picture, throw.gif, and in 3-D as a picture and as a film."""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import Indices
from ...problems import InputError
from .painter import Painter
from .style import ARM, BLACK, PHASES, new_figure
from .throw_picture import (
    CARRIED,
    FLYING,
    bar_corners,
    draw_surroundings,
    frame_stage,
    hand_corners,
)
from .timeline import Timeline, timeline
from .view import SpaceThrow, View, put

if TYPE_CHECKING:
    from PIL import Image

    from ..throw import Throw

Pixels = npt.NDArray[np.uint8]

#: Playback speed over real time.
SLOW = 0.2
#: Frames of throw.gif, without repeats of the last one.
FRAMES = 90
#: Repeats of the last frame of throw.gif.
LAST_FRAMES = 12
#: Largest frame rate [1/s] of throw.gif.
GIF_FPS = 20
#: Frame rate [1/s] of a film.
FILM_FPS = 25
#: Width, of 256, of a cell of colours; throw.gif's palette has one colour of each cell.
CELL = 16
#: Lowest zorder of the artists that are drawn in every frame; the others are drawn once.
FRONT = 3


def draw_throw_moving(throw: Throw, path: Path) -> None:
    """The throw as a GIF at a fifth of its speed; it ends shortly after the landing."""
    from PIL import Image

    line = timeline(throw)
    last = len(line.times) - 1
    indices = np.unique(np.linspace(0, last, FRAMES).astype(int))
    indices = np.append(indices, np.full(LAST_FRAMES, last))
    fps = max(5.0, min(GIF_FPS, len(indices) * SLOW / line.times[-1]))
    # The first instant of each phase and the last instant show all colours.
    typical = np.append(np.unique(line.phase, return_index=True)[1], last)
    palette = _palette(np.vstack(list(frames(throw, line, typical))))
    images = (
        Image.fromarray(pixels).convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE)
        for pixels in frames(throw, line, indices)
    )
    duration = 1000 // round(fps)
    first = next(images)
    first.save(path, save_all=True, append_images=images, duration=duration, loop=0, optimize=False)


def _palette(pixels: Pixels) -> Image.Image:
    """At most 256 colours, the most frequent of each cell: exact for white and the phases."""
    from PIL import Image

    counts: Any = Image.fromarray(pixels).convert("RGB").getcolors(pixels.size)
    cells: dict[tuple[int, ...], tuple[int, ...]] = {}
    for _, colour in sorted(counts, reverse=True):
        cells.setdefault(tuple(value // CELL for value in colour), colour)
    palette = Image.new("P", (1, 1))
    palette.putpalette(list(itertools.chain.from_iterable(cells.values()))[: 3 * 256])
    return palette


def save_in_space(throw: SpaceThrow, kind: str, path: Path) -> None:
    """A 3-D picture ("png") just before detach, with poses of the bar; or a film ("mp4") at a fifth
    of the throw's speed, whose last frame stays half a second.

    Leaves no partial file; InputError if the file cannot be written, and for a film without ffmpeg
    or trimesh.
    """
    (_save_picture if kind == "png" else _save_film)(throw, path)


def _save_picture(throw: SpaceThrow, path: Path) -> None:
    painter = Painter()
    view = View(painter, throw)
    _add_ghosts(view)
    view.show(throw.throw.detach_time - 0.002)
    with _replacement(path, "png") as file:
        painter.picture(throw.scene.name).save(file)


def _save_film(throw: SpaceThrow, path: Path) -> None:
    with _replacement(path, "mp4") as file:
        if shutil.which("ffmpeg") is None:
            raise InputError("--mp4: needs ffmpeg, which is not installed")
        try:
            _encode(_film(throw), file)
        except subprocess.CalledProcessError as error:
            words = f"ffmpeg failed with status {error.returncode}"
            raise InputError(f"--mp4 {path}: {words}") from None


@contextlib.contextmanager
def _replacement(path: Path, kind: str) -> Iterator[Path]:
    """A scratch path for a file of a kind; it replaces `path` when the block is done."""
    if path.suffix != f".{kind}":
        raise InputError(f"--{kind} {path}: must end in .{kind}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
            yield Path(scratch) / path.name
            os.replace(Path(scratch) / path.name, path)
    except OSError as error:
        raise InputError(f"--{kind} {path}: {error.strerror or error}") from None


def _add_ghosts(view: View) -> list[tuple[float, Any]]:
    """Pale poses of the bar until the landing; their times [s] and nodes."""
    throw, line = view.throw, view.throw.line
    opening, landing = line.marks["opening"], line.marks["landing"]
    times = [*np.linspace(0.0, opening, CARRIED), *np.linspace(opening, landing, FLYING)[1:]]
    ghosts = []
    for k, time in enumerate(times):
        i = line.index(time)
        put(view.scene.add_frame(f"/way{k}"), throw.bar[i])
        ghosts.append((time, view.add_bar(f"/way{k}/bar", PHASES[line.phase_name(i)], 0.3)))
    return ghosts


def _film(throw: SpaceThrow) -> Iterator[Pixels]:
    """The film's frames (H, W, 3), one after another."""
    line, painter = throw.line, Painter()
    view = View(painter, throw)
    ghosts = _add_ghosts(view)
    indices = np.searchsorted(line.times, np.arange(0.0, line.times[-1], SLOW / FILM_FPS) - 1e-9)
    for i in indices:
        time = line.times[i]
        view.show(time)
        for passed, ghost in ghosts:
            ghost.visible = passed <= time
        pixels = np.asarray(painter.picture(_words(line, i)))
        yield pixels
    yield from [pixels] * (FILM_FPS // 2)


def _words(line: Timeline, i: int) -> str:
    """Time, phase and playback speed of a frame."""
    return f"t = {1e3 * line.times[i]:.0f} ms   {line.phase_name(i)}   {1 / SLOW:.0f} times slower"


def _encode(pictures: Iterable[Pixels], path: Path) -> None:
    """Writes pictures (H, W, 3) of one even size as H.264 in the pixel format of all players."""
    pictures = iter(pictures)
    first = next(pictures)
    high, wide = first.shape[:2]
    command = [
        *("ffmpeg", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{wide}x{high}", "-framerate", str(FILM_FPS), "-i", "pipe:"),
        *("-vcodec", "h264", "-pix_fmt", "yuv420p", "-y", str(path)),
    ]
    silent = subprocess.DEVNULL
    # The exit status reports an early end of ffmpeg.
    with (
        contextlib.suppress(BrokenPipeError),
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=silent, stderr=silent) as process,
    ):
        assert process.stdin is not None
        for picture in itertools.chain([first], pictures):
            process.stdin.write(picture.tobytes())
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)


def frames(throw: Throw, line: Timeline, indices: Indices) -> Iterator[Pixels]:
    """The instants `shown` of the throw as pixels (H, W, 4), RGBA, one after another.

    The background is drawn once.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.patches import Polygon

    figure = new_figure(7.2, 5.4)
    figure.set_dpi(80)
    canvas: Any = FigureCanvasAgg(figure)
    stage, scene = figure.subplots(), throw.scene
    draw_surroundings(stage, scene, throw.target)
    frame_stage(stage, scene, throw.target, line)
    bar = Polygon(np.zeros((4, 2)), closed=True, zorder=6)
    trail = stage.plot([], [], color=BLACK, lw=0.8, zorder=3)[0]
    arm = stage.plot([], [], "-o", color=ARM, lw=5, ms=5, solid_capstyle="round", zorder=4)[0]
    hand = Polygon(np.zeros((4, 2)), closed=True, color=ARM, zorder=4)
    stage.add_patch(bar)
    stage.add_patch(hand)
    label = stage.text(0.02, 0.97, "", transform=stage.transAxes, va="top", fontsize=10)

    def show(i: int) -> None:
        phase = line.phase_name(i)
        bar.set(xy=bar_corners(scene.object, line.com[:, i]), color=PHASES[phase])
        trail.set_data(line.com[0, : i + 1], line.com[1, : i + 1])
        if line.arm is not None:
            arm.set_data(*line.arm[i])
        hand.set_xy(hand_corners(scene, line.hand[:, i]))
        label.set_text(_words(line, i))

    show(0)
    # The layout is computed once, not for every frame.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    children = sorted(stage.get_children(), key=lambda artist: artist.get_zorder())
    front = [artist for artist in children if artist.get_zorder() >= FRONT]
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
