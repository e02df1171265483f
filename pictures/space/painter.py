"""The 3-D view as a picture and as a film, by PyVista: without browser, display or graphics card.

A `Painter` takes the place of viser's server.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Iterator
from ctypes.util import find_library
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...interrupts import scratch_folder
from ...models import Array
from ...problems import InputError
from ..style import PHASES
from ..throw_picture import CARRIED, FLYING, SLOW, frame_words
from .motion import SpaceMotion
from .stage import View, put

#: A picture (height, width, 3), 0 to 255.
Pixels = NDArray[np.uint8]
#: Width and height [px] of a picture.
SIZE = (960, 720)
#: Frame rate [1/s] of a film.
FPS = 25
#: Width [px] of a line of 1 m.
PIXELS = 600
#: Size of the throw in a picture against that in the browser, where the panel covers a part.
ZOOM = 1.15


@dataclass(eq=False)
class Actor:
    """A shape or frame of the scene; position and wxyz are in the frame its name lies in."""

    name: str
    actor: Any = None
    color: Any = None
    opacity: float | None = None
    position: Any = (0.0, 0.0, 0.0)
    wxyz: Any = (1.0, 0.0, 0.0, 0.0)
    dimensions: Any = None
    visible: bool = True


class Painter:
    """The parts of viser's server and scene that `View` uses, and `picture`.

    InputError without PyVista.
    """

    atomic = contextlib.nullcontext

    def __init__(self) -> None:
        try:
            import pyvista
        except ImportError:
            raise InputError("pictures in 3-D need PyVista: pip install pyvista") from None
        # VTK would write on stderr that there is no display.
        pyvista.vtk_verbosity("off")
        self._pv: Any = pyvista
        self.initial_camera: Any = SimpleNamespace()
        self._plotter: Any = self._pv.Plotter(
            off_screen=True, window_size=SIZE, lighting="three lights"
        )
        # What VTK takes where it finds no other; without its library VTK crashes.
        software = self._plotter.render_window.GetClassName() == "vtkOSOpenGLRenderWindow"
        if software and find_library("OSMesa") is None:
            raise InputError(
                "pictures in 3-D need OpenGL: on Debian and Ubuntu the package libegl1"
            )
        self._plotter.enable_anti_aliasing("msaa", multi_samples=8)
        self._nodes = dict[str, Actor]()

    @property
    def scene(self) -> Painter:
        """The scene: the painter itself."""
        return self

    def add_frame(self, name: str, show_axes: bool = False) -> Actor:
        """Add a frame that other nodes are placed in."""
        self._nodes[name] = Actor(name)
        return self._nodes[name]

    def add_box(self, name: str, color: Any, dimensions: Any, **look: Any) -> Actor:
        """Add a box of three sides [m]."""
        x, y, z = dimensions
        box = self._pv.Cube(x_length=x, y_length=y, z_length=z)
        return self._add(name, box, color, dimensions=dimensions, **look)

    def add_cylinder(
        self, name: str, radius: float, height: float, color: Any, **look: Any
    ) -> Actor:
        """Add a cylinder about z [m]."""
        axis = (0.0, 0.0, 1.0)
        body = self._pv.Cylinder(direction=axis, radius=radius, height=height, resolution=48)
        return self._add(name, body, color, **look)

    def add_icosphere(
        self, name: str, radius: float, color: Any, subdivisions: int = 2, **look: Any
    ) -> Actor:
        """Add a ball [m]."""
        return self._add(name, self._pv.Icosphere(radius, nsub=subdivisions), color, **look)

    def add_mesh_simple(
        self, name: str, vertices: Array, faces: Array, color: Any, side: str = "", **look: Any
    ) -> Actor:
        """Add triangles: vertices (N, 3) [m] and their indices (M, 3)."""
        return self._add(name, self._pv.PolyData.from_regular_faces(vertices, faces), color, **look)

    def _add(self, name: str, mesh: Any, color: Any, **look: Any) -> Actor:
        look = {key: value for key, value in look.items() if not key.endswith("shadow")}
        smooth = {"smooth_shading": True, "split_sharp_edges": True}
        actor = self._plotter.add_mesh(mesh, name=name, ambient=0.3, **smooth)
        self._nodes[name] = Actor(name, actor, color, **look)
        return self._nodes[name]

    def add_grid(
        self,
        name: str,
        width: float,
        height: float,
        position: Any,
        cell_size: float,
        section_size: float,
        **look: Any,
    ) -> None:
        """Add the floor: lines every `cell_size` and, darker, every `section_size` [m]."""
        for step, grey in ((cell_size, "#e2e2e2"), (section_size, "#bebebe")):
            cells = {"i_resolution": round(width / step), "j_resolution": round(height / step)}
            plane = self._pv.Plane(center=position, i_size=width, j_size=height, **cells)
            look = {"color": grey, "style": "wireframe", "lighting": False}
            self._plotter.add_mesh(plane, name=f"{name}/{step}", **look)

    def add_line_segments(self, name: str, points: Array, colors: Any, thickness: float) -> None:
        """Add line segments (N, 2, 3) [m] in the frame of `name`."""
        ends = points.reshape(-1, 3)
        lines = self._pv.line_segments_from_points(ends)
        lines["color"] = np.broadcast_to(colors, points.shape).reshape(-1, 3).astype(np.uint8)
        width = max(1.0, PIXELS * thickness)
        colours: dict[str, Any] = {"scalars": "color", "rgb": True, "lighting": False}
        actor = self._plotter.add_mesh(
            lines, name=name, line_width=width, render_lines_as_tubes=True, **colours
        )
        self._nodes[name] = Actor(name, actor)

    def add_label(self, name: str, text: str, anchor: str, position: Any) -> None:
        """Add a text to the right of a point."""
        at = self._pose(name)[:3] @ np.append(position, 1.0)
        look: dict[str, Any] = {"shape": "rect", "shape_color": "white", "shape_opacity": 0.7}
        look |= {"font_size": 15, "bold": False, "show_points": False, "always_visible": True}
        self._plotter.add_point_labels([at], [f" {text} "], name=name, **look)

    def picture(self, title: str) -> Pixels:
        """The scene as its camera sees it, with a title."""
        for name, node in self._nodes.items():
            if node.actor is None:
                continue
            node.actor.user_matrix = self._pose(name)
            node.actor.visibility = bool(node.visible)
            if node.color is not None:
                node.actor.prop.color = tuple(node.color)
                node.actor.prop.opacity = 1.0 if node.opacity is None else node.opacity
        camera, at = self._plotter.camera, self.initial_camera
        camera.position, camera.focal_point, camera.up = at.position, at.look_at, at.up
        camera.view_angle = math.degrees(2 * math.atan(math.tan(at.fov / 2) / ZOOM))
        self._plotter.reset_camera_clipping_range()
        self._plotter.add_text(title, position=(15, SIZE[1] - 35), font_size=9, name="title")
        return np.asarray(self._plotter.screenshot(return_img=True), np.uint8)

    def _pose(self, name: str) -> Array:
        """Pose (4, 4) of a node, or of its nearest ancestor that is a node."""
        from scipy.spatial.transform import Rotation

        if name in ("", "/"):
            return np.eye(4)
        pose = self._pose(name.rpartition("/")[0])
        if (node := self._nodes.get(name)) is None:
            return pose
        local = np.eye(4)
        local[:3, :3] = Rotation.from_quat(np.array(node.wxyz), scalar_first=True).as_matrix()
        local[:3, 3] = node.position
        return np.asarray(pose @ local)


def save_in_space(shown: SpaceMotion, kind: str, path: Path) -> None:
    """A 3-D picture ("png") just before detach, with poses of the bar; or a film ("mp4") at a fifth
    of a single throw's speed, or of several at their own, whose last frame stays half a second.

    Leaves no partial file; InputError if the file cannot be written, and without the extra `film`.
    """
    if path.suffix != f".{kind}":
        raise InputError(f"--{kind} {path}: must end in .{kind}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with scratch_folder(path.parent) as scratch:
            if kind == "png":
                from PIL import Image

                Image.fromarray(_picture(shown)).save(scratch / path.name)
            else:
                _encode(_film(shown), scratch / path.name)
            os.replace(scratch / path.name, path)
    except OSError as error:
        raise InputError(f"--{kind} {path}: {error.strerror or error}") from None


def _picture(shown: SpaceMotion) -> Pixels:
    painter = Painter()
    view = View(painter, shown)
    if shown.is_single:
        _add_ghosts(view)
    view.show(shown.begins[0] + shown.throws[0].throw.detach_time - 0.002)
    return painter.picture(shown.name)


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


def _film(shown: SpaceMotion) -> Iterator[Pixels]:
    """The film's frames, one after another."""
    painter, single = Painter(), shown.is_single
    view = View(painter, shown)
    ghosts = _add_ghosts(view) if single else []
    moments = np.arange(0.0, shown.times[-1], (SLOW if single else 1.0) / FPS)
    for i in np.searchsorted(shown.times, moments - 1e-9):
        time = shown.times[i]
        view.show(time)
        for passed, ghost in ghosts:
            ghost.visible = passed <= time
        words = frame_words(shown.throws[0].line, i)
        picture = painter.picture(words if single else f"t = {time:.2f} s   {shown.words(i)}")
        yield picture
    yield from [picture] * (FPS // 2)


def _encode(frames: Iterator[Pixels], path: Path) -> None:
    """Write frames as H.264 in the pixel format of all players."""
    try:
        import av
    except ImportError:
        raise InputError("--mp4: needs PyAV: pip install av") from None
    with av.open(path, "w") as film:
        stream = film.add_stream("libx264", rate=FPS)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        for pixels in frames:
            film.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
        film.mux(stream.encode())
