"""The 3-D view of a throw: what viser shows, and its state at an instant."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import Tool
from .style import ARM
from .style import PHASES as COLOURS
from .timeline import PHASES
from .view_poses import SpaceThrow, in_space, link_pieces, normal
from .view_shapes import cup_wall, quaternion, rgb, ring, rod, turned_shape

Array = npt.NDArray[np.float64]

LINK, CUP, PAD, GHOST, MARK = "#7c8899", "#b5713c", "#20242b", "#202020", "#202020"
#: Links are as thick as this share of the arm's length.
LINK_RADIUS = 0.032
#: Drawn only: the hand's width along the pads' motion; how far the pads reach beyond their
#: centre, and their size [m].
HAND_WIDTH, PAD_AHEAD, PAD_WIDTH, PAD_THICKNESS = 0.16, 0.01, 0.02, 0.012
#: Drawn only: how fast a pad goes away after detach [m/s], and how far [m].
PAD_SPEED, PAD_TRAVEL = 0.1, 0.03
#: The box that stands for a free hand's body (from, to, half width) behind the pads [m].
FREE_HAND = (0.12, 0.045, 0.03)
CUP_WALL = 0.004
LIGHT = 2.0
#: How far a mark's name is below it [m]: those at the release are near each other.
LABEL_DROP = {"command": 0.16, "opening": 0.11, "detach": 0.06, "landing": 0.0}
#: Half the least thickness drawn for a bar [m].
LEAST_HALF = 0.004
#: The camera's vertical angle, and the width over height that the throw must fit.
VIEW_ANGLE, ASPECT = math.radians(40.0), 1.15


class View:
    """A throw in a viser server; `show` puts everything where it is at a time."""

    def __init__(self, server: Any, throw: SpaceThrow) -> None:
        self.server, self.throw = server, throw
        self.scene = server.scene
        self.half_thickness = max(throw.scene.object.width / 2, LEAST_HALF)
        self._light()
        self._draw_surroundings()
        self._draw_path()
        self.joints = self._draw_arm()
        self.hand, self.pads = self._draw_hand()
        self.bar = self.scene.add_frame("/bar", show_axes=False)
        self.box = self._draw_bar("/bar/box", COLOURS["carry"], None)
        radius = 0.55 * self.half_thickness + 0.004
        for side in (-1, 1):
            at = (0.0, 0.0, side * self.half_thickness)
            self.scene.add_icosphere(f"/bar/com{side}", radius, rgb(MARK), position=at)
        self._aim_camera()
        self.show(0.0)

    def show(self, time: float) -> int:
        """Moves everything to `time` [s]; returns the instant's index."""
        throw = self.throw
        i = throw.index(time)
        with self.server.atomic():
            for frame, pose in zip(self.joints, self._joint_poses(i), strict=True):
                _put(frame, pose)
            _put(self.hand, throw.hand[i])
            _put(self.bar, throw.bar[i])
            self.box.color = rgb(COLOURS[throw.phase(i)])
            since = max(0.0, float(throw.line.times[i]) - throw.throw.detach_time)
            gap = self.half_thickness + min(PAD_TRAVEL, PAD_SPEED * since)
            for side, pad in zip((-1, 1), self.pads, strict=True):
                middle = PAD_AHEAD - pad.dimensions[0] / 2
                pad.position = (middle, 0.0, side * (gap + PAD_THICKNESS / 2))
        return i

    def _joint_poses(self, index: int) -> Array:
        joints = self.throw.joints
        return np.empty((0, 4, 4)) if joints is None else joints[index]

    def _light(self) -> None:
        """Light from all sides besides viser's lamps, and no room around: none is fetched."""
        self.scene.configure_environment_map(None)
        self.scene.add_light_ambient("/light", intensity=LIGHT)

    def _draw_arm(self) -> list[Any]:
        """The arm's links and joints; returns the nodes that move with each joint."""
        arm = self.throw.scene.arm
        if arm is None:
            return []
        pieces = link_pieces(arm)
        lengths = [np.linalg.norm(end - begin) for row in pieces for begin, end in row]
        radius = LINK_RADIUS * float(sum(lengths))
        nodes = [self.scene.add_frame("/arm/base", show_axes=False)]
        for j in range(1, arm.joints + 1):
            nodes.append(self.scene.add_frame(f"/arm/joint{j}", show_axes=False))
            drum = f"/arm/joint{j}/drum"
            self.scene.add_cylinder(drum, 1.12 * radius, 2.5 * radius, rgb(ARM))
        for node, row in zip(nodes, pieces, strict=True):
            for k, ends in enumerate(row):
                rod(self.scene, f"{node.name}/link{k}", ends, radius, LINK)
        self.scene.add_cylinder(
            "/arm/base/foot", 1.6 * radius, 0.6 * radius, rgb(ARM), position=(0, 0, 0.3 * radius)
        )
        return nodes[1:]

    def _draw_hand(self) -> tuple[Any, list[Any]]:
        """The hand's body and its two pads; returns the moving node and the pads."""
        arm = self.throw.scene.arm
        tool: Tool | None = None if arm is None else arm.tool
        back, front, half = (
            FREE_HAND if tool is None else (tool.palm_back, tool.palm_front, tool.palm_half_width)
        )
        node = self.scene.add_frame("/hand", show_axes=False)
        size = (back - front, 2 * half, HAND_WIDTH)
        self.scene.add_box("/hand/body", rgb(ARM), size, position=(-(back + front) / 2, 0.0, 0.0))
        size = (front + PAD_AHEAD, PAD_WIDTH, PAD_THICKNESS)
        pads = [self.scene.add_box(f"/hand/pad{k}", rgb(PAD), dimensions=size) for k in (1, 2)]
        return node, pads

    def _draw_bar(self, name: str, colour: str, opacity: float | None) -> Any:
        """A box of the bar's length and width about the CoM's frame."""
        bar = self.throw.scene.object
        size = (bar.length, 2 * self.half_thickness, 2 * self.half_thickness)
        middle = (bar.length / 2 - bar.com, 0.0, 0.0)
        return self.scene.add_box(
            name, rgb(colour), size, position=middle, opacity=opacity, cast_shadow=opacity is None
        )

    def _draw_surroundings(self) -> None:
        """Floor, base column, target and cup."""
        scene, low = self.throw.scene, self.throw.extent()[0]
        workspace = scene.workspace
        floor = 0.0 if scene.arm is not None else float(low[1]) - 0.05
        if workspace is not None and workspace.floor is not None:
            floor = workspace.floor
        self.scene.add_grid(
            "/floor",
            6.0,
            6.0,
            cell_size=0.1,
            section_size=0.5,
            position=(0.0, 0.0, floor),
            shadow_opacity=0.0,
        )
        if workspace is not None and workspace.column_radius is not None:
            height = workspace.column_height or 0.0
            self.scene.add_cylinder(
                "/column",
                workspace.column_radius,
                height,
                rgb("#c9c2b8"),
                opacity=0.25,
                position=(0.0, 0.0, height / 2),
                cast_shadow=False,
            )
        ghost = self.scene.add_frame("/target", show_axes=False)
        _put(ghost, self.throw.target())
        self.scene.add_icosphere("/target/com", 0.008, rgb(GHOST))
        if self.throw.throw.target.theta is not None:
            self._draw_bar("/target/ghost", GHOST, 0.25)
        if scene.cup is not None:
            self._draw_cup(scene.cup)

    def _draw_cup(self, cup: Any) -> None:
        """A round cup: wall and bottom to look through, a solid rim."""
        middle = in_space(np.array(cup.x), np.array(cup.rim), self.throw.azimuth)
        for name, profile, opacity in (
            ("wall", cup_wall(cup.radius, cup.depth), 0.45),
            ("rim", ring(cup.radius, 1.5 * CUP_WALL), None),
        ):
            vertices, faces = turned_shape(profile)
            self.scene.add_mesh_simple(
                f"/cup/{name}",
                vertices,
                faces,
                color=rgb(CUP),
                opacity=opacity,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
                position=middle,
            )

    def _draw_path(self) -> None:
        """The CoM's path, coloured by phase, and the marks on it."""
        throw, line = self.throw, self.throw.line
        path = in_space(line.com[0], line.com[1], throw.azimuth)
        colours = np.array([rgb(COLOURS[name]) for name in PHASES], dtype=np.uint8)[line.phase]
        self.scene.add_line_segments(
            "/path",
            np.stack([path[:-1], path[1:]], axis=1),
            np.repeat(colours[1:, None], 2, axis=1),
            thickness=0.006,
        )
        for name, time in line.marks.items():
            at = path[throw.index(time)]
            down = np.array([0.0, 0.0, -LABEL_DROP[name]])
            self.scene.add_icosphere(f"/marks/{name}", 0.009, rgb(MARK), position=at)
            leader = np.array([[[0.0, 0.0, 0.0], down]])
            self.scene.add_line_segments(
                f"/marks/{name}/leader", leader, rgb(MARK), thickness=0.002
            )
            self.scene.add_label(f"/marks/{name}/text", name, anchor="center-left", position=down)

    def _aim_camera(self) -> None:
        """Looks across the plane, from a little above, so that the whole throw is seen."""
        low, high = self.throw.extent()
        if self.throw.joints is not None:
            low, high = np.minimum(low, [-0.1, 0.0]), np.maximum(high, [0.1, 0.0])
        size, middle = high - low, (high + low) / 2
        reach = max(size[1], size[0] / ASPECT) / 2 / math.tan(VIEW_ANGLE / 2)
        azimuth = self.throw.azimuth
        across = normal(azimuth) + in_space(np.array(0.25), np.array(0.3), azimuth)
        look_at = in_space(middle[0], middle[1], azimuth)
        camera = self.server.initial_camera
        camera.look_at = look_at
        camera.position = look_at + 1.3 * reach * across / np.linalg.norm(across)
        camera.up = (0.0, 0.0, 1.0)
        camera.fov = VIEW_ANGLE


def _put(node: Any, pose: Array) -> None:
    node.position = pose[:3, 3]
    node.wxyz = quaternion(pose[:3, :3])
