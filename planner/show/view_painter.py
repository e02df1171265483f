"""The 3-D view as a picture and as a film, without browser or graphics card.

A `Painter` replaces viser's server. It keeps each shape as triangles and paints them from far to
near.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.compile import scratch_folder
from ...models import Array
from ...problems import InputError
from .cycle_view import CycleView, SpaceCycle
from .style import PHASES
from .throw_picture import CARRIED, FLYING, SLOW, frame_words
from .view import View, put
from .view_throw import SpaceThrow

if TYPE_CHECKING:
    from PIL import Image, ImageDraw

#: Width and height [px] of a picture.
SIZE = (960, 720)
#: Frame rate [1/s] of a film.
FILM_FPS = 25


@dataclass(frozen=True)
class PainterSettings:
    """Resolution, distances, light and shadows of a picture.

    oversampling: factor of the painted size over the final one. edge [m]: longest of a triangle;
    longer triangles have no clear order in depth. light: direction to it. ambient: share of light
    from all sides. near [m]: distance to the camera below which nothing is painted. zoom: size of
    the throw against the browser's view. floor [m]: depth of the floor's lines, behind all other
    shapes.
    """

    oversampling: int = 2
    edge: float = 0.05
    light: tuple[float, float, float] = (-0.35, -0.5, 0.8)
    ambient: float = 0.7
    shadow: tuple[int, int, int] = (222, 222, 222)
    near: float = 0.2
    zoom: float = 1.15
    floor: float = 1e3


LOOK = PainterSettings()

#: Depth [m] of a shape, and what paints it.
Shape = tuple[float, Callable[[], None]]


@dataclass(eq=False)
class MeshNode:
    """A shape or frame of the scene; position and wxyz are in the frame its name lies in."""

    name: str
    vertices: Array
    faces: Array
    color: tuple[int, int, int] = (0, 0, 0)
    opacity: float | None = None
    position: Any = (0.0, 0.0, 0.0)
    wxyz: Any = (1.0, 0.0, 0.0, 0.0)
    dimensions: Any = None
    visible: bool = True


@dataclass
class Painter:
    """The parts of viser's server and scene that `View` uses, and `picture`."""

    nodes: dict[str, MeshNode] = field(default_factory=dict)
    lines: list[tuple[str, Array, Array, float]] = field(default_factory=list)
    words: list[tuple[str, str, Array]] = field(default_factory=list)
    initial_camera: Any = field(default_factory=SimpleNamespace)
    floor: float = 0.0
    atomic = contextlib.nullcontext

    def __post_init__(self) -> None:
        """InputError without trimesh."""
        try:
            import trimesh
        except ImportError:
            raise InputError("pictures in 3-D need trimesh: pip install trimesh") from None
        self.trimesh: Any = trimesh

    @property
    def scene(self) -> Painter:
        """The scene: the painter itself."""
        return self

    def add_frame(self, name: str, show_axes: bool = False) -> MeshNode:
        """A frame that other nodes are placed in."""
        return self._add(name, self.trimesh.Trimesh())

    def add_box(self, name: str, color: Any, dimensions: Any, **look: Any) -> MeshNode:
        """A box of three sides [m]."""
        box = self.trimesh.creation.box(dimensions)
        return self._add(name, box, color, dimensions=dimensions, **look)

    def add_cylinder(
        self, name: str, radius: float, height: float, color: Any, **look: Any
    ) -> MeshNode:
        """A cylinder about z [m]."""
        cylinder = self.trimesh.creation.cylinder(radius, height, sections=28)
        return self._add(name, cylinder, color, **look)

    def add_icosphere(
        self, name: str, radius: float, color: Any, subdivisions: int = 2, **look: Any
    ) -> MeshNode:
        """A ball [m]."""
        ball = self.trimesh.creation.icosphere(min(subdivisions, 2), radius)
        return self._add(name, ball, color, **look)

    def add_mesh_simple(
        self, name: str, vertices: Array, faces: Array, color: Any, side: str = "", **look: Any
    ) -> MeshNode:
        """Triangles: vertices (N, 3) [m] and their indices (M, 3)."""
        return self._add(name, SimpleNamespace(vertices=vertices, faces=faces), color, **look)

    def add_grid(
        self, name: str, width: float, height: float, position: Any, cell_size: float, **look: Any
    ) -> None:
        """The floor: lines every `cell_size` [m], cut at each crossing."""
        self.floor = position[2]
        at = np.arange(-width / 2, width / 2 + cell_size / 2, cell_size)
        points = np.stack([*np.meshgrid(at, at), np.full((len(at),) * 2, self.floor)], axis=-1)
        for grid in (points, points.transpose(1, 0, 2)):
            pieces = np.stack([grid[:, :-1], grid[:, 1:]], axis=2)
            heavy = np.arange(len(at)) % 5 == 0
            for rows, grey in ((pieces[~heavy], 226), (pieces[heavy], 190)):
                self.add_line_segments("/floor", rows.reshape(-1, 2, 3), (grey,) * 3, 0.0)

    def add_line_segments(self, name: str, points: Array, colors: Any, thickness: float) -> None:
        """Add line segments (N, 2, 3) [m] in the frame of `name`."""
        colours = np.broadcast_to(colors, points.shape)[:, 0]
        self.lines.append((name, points, colours, thickness))

    def add_label(self, name: str, text: str, anchor: str, position: Any) -> None:
        """A text to the right of a point."""
        self.words.append((name, text, np.array(position)))

    def picture(self, title: str) -> Image.Image:
        """The scene as its camera sees it, with a title."""
        from PIL import Image, ImageDraw, ImageFont

        font = ImageFont.load_default(15 * LOOK.oversampling)
        image = Image.new(
            "RGB", (SIZE[0] * LOOK.oversampling, SIZE[1] * LOOK.oversampling), "white"
        )
        draw = ImageDraw.Draw(image)
        # From far to near: the floor's lines, shadows, then the rest.
        shapes = [*self._segments(draw), *self._triangles(draw, image)]
        for _, paint in sorted(shapes, key=lambda shape: -shape[0]):
            paint()
        for name, text, at in self.words:
            place, depth = self._project(self._pose(name)[:3] @ np.append(at, 1.0))
            if depth > LOOK.near:
                look: dict[str, Any] = {"font": font, "stroke_width": 6, "stroke_fill": "white"}
                draw.text((place[0] + 10, place[1]), text, fill="black", anchor="lm", **look)
        draw.text(
            (30, 24), title, fill="black", font=ImageFont.load_default(18 * LOOK.oversampling)
        )
        return image.resize(SIZE, Image.Resampling.LANCZOS)

    def _add(self, name: str, mesh: Any, color: Any = 0, **look: Any) -> MeshNode:
        vertices, faces = mesh.vertices, mesh.faces
        look = {key: value for key, value in look.items() if not key.endswith("shadow")}
        if len(faces) and look.get("opacity") is None:
            split = self.trimesh.remesh.subdivide_to_size
            vertices, faces = split(vertices, faces, LOOK.edge, max_iter=20)
        self.nodes[name] = MeshNode(name, np.array(vertices), np.array(faces), color, **look)
        return self.nodes[name]

    def _pose(self, name: str) -> Array:
        """Pose (4, 4) of a node, or of its nearest ancestor that is a node."""
        from scipy.spatial.transform import Rotation

        if name in ("", "/"):
            return np.eye(4)
        pose = self._pose(name.rpartition("/")[0])
        if name not in self.nodes:
            return pose
        node, local = self.nodes[name], np.eye(4)
        local[:3, :3] = Rotation.from_quat(np.array(node.wxyz), scalar_first=True).as_matrix()
        local[:3, 3] = node.position
        return np.asarray(pose @ local)

    def _project(self, points: Array) -> tuple[Array, Array]:
        """Pixels (..., 2) and depths (...) [m] of points (..., 3) [m]."""
        camera = self.initial_camera
        ahead = camera.look_at - camera.position
        ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(ahead, camera.up)
        right /= np.linalg.norm(right)
        in_camera = (points - camera.position) @ np.array([right, np.cross(ahead, right), ahead]).T
        size = LOOK.oversampling * np.array(SIZE)
        scale = LOOK.zoom * size[1] / 2 / np.tan(camera.fov / 2)
        depth = in_camera[..., 2]
        distance = np.maximum(depth, LOOK.near)[..., None]
        return size / 2 + scale * in_camera[..., :2] / distance, depth

    def _segments(self, draw: ImageDraw.ImageDraw) -> Iterator[Shape]:
        """Line segments; those without thickness are on the floor, under everything."""
        for name, pieces, colours, thickness in self.lines:
            pose = self._pose(name)
            places, depths = self._project(pieces @ pose[:3, :3].T + pose[:3, 3])
            middle = depths.mean(axis=1)
            wide = (
                LOOK.zoom * LOOK.oversampling * SIZE[1] * thickness / np.maximum(middle, LOOK.near)
            )
            for k in np.flatnonzero(depths.min(axis=1) > LOOK.near):
                back = LOOK.floor if thickness == 0.0 else middle[k]
                pixels, width = places[k].ravel().tolist(), max(2, round(float(wide[k])))
                yield back, partial(draw.line, pixels, tuple(colours[k]), width)

    def _triangles(self, draw: ImageDraw.ImageDraw, image: Image.Image) -> Iterator[Shape]:
        """Triangles that face the camera, and shadows; those of a transparent node as one shape."""
        from scipy.spatial import ConvexHull

        light = np.array(LOOK.light) / np.linalg.norm(LOOK.light)
        for node in self.nodes.values():
            if not (node.visible and len(node.faces)):
                continue
            pose = self._pose(node.name)
            corners = (node.vertices @ pose[:3, :3].T + pose[:3, 3])[node.faces]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
            toward = self.initial_camera.position - corners.mean(axis=1)
            facing = (toward * normals).sum(axis=1) > 0
            if not facing.any():  # The body of a hand without one.
                continue
            corners, normals = corners[facing], normals[facing]
            places, depths = self._project(corners)
            shade = LOOK.ambient + (1 - LOOK.ambient) * np.maximum(normals @ light, 0.0)
            colours = (np.array(node.color) * shade[:, None]).astype(int)
            if node.opacity is not None:
                yield depths.mean(), partial(_paint_glass, image, places, colours, node.opacity)
                continue
            for depth, place, colour in zip(depths.mean(axis=1), places, colours, strict=True):
                yield depth, partial(draw.polygon, place.ravel().tolist(), tuple(colour.tolist()))
            # The shadow of a convex body: all nodes but a cup's rim are convex.
            corners[..., 2] = self.floor
            under = self._project(corners.reshape(-1, 3))[0]
            under = under[ConvexHull(under).vertices]
            yield LOOK.floor / 2, partial(draw.polygon, under.ravel().tolist(), LOOK.shadow)


def _paint_glass(image: Image.Image, places: Array, colours: Array, opacity: float) -> None:
    """Paint transparent triangles (N, 3, 2) [px] at once: else their common edges would show."""
    from PIL import Image, ImageDraw

    low, high = np.floor(places.min(axis=(0, 1))), np.ceil(places.max(axis=(0, 1))) + 1
    size = tuple((high - low).astype(int).tolist())
    layer, mask = Image.new("RGB", size), Image.new("L", size)
    for place, colour in zip(places, colours, strict=True):
        shape = (place - low).ravel().tolist()
        ImageDraw.Draw(layer).polygon(shape, fill=tuple(colour.tolist()))
        ImageDraw.Draw(mask).polygon(shape, fill=round(255 * opacity))
    image.paste(layer, tuple(low.astype(int).tolist()), mask)


def save_in_space(shown: SpaceThrow | SpaceCycle, kind: str, path: Path) -> None:
    """A 3-D picture ("png") just before detach, with poses of the bar; or a film ("mp4") at a fifth
    of the throw's speed, a cycle's at its own, whose last frame stays half a second.

    Leaves no partial file; InputError if the file cannot be written, without trimesh, and for a
    film without ffmpeg.
    """
    (_save_picture if kind == "png" else _save_film)(shown, path)


def _save_picture(shown: SpaceThrow | SpaceCycle, path: Path) -> None:
    painter = Painter()
    if isinstance(shown, SpaceCycle):
        CycleView(painter, shown).show(shown.begins[0] + shown.throws[0].throw.detach_time - 0.002)
    else:
        view = View(painter, shown)
        _add_ghosts(view)
        view.show(shown.throw.detach_time - 0.002)
    with _replacement(path, "png") as file:
        painter.picture(shown.name).save(file)


def _save_film(shown: SpaceThrow | SpaceCycle, path: Path) -> None:
    with _replacement(path, "mp4") as file:
        if shutil.which("ffmpeg") is None:
            raise InputError("--mp4: needs ffmpeg, which is not installed")
        film = _cycle_film(shown) if isinstance(shown, SpaceCycle) else _film(shown)
        if status := _encode(film, file):
            raise InputError(f"--mp4 {path}: ffmpeg failed with status {status}")


@contextlib.contextmanager
def _replacement(path: Path, kind: str) -> Iterator[Path]:
    """A scratch path for a file of a kind; it replaces `path` when the block is done."""
    if path.suffix != f".{kind}":
        raise InputError(f"--{kind} {path}: must end in .{kind}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with scratch_folder(path.parent) as scratch:
            yield scratch / path.name
            os.replace(scratch / path.name, path)
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


def _film(throw: SpaceThrow) -> Iterator[Image.Image]:
    """The film's frames, one after another."""
    line, painter = throw.line, Painter()
    view = View(painter, throw)
    ghosts = _add_ghosts(view)
    moments = np.arange(0.0, line.times[-1], SLOW / FILM_FPS)
    for i in np.searchsorted(line.times, moments - 1e-9):
        time = line.times[i]
        view.show(time)
        for passed, ghost in ghosts:
            ghost.visible = passed <= time
        picture = painter.picture(frame_words(line, i))
        yield picture
    yield from [picture] * (FILM_FPS // 2)


def _cycle_film(cycle: SpaceCycle) -> Iterator[Image.Image]:
    """The frames of a cycle's film, one after another."""
    painter = Painter()
    view = CycleView(painter, cycle)
    for time in np.arange(0.0, cycle.times[-1], 1 / FILM_FPS):
        i = view.show(time)
        picture = painter.picture(f"t = {time:.2f} s   {cycle.words(i)}")
        yield picture
    yield from [picture] * (FILM_FPS // 2)


def _encode(pictures: Iterable[Image.Image], path: Path) -> int:
    """Writes pictures of `SIZE` as H.264 in the pixel format of all players.

    Returns the exit status of ffmpeg.
    """
    command = [
        *("ffmpeg", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{SIZE[0]}x{SIZE[1]}", "-framerate", str(FILM_FPS), "-i", "pipe:"),
        *("-vcodec", "h264", "-pix_fmt", "yuv420p", "-y", str(path)),
    ]
    silent = subprocess.DEVNULL
    # The exit status reports an early end of ffmpeg.
    with (
        contextlib.suppress(BrokenPipeError),
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=silent, stderr=silent) as process,
    ):
        assert process.stdin is not None
        for picture in pictures:
            process.stdin.write(picture.tobytes())
    return process.returncode
