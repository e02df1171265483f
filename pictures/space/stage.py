"""The 3-D view of a throw: its viser scene; the object as triangles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from ...models import Array, Indices
from ...problems import Arm, Bin, DHRow, covered_mesh, obstacles_besides_bins, placement
from ..style import ARM, BLACK, PHASES
from .motion import SpaceMotion, SpaceThrow

if TYPE_CHECKING:
    from ...problems import Object, Pose


#: Colour of links.
LINK = "#7c8899"
#: Colour of a cup or bin.
CUP = "#b5713c"
#: Colour of pads.
PAD = "#20242b"


#: Direction from which several throws are seen: from the right, in front and above.
SEEN_FROM = (0.45, -1.0, 0.6)
#: Distance of the camera then, as a factor of the one at which all CoMs just fit.
MARGIN = 1.2


@dataclass(frozen=True)
class ViewShapes:
    """Drawn sizes [m] of bodies whose real shapes a scene does not have.

    link_radius: of links, as a share of the arm's length. hand_width: along the pads' motion.
    pad_ahead, pad_width, pad_thickness: of a pad, the first from its centre to its end. pad_speed
    [m/s], pad_travel: of a pad after detach. free_hand: body of a free hand behind the pads (from,
    to, half width). rim: thickness of a cup's rim. min_half: least half thickness of a bar.
    mark_step: distance of the marks' names, as a share of the throw's extent. faded: opacity of a
    throw that does not lead to the target.
    """

    link_radius: float = 0.032
    hand_width: float = 0.16
    pad_ahead: float = 0.01
    pad_width: float = 0.02
    pad_thickness: float = 0.012
    pad_speed: float = 0.1
    pad_travel: float = 0.03
    free_hand: tuple[float, float, float] = (0.12, 0.045, 0.03)
    rim: float = 0.006
    min_half: float = 0.004
    mark_step: float = 0.05
    faded: float = 0.25


SHAPES = ViewShapes()


def link_pieces(arm: Arm) -> list[list[tuple[Array, Array]]]:
    """Straight pieces (begin, end) [m] that show the links: of the base, then of each joint.

    Each is in the frame of its joint. A Denavit-Hartenberg row goes along its a, then its d.
    """
    pieces_of, zero = list[list[tuple[Array, Array]]](), np.zeros(3)
    for joint in arm.chain:
        end = np.array(ca.evalf(joint.placed()))[:3, 3]
        corner = np.array([joint.a, 0.0, 0.0]) if isinstance(joint, DHRow) else zero
        pieces_of.append([(zero, corner), (corner, end)])
    mount = np.array(ca.evalf(placement(arm.tool.xyz, arm.tool.rpy)))
    flange = mount[:3, 3] + arm.tool.flange * mount[:3, 2]
    pieces_of.append([(zero, mount[:3, 3]), (mount[:3, 3], flange)])
    return [[p for p in pieces if np.linalg.norm(p[1] - p[0]) > 1e-6] for pieces in pieces_of]


class ObjectView:
    """What a throw moves and where to, in a viser server: bar, target, cup, path of the CoM.

    root: name in front of those of its nodes. with_target: whether target and cup are drawn.
    """

    def __init__(
        self, server: Any, throw: SpaceThrow, root: str = "", with_target: bool = True
    ) -> None:
        self.server, self.throw, self.scene, self.root = server, throw, server.scene, root
        thickness = throw.scene.object.thickness_at(throw.scene.grasp.offset)
        self.half_thickness = max(thickness / 2, SHAPES.min_half)
        self.faded, self._bodies = False, list[Any]()
        if with_target:
            self._draw_target()
        self.bar = self.scene.add_frame(f"{root}/bar", show_axes=False)
        self.box = self._body(self.add_bar(f"{root}/bar/box", PHASES["carry"], None))
        radius = 0.55 * self.half_thickness + 0.004
        for side in (-1, 1):
            name, at = f"{root}/bar/com{side}", (0.0, 0.0, side * self.half_thickness)
            self._body(self.scene.add_icosphere(name, radius, rgb(BLACK), position=at))

    def aim(self, target: Pose) -> None:
        """Moves target and cup to a target pose."""
        self.place(self.target, target)
        into, plane = self.throw.scene.aimed_at(target).opening, target.plane
        if into is not None:
            self.cup.position = plane.points(into.plane_x, into.rim)
            self.cup.wxyz = (math.cos(plane.azimuth / 2), 0.0, 0.0, math.sin(plane.azimuth / 2))

    def place(self, node: Any, target: Pose) -> None:
        """Moves a node to a target pose."""
        put(node, self.throw.target(target))

    def _body(self, node: Any) -> Any:
        """Keeps a shape that moves with the throw, to fade it; returns it."""
        self._bodies.append(node)
        return node

    def add_bar(self, name: str, colour: str, opacity: float | None) -> Any:
        """A box of the bar's length and width about the CoM's frame; a mesh, or an outline."""
        bar, cast = self.throw.scene.object, opacity is None
        if bar.outline:
            look = {"color": rgb(colour), "opacity": opacity, "cast_shadow": cast}
            return self.scene.add_mesh_simple(name, *object_mesh(bar), **look)
        size = (bar.length, 2 * self.half_thickness, 2 * self.half_thickness)
        place = {"position": (bar.length / 2 - bar.com, 0.0, 0.0), "opacity": opacity}
        return self.scene.add_box(name, rgb(colour), size, cast_shadow=cast, **place)

    def _draw_target(self) -> None:
        """The target pose, and a cup or bin: wall and bottom to look through, a solid rim."""
        from trimesh.creation import box, revolve

        self.target = self.scene.add_frame(f"{self.root}/target", show_axes=False)
        self.scene.add_icosphere(f"{self.root}/target/com", 0.008, rgb(BLACK))
        if self.throw.throw.target.theta is not None:
            self.add_bar(f"{self.root}/target/ghost", BLACK, 0.25)
        into = self.throw.scene.opening
        if into is None:
            return
        self.cup = self.scene.add_frame(f"{self.root}/cup", show_axes=False)
        look = {"color": rgb(CUP), "side": "double", "cast_shadow": False, "receive_shadow": False}
        if isinstance(into, Bin) and into.radius is None:
            for number, plate in enumerate(into.changed(x=0.0, y=0.0, rim=0.0).plates(0.0)):
                pose = np.eye(4)
                pose[:3, :3], pose[:3, 3] = plate.solid.axes.T, plate.solid.centre
                mesh, look["opacity"] = box(2 * plate.solid.half, pose), 0.6
                self.scene.add_mesh_simple(
                    f"{self.root}/cup/wall{number}", mesh.vertices, mesh.faces, **look
                )
            return
        # Profiles that are turned about z.
        reach, deep = into.reach, into.depth
        wall = np.array([[0.0, -deep], [reach, -deep], [reach, 0.0]])
        angle, half = np.linspace(0.0, 2 * np.pi, 13), SHAPES.rim / 2
        ring = np.column_stack([reach + half * (1 + np.cos(angle)), half * np.sin(angle)])
        for name, profile, opacity in (("wall", wall, 0.45), ("rim", ring, None)):
            mesh, look["opacity"] = revolve(profile, sections=48), opacity
            self.scene.add_mesh_simple(f"{self.root}/cup/{name}", mesh.vertices, mesh.faces, **look)

    def draw_path(self) -> None:
        """The CoM's path, coloured by phase, and the marks on it."""
        throw, line = self.throw, self.throw.line
        path = throw.plane.points(line.com[0], line.com[1])
        palette = np.array([rgb(colour) for colour in PHASES.values()])
        if self.faded:
            palette = 255 - (SHAPES.faded * (255 - palette)).astype(int)
        colours = palette.astype(np.uint8)[line.phase]
        pieces = np.stack([path[:-1], path[1:]], axis=1)
        colours = np.repeat(colours[1:, None], 2, axis=1)
        self.scene.add_line_segments(f"{self.root}/path", pieces, colours, thickness=0.006)


class View(ObjectView):
    """A motion in a viser server; its first object is the view's own.

    `show` moves all bodies to a time, `change` takes another motion of the scene, `fade` shows its
    first throw pale. floor [m]: height of the floor.
    """

    def __init__(self, server: Any, motion: SpaceMotion) -> None:
        super().__init__(server, motion.throws[0])
        self.floor, self.objects = math.inf, list[ObjectView]([self])
        self._draw_surroundings(motion)
        self.joints = self._draw_arm()
        self.hand, self.pads = self._draw_hand()
        drawn = [(self.throw.throw.target, self.throw.scene.opening)]
        for number, throw in enumerate(motion.throws[1:], start=2):
            # A bin is drawn once.
            target = throw.throw.target, throw.scene.opening
            one = ObjectView(server, throw, f"/object{number}", target not in drawn)
            if target not in drawn:
                one.aim(throw.throw.target)
            drawn.append(target)
            self.objects.append(one)
        self.motion = motion
        self._aim_camera()
        self.change(motion)

    def change(self, motion: SpaceMotion) -> None:
        """Shows another motion of these objects, hand and arm, from its start."""
        self.motion, self.throw = motion, motion.throws[0]
        with self.server.atomic():
            self.aim(self.throw.throw.target)
            self._draw_floor()
            for one in self.objects:
                one.draw_path()
            if motion.is_single:
                self._draw_marks()
            self.show(0.0)

    def fade(self, faded: bool) -> None:
        """Shows the throw pale, as one that does not lead to the target, or as usual."""
        if faded == self.faded:
            return
        self.faded = faded
        with self.server.atomic():
            for body in self._bodies:
                body.opacity = SHAPES.faded if faded else None
            self.draw_path()

    def show(self, time: float) -> int:
        """Moves everything to `time` [s]; returns the instant's index."""
        motion = self.motion
        i = motion.index(time)
        with self.server.atomic():
            for frame, pose in zip(self.joints, motion.joints[i], strict=True):
                put(frame, pose)
            put(self.hand, motion.hand[i])
            for number, one in enumerate(self.objects):
                put(one.bar, motion.bars[number][i])
                one.box.color = rgb(PHASES[motion.object_phase(number, i)])
            self._open_pads(motion.since_detach(i))
        return i

    def _open_pads(self, since: float) -> None:
        """Moves the pads to where they are `since` [s] after detach; below 0 they hold the bar."""
        gap = self.half_thickness + min(SHAPES.pad_travel, SHAPES.pad_speed * max(0.0, since))
        for side, pad in zip((-1, 1), self.pads, strict=True):
            middle = SHAPES.pad_ahead - pad.dimensions[0] / 2
            pad.position = (middle, 0.0, side * (gap + SHAPES.pad_thickness / 2))

    def _draw_arm(self) -> list[Any]:
        """The arm's links and joints; returns the nodes that move with each joint."""
        arm, scene = self.throw.scene.arm, self.scene
        if arm is None:
            return []
        pieces = link_pieces(arm)
        radius = SHAPES.link_radius * sum(
            float(np.linalg.norm(b - a)) for row in pieces for a, b in row
        )
        foot = (0.0, 0.0, 0.3 * radius)
        nodes = [scene.add_frame("/arm/base", show_axes=False)]
        size = 1.6 * radius, 0.6 * radius
        self._body(scene.add_cylinder("/arm/base/foot", *size, rgb(ARM), position=foot))
        for j in range(1, arm.joints + 1):
            nodes.append(scene.add_frame(f"/arm/joint{j}", show_axes=False))
            size = 1.12 * radius, 2.5 * radius
            self._body(scene.add_cylinder(f"/arm/joint{j}/drum", *size, rgb(ARM)))
        for node, row in zip(nodes, pieces, strict=True):
            for k, ends in enumerate(row):
                self._draw_rod(f"{node.name}/link{k}", ends, radius)
        return nodes[1:]

    def _draw_rod(self, name: str, ends: tuple[Array, Array], radius: float) -> None:
        """A link between two points of the frame that `name` lies in, round at its end."""
        begin, end = ends
        length = float(np.linalg.norm(end - begin))
        x, y, z = (end - begin) / length
        # The quaternion that turns the cylinder's z axis to the link, half a turn if it is -z.
        turn = np.array([1.0 + z, -y, x, 0.0]) if z > -1.0 else np.array([0.0, 1.0, 0.0, 0.0])
        place = {"wxyz": turn / np.linalg.norm(turn), "position": (begin + end) / 2}
        look = {"subdivisions": 3, "position": end}
        self._body(self.scene.add_cylinder(f"{name}/rod", radius, length, rgb(LINK), **place))
        self._body(self.scene.add_icosphere(f"{name}/end", radius, rgb(LINK), **look))

    def _draw_hand(self) -> tuple[Any, list[Any]]:
        """The hand's body and its two pads; returns the moving node and the pads."""
        arm = self.throw.scene.arm
        back, front, half = SHAPES.free_hand
        if arm is not None:
            tool = arm.tool
            back, front, half = tool.palm_back, tool.palm_front, tool.palm_half_width
        node = self.scene.add_frame("/hand", show_axes=False)
        size = (back - front, 2 * half, SHAPES.hand_width)
        at = (-(back + front) / 2, 0.0, 0.0)
        self._body(self.scene.add_box("/hand/body", rgb(ARM), size, position=at))
        size = (front + SHAPES.pad_ahead, SHAPES.pad_width, SHAPES.pad_thickness)
        pads = [self.scene.add_box(f"/hand/pad{k}", rgb(PAD), dimensions=size) for k in (1, 2)]
        return node, [self._body(pad) for pad in pads]

    def _draw_surroundings(self, motion: SpaceMotion) -> None:
        """Base column and obstacles."""
        from trimesh.creation import box, capsule

        scene = self.throw.scene
        radius, height = scene.bounds.column_radius, scene.bounds.column_height
        if radius is not None and height is not None:
            glass: dict[str, Any] = {"opacity": 0.25, "cast_shadow": False}
            at = (0.0, 0.0, height / 2)
            self.scene.add_cylinder("/column", radius, height, rgb("#c9c2b8"), position=at, **glass)
        throws = [throw.scene for throw in motion.throws]
        for number, obstacle in enumerate(obstacles_besides_bins(throws)):
            solid, pose = obstacle.solid, np.eye(4)
            pose[:3, :3], pose[:3, 3] = solid.axes.T, solid.centre
            # A box, or a ball that is as long as a capsule.
            if solid.half.all():
                mesh = box(2 * solid.half, pose)
            else:
                mesh = capsule(2 * solid.half[2], solid.radius, transform=pose)
            name, colour = f"/obstacle{number}", rgb("#d9b8a6")
            self.scene.add_mesh_simple(name, mesh.vertices, mesh.faces, color=colour, opacity=0.8)
            top = (*solid.centre[:2], float(mesh.vertices[:, 2].max()))
            self.scene.add_label(f"{name}/text", obstacle.name, anchor="center-left", position=top)

    def _draw_floor(self) -> None:
        """The floor: the scene's, or below all that is shown, where an arm may stand on it."""
        scene, lowest = self.throw.scene, float(self.throw.extent()[0][1])
        floor = 0.0 if scene.arm is not None and lowest >= 0.0 else lowest - 0.05
        if scene.bounds.floor is not None:
            floor = scene.bounds.floor
        # It does not rise again: it would move with every target.
        if floor < self.floor:
            self.floor = floor
            look = {"cell_size": 0.1, "section_size": 0.5, "shadow_opacity": 0.0}
            self.scene.add_grid("/floor", 6.0, 6.0, position=(0.0, 0.0, floor), **look)

    def _draw_marks(self) -> None:
        """The marks on the path, with their names."""
        throw, line = self.throw, self.throw.line
        path = throw.plane.points(line.com[0], line.com[1])
        places = {name: path[line.index(time)] for name, time in line.marks.items()}
        # The names at the release stand one below the other: the marks are close together.
        release, (low, high) = ("detach", "opening", "command"), throw.extent()
        step = SHAPES.mark_step * float((high - low).max())
        top = min(places[name][2] for name in release)
        heights = {name: top - k * step for k, name in enumerate(release, start=1)}
        for name, at in places.items():
            mark, down = f"/marks/{name}", np.array([0.0, 0.0, heights.get(name, at[2]) - at[2]])
            leader = np.array([[np.zeros(3), down]])
            self.scene.add_icosphere(mark, 0.009, rgb(BLACK), position=at)
            self.scene.add_line_segments(f"{mark}/leader", leader, rgb(BLACK), thickness=0.002)
            self.scene.add_label(f"{mark}/text", name, anchor="center-left", position=down)

    def _aim_camera(self) -> None:
        """Looks across the plane of a single throw from slightly above, or at all that moves; it
        fits the view of 40 degrees."""
        camera = self.server.initial_camera
        camera.fov = math.radians(40.0)
        if not self.motion.is_single:
            moving = [bar[:, :3, 3] for bar in self.motion.bars]
            links = self.motion.joints[..., :3, 3].reshape(-1, 3)
            points = np.vstack([*moving, links, np.zeros((1, 3))])
            low, high = points.min(axis=0), points.max(axis=0)
            away = MARGIN * np.linalg.norm(high - low) / 2 / math.tan(camera.fov / 2)
            camera.look_at = (low + high) / 2
            towards = np.array(SEEN_FROM) / np.linalg.norm(SEEN_FROM)
            camera.position, camera.up = camera.look_at + away * towards, (0.0, 0.0, 1.0)
            return
        low, high = self.throw.extent()
        size, middle, plane = high - low, (high + low) / 2, self.throw.plane
        reach = max(size[1], size[0] / 1.15) / 2 / math.tan(camera.fov / 2)
        across = plane.points(0.25, 0.3) - plane.points(0.0, 0.0) + plane.normal
        camera.look_at = plane.points(middle[0], middle[1])
        camera.position = camera.look_at + 1.3 * reach * across / np.linalg.norm(across)
        camera.up = (0.0, 0.0, 1.0)


def rgb(colour: str) -> tuple[int, int, int]:
    """A colour '#rrggbb' as three numbers to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def put(node: Any, pose: Array) -> None:
    """Moves a node to a 4x4 pose."""
    from scipy.spatial.transform import Rotation

    node.position = pose[:3, 3]
    node.wxyz = Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True)


def object_mesh(thrown: Object) -> tuple[Array, Indices]:
    """Vertices (N, 3) [m] and faces (F, 3) of an object's mesh, or without one of its outline.

    In the frame of its CoM that pictures use: along the axis, up, and to its right.
    """
    if thrown.mesh is not None:
        points = covered_mesh(thrown).reshape(-1, 3)
    else:
        points = np.concatenate([_capsule(row) for row in thrown.capsules])
    points = points - [thrown.com, 0.0, 0.0]
    return points[:, [0, 2, 1]] * [1.0, 1.0, -1.0], np.arange(len(points)).reshape(-1, 3)


def _capsule(row: Array) -> Array:
    """Corners (3 F, 3) of the triangles of a capsule of an outline."""
    from trimesh.creation import icosphere

    ball = icosphere(2, row[4])
    begin, end = (np.insert(row[i : i + 2], 1, 0.0) for i in (0, 2))
    # The half of a ball towards either end: stretched between them.
    ahead = ball.vertices @ (end - begin) >= 0.0
    return np.asarray((ball.vertices + np.where(ahead[:, None], end, begin))[ball.faces.ravel()])
