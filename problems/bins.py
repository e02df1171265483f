"""A bin: a box or a round one, open above, into which the whole object falls at any angle."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

import numpy as np

from ..models import Flags
from .checks import InputError
from .grip import Object
from .poses import Pose, Region, ThrowPlane
from .section import UNSET, Section, optional, quantity
from .targets import Obstacle

#: Thickness [m] of the walls.
WALL = 0.005
#: Number of plates in a round wall.
PLATES = 8
#: Room [m] that an upright object has beyond the clearance, at least.
SPARE = 0.001
#: Component of a wall's normal along the throw's plane up to which the wall is parallel to it.
PARALLEL = 1e-9
#: Largest distance [m] of the bin's centre from the plane of the throw to a [target].
BESIDE = 1e-3


@dataclasses.dataclass(frozen=True)
class Bin(Section):
    """A bin with upright walls, open above, that the whole object falls into, at any angle. Left
    out [target]: every landing at the rim's height for which the object passes between the walls.
    The bin moves with another target; its walls are obstacles for arm, hand and object.
    """

    shape: str = quantity("of its inside, seen from above", choices=("box", "round"))
    rim: float = quantity("m, height of the rim", least=-100, most=100, unit="m")
    depth: float = quantity("m, inside", above=0, most=100, unit="m")
    x: float = quantity("m, its centre, base frame", least=-100, most=100, unit="m")
    y: float = quantity("m; only with [robot]", least=-100, most=100, default=0.0, unit="m")
    length: float | None = optional(
        "m, inside, along the throw for `yaw_deg` 0; of a box", above=0, most=100, unit="m"
    )
    width: float | None = optional("m, inside, across that; of a box", above=0, most=100, unit="m")
    radius: float | None = optional("m, inside; of a round bin", above=0, most=100, unit="m")
    yaw: float = quantity(
        "degrees, of a box, turned to the left from the throw's direction",
        degrees=True,
        default=0.0,
    )
    clearance: float = quantity(
        "m, from the object to wall and rim, from when its lowest point reaches the rim until all "
        "of it is below, or it reaches the bottom; from arm, hand and held object to the walls",
        least=0,
        most=1.0,
        default=0.005,
    )
    #: x [m] of the centre in the throw's plane, from the scene; no key of files.
    plane_x: float = UNSET
    #: What messages call it.
    KIND: ClassVar[str] = "bin"

    def check(self) -> None:
        """A box has length and width, a round bin a radius."""
        own = {"box": ("length", "width"), "round": ("radius",)}
        for shape, names in own.items():
            for name in names:
                value = getattr(self, name)
                if self.shape == shape and value is None:
                    raise InputError(f"key '{name}' is missing: needed with shape = {shape!r}")
                if self.shape != shape and value is not None:
                    raise InputError(f"{name} = {value:g}: only with shape = {shape!r}")
        if self.shape == "round" and self.yaw:
            raise InputError(f"yaw_deg = {math.degrees(self.yaw):g}: only with shape = 'box'")

    @property
    def _walls(self) -> list[tuple[str, float, float, float]]:
        """Of each pair of a box's walls: its key, half their distance [m], and the components of
        their normal along and across the throw's plane, neither below 0."""
        assert self.length is not None and self.width is not None
        cos, sin = abs(math.cos(self.yaw)), abs(math.sin(self.yaw))
        return [("length", self.length / 2, cos, sin), ("width", self.width / 2, sin, cos)]

    @property
    def reach(self) -> float:
        """Distance [m] of the walls' farthest point from the centre."""
        if self.radius is not None:
            return self.radius
        assert self.length is not None and self.width is not None
        return math.hypot(self.length, self.width) / 2

    def half_opening(self, thing: Object | None = None, clearance: float = 0.0) -> float:
        """Half the length [m], along the throw's plane, in which all of an object must be that
        keeps the clearance [m] to the walls; of the opening in that plane without an object.

        A bar is as thick as it is wide, so it is nearer to walls that are not across the plane.
        """
        if self.radius is not None:
            half = 0.0 if thing is None or thing.outline else thing.width / 2
            return math.sqrt(max((self.radius - clearance) ** 2 - half**2, 0.0))
        reaches = (
            (half - _beside(thing, along, across) - clearance) / along
            for _, half, along, across in self._walls
            if along > PARALLEL
        )
        return max(min(reaches), 0.0)

    def distance(self, thing: Object, room: Any) -> Any:
        """Least distance [m] from the walls of an object whose parts in the bin end `room` [m], a
        number or an array, before `half_opening`; negative outside."""
        # As it is at most: a throw without an object in the bin has infinite room.
        out = np.maximum(self.half_opening(thing) - np.asarray(room, float), 0.0)
        if self.radius is not None:
            half = 0.0 if thing.outline else thing.width / 2
            return self.radius - np.hypot(out, half)
        nearest = np.full_like(out, math.inf)
        for _, half, along, across in self._walls:
            gap = half - _beside(thing, along, across)
            nearest = np.minimum(nearest, gap - along * out if along > PARALLEL else gap)
        return nearest

    def best_room(self, thing: Object) -> float:
        """Room [m] from which on a box's walls along the throw are the nearest: more of it adds
        nothing to `distance`."""
        half = self.half_opening(thing)
        if self.radius is not None:
            return half
        walls = [(half - _beside(thing, *turned), turned[0]) for _, half, *turned in self._walls]
        nearest = min(gap for gap, _ in walls)
        return half - min((gap - nearest) / along for gap, along in walls if along > PARALLEL)

    def check_fits(self, thing: Object) -> None:
        """InputError if not even an upright object has its clearance to the walls."""
        if self.radius is not None:
            need, what = thing.least_cup(self.clearance + SPARE)
            self._refuse("radius", self.radius, need, what)
            return
        most = max((part.radius for part in thing.outline), default=thing.width / 2)
        what = "the largest radius of the outline" if thing.outline else "the bar's width"
        for key, half, along, across in self._walls:
            beside = _beside(thing, along, across)
            need = 2 * (beside + along * (most + SPARE) + self.clearance)
            self._refuse(key, 2 * half, need, what)

    def _refuse(self, key: str, value: float, need: float, what: str) -> None:
        if value <= need:
            raise InputError(
                f"{key} = {value:g}: must be above {need:.4g}, for {what}, the clearance and 1 mm"
            )

    def target(self, thing: Object) -> Region:
        """Landings at the rim's height, at any angle, at which the object may pass it."""
        half = self.half_opening(thing, self.clearance)
        return Region(x=self.x, y=self.y, z=self.rim, half_widths=(half, 0.0))

    def placed(self, plane: ThrowPlane) -> Bin:
        """The bin as a throw's plane sees it; InputError if its centre is not in the plane."""
        cos, sin = math.cos(plane.azimuth), math.sin(plane.azimuth)
        aside = self.y * cos - self.x * sin - plane.lateral
        if abs(aside) > BESIDE:
            raise InputError(
                f"x = {self.x:g}, y = {self.y:g}: {1e3 * abs(aside):.0f} mm beside the throw's "
                "plane, that of [target]: must be in it"
            )
        return self.changed(plane_x=self.x * cos + self.y * sin)

    def moved(self, along: float, up: float, plane: ThrowPlane) -> Bin:
        """The bin with its centre at `along` [m] in a plane, and `up` [m] higher."""
        x, y, _ = map(float, plane.points(along, 0.0))
        return self.changed(x=x, y=y, plane_x=along, rim=self.rim + up)

    def check_target(self, target: Pose) -> None:
        """InputError if a landing at the target's height cannot be in the bin."""
        if target.velocity is not None:
            raise InputError("[target] velocity: not with [bin], whose walls stand still")
        if target.z < self.rim - self.depth:
            raise InputError(
                f"[bin] rim = {self.rim:g}: the [target] z = {target.z:g} is below its bottom at "
                f"{self.rim - self.depth:.4g}"
            )
        off = abs(target.miss(self.plane_x, 0.0)[0])
        if target.z <= self.rim and off > self.half_opening():
            raise InputError(
                f"[bin] x = {self.x:g}: the [target] is {off:.3g} m off its centre, outside"
            )

    def holds(self, along: Any, aside: Any) -> Flags:
        """Flags (...) of the points between the walls, along and to the left of the throw's plane
        [m] from its base axis."""
        along = np.asarray(along) - self.plane_x
        if self.radius is not None:
            return np.asarray(np.hypot(along, aside) < self.radius)
        assert self.length is not None and self.width is not None
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        near = np.abs(along * cos + aside * sin) < self.length / 2
        return np.asarray(near & (np.abs(aside * cos - along * sin) < self.width / 2))

    def plates(self, azimuth: float) -> tuple[Obstacle, ...]:
        """The walls as obstacles; azimuth [rad]: of the throw's plane."""
        cos_sin = math.cos(azimuth), math.sin(azimuth)
        if self.radius is not None:
            turns = [2 * math.pi * k / PLATES for k in range(PLATES)]
            wide = 2 * (self.radius + WALL) * math.tan(math.pi / PLATES)
            sides = [(turn, self.radius, wide) for turn in turns]
        else:
            assert self.length is not None and self.width is not None
            ends, flanks = self.width + 2 * WALL, self.length + 2 * WALL
            sides = [(side * math.pi, self.length / 2, ends) for side in (0, 1)]
            sides += [((side + 0.5) * math.pi, self.width / 2, flanks) for side in (0, 1)]
        found = list[Obstacle]()
        for turn, away, wide in sides:
            yaw = self.yaw + turn
            along, aside = ((away + WALL / 2) * part for part in (math.cos(yaw), math.sin(yaw)))
            cos, sin = cos_sin
            found.append(
                Obstacle(
                    name="bin wall",
                    kind="box",
                    size=(WALL, wide, self.depth),
                    position=(
                        self.x + along * cos - aside * sin,
                        self.y + along * sin + aside * cos,
                        self.rim - self.depth / 2,
                    ),
                    yaw=azimuth + yaw,
                    clearance=self.clearance,
                )
            )
        return tuple(found)


def _beside(thing: Object | None, along: float, across: float) -> float:
    """How far [m] an object reaches towards a wall beyond its outline in the throw's plane, along
    which the wall's normal has the component `along`; of an outline the largest radius counts."""
    if thing is None:
        return 0.0
    if thing.outline:
        return (1.0 - along) * max(part.radius for part in thing.outline)
    return across * thing.width / 2
