"""The way of a flying object into a bin, in space: between the walls and off the rim."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from . import shapes
from .motion import Array, Plane

if TYPE_CHECKING:
    from .clearance import Bar, Flight

#: Number of instants of the flight and of the way in, from detach until `BEYOND` [s] after landing.
INSTANTS, BEYOND = 4000, 0.3
#: Numbers of points on the rim, and along a capsule.
RIM, ALONG = 480, 41
#: Thickness [m] of the walls, and number of boxes in a round one.
THICK, BOXES = 0.005, 24
#: Edges of a bar by its eight corners: of one face, of the other, and between them.
EDGES = [(i, (i + 1) % 4) for i in range(4)]
EDGES += [(i + 4, j + 4) for i, j in EDGES] + [(i, i + 4) for i in range(4)]


@dataclass(frozen=True)
class BinWalls:
    """A scene's bin; a box is turned by its yaw from the throw's direction."""

    bin: Any
    plane: Plane

    def local(self, points: Array) -> Array:
        """Points (..., 3) of the base frame from the middle of the rim, along its length and width
        and up."""
        turn = self.plane.azimuth + (self.bin.yaw if self.bin.shape == "box" else 0.0)
        c, s = math.cos(turn), math.sin(turn)
        at = points - np.array([self.bin.x, self.bin.y, self.bin.rim])
        return np.stack(
            [c * at[..., 0] + s * at[..., 1], c * at[..., 1] - s * at[..., 0], at[..., 2]], -1
        )

    def room(self, points: Array) -> Array:
        """Distance (...) of local points from the nearest wall; below 0 outside."""
        if self.bin.shape == "round":
            return self.bin.radius - np.hypot(points[..., 0], points[..., 1])
        ends = self.bin.length / 2 - np.abs(points[..., 0])
        return np.minimum(ends, self.bin.width / 2 - np.abs(points[..., 1]))

    @property
    def rim(self) -> Array:
        """Local points (RIM, 3) on the rim."""
        share = np.linspace(0.0, 1.0, RIM, endpoint=False)
        if self.bin.shape == "round":
            turn = math.tau * share
            flat = self.bin.radius * np.column_stack([np.cos(turn), np.sin(turn)])
        else:
            half = np.array([self.bin.length, self.bin.width]) / 2
            corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]]) * half
            at = [np.interp(4 * share, range(5), column) for column in corners.T]
            flat = np.column_stack(at)
        return np.column_stack([flat, np.zeros(RIM)])

    def boxes(self) -> list[tuple[Array, Array, Array]]:
        """Centres, axes as rows and half lengths [m] of the wall's boxes, in the base frame."""
        found, deep = [], self.bin.depth / 2
        if self.bin.shape == "round":
            turns = [math.tau * k / BOXES for k in range(BOXES)]
            wide = (self.bin.radius + THICK) * math.tan(math.pi / BOXES)
            sides = [(turn, self.bin.radius, wide) for turn in turns]
        else:
            length, width = self.bin.length / 2, self.bin.width / 2
            sides = [(0.0, length, width), (math.pi, length, width)]
            sides += [(math.pi / 2, width, length), (-math.pi / 2, width, length)]
        yaw = self.plane.azimuth + (self.bin.yaw if self.bin.shape == "box" else 0.0)
        for turn, away, wide in sides:
            c, s = math.cos(turn + yaw), math.sin(turn + yaw)
            out = np.array([c, s, 0.0])
            middle = np.array([self.bin.x, self.bin.y, self.bin.rim - deep])
            axes = np.array([out, [-s, c, 0.0], [0.0, 0.0, 1.0]])
            half = np.array([THICK / 2, wide + THICK, deep])
            found.append((middle + (away + THICK / 2) * out, axes, half))
        return found


def way_in(walls: BinWalls, bar: Bar, flight: Flight) -> Array:
    """Instants (K,) [s] after detach from when the object last comes down to the rim until all of
    it is below or it touches the bottom; none for one that never is."""
    times, into = np.linspace(0.0, flight.duration + BEYOND, INSTANTS), walls.bin
    com = flight.at(times)
    lowest = bar.lowest(com) - into.rim
    over = (bar.highest(com) <= into.rim) | (lowest <= -into.depth)
    above = np.flatnonzero((lowest > 0.0) & (times <= flight.duration))
    after = above[-1] + 1 if above.size else 0
    # Where the target is above the rim it comes down later.
    while after < INSTANTS and lowest[after] > 0.0:
        after += 1
    ends = np.flatnonzero(over[after:])
    if not after or not ends.size:
        return np.zeros(0)
    return times[after : after + ends[0] + 1]


def clearance(scene: Any, plane: Plane, bar: Bar, flight: Flight) -> float:
    """Least distance [m] from walls and rim on the way in, below 0 outside; -inf for an object that
    does not come down through the rim."""
    walls = BinWalls(scene.bin, plane)
    com = flight.at(way_in(walls, bar, flight))
    if not len(com):
        return -math.inf
    found, rim = math.inf, walls.rim
    for axis, radius in bar.axes(com, plane) if bar.capsules else ():
        ends = [walls.local(end) for end in axis]
        along = ends[0] + np.linspace(0.0, 1.0, ALONG)[:, None, None] * (ends[1] - ends[0])
        room = walls.room(along) - radius
        found = min(found, room[along[..., 2] <= 0.0].min(initial=math.inf))
        away = shapes.to_segment(rim, ends[0][:, None], ends[1][:, None]) - radius
        found = min(found, float(away.min()))
    if bar.capsules:
        return found
    flat, left = bar.parts[0].placed(com), plane.ways[1]
    faces = [plane.points(flat[..., 0], flat[..., 1]) + side * bar.half * left for side in (-1, 1)]
    corners = walls.local(np.concatenate(faces, axis=1))
    below = corners[..., 2] <= 0.0
    found = walls.room(corners)[below].min(initial=math.inf)
    for i, j in EDGES:
        cut = below[:, i] != below[:, j]
        first, last = corners[cut, i], corners[cut, j]
        share = first[:, 2] / (first[:, 2] - last[:, 2])
        crossing = first + share[:, None] * (last - first)
        found = min(found, walls.room(crossing).min(initial=math.inf))
    # Points of the rim in the bar's own frame.
    origin = walls.local(plane.points(com[:, 0], com[:, 1]))
    turn = np.array([np.cos(com[:, 2]), np.sin(com[:, 2])])
    ahead = walls.local(plane.points(com[:, 0] + turn[0], com[:, 1] + turn[1])) - origin
    up = walls.local(plane.points(com[:, 0] - turn[1], com[:, 1] + turn[0])) - origin
    at = rim[None] - origin[:, None]
    along, across = (np.einsum("kmi,ki->km", at, way) for way in (ahead, up))
    aside = np.einsum("kmi,ki->km", at, np.cross(ahead, up))
    beyond = np.maximum(np.maximum(bar.first - along, along - bar.last), 0.0)
    off = [np.maximum(np.abs(part) - bar.half, 0.0) for part in (across, aside)]
    return float(min(found, np.sqrt(beyond**2 + off[0] ** 2 + off[1] ** 2).min()))
