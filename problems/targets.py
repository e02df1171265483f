"""Tolerance, landing bounds, cup, workspace, obstacles, choice among throws, the NLP's settings."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ..models import Flags
from ..models.release import DECIDING
from ..models.robot import Solid, about_z
from .checks import InputError
from .grip import Object
from .poses import Pose
from .section import UNSET, Section, optional, quantity


@dataclasses.dataclass(frozen=True)
class Tolerance(Section):
    """Accepted landing error.

    The NLP uses the sliding pivot with every model; a correction of its target makes the motion
    that is sent land by the deciding model. MuJoCo and the meshed patch agree with the limit
    surface.
    """

    position: float = quantity("m, largest error of an accepted landing", above=0, default=0.002)
    angle: float = quantity(
        "degrees, largest error of its angle", above=0, degrees=True, default=math.radians(0.5)
    )
    model: str = quantity(
        "release model that decides: the time-stepping limit surface or the sliding pivot",
        choices=DECIDING,
        default="ls-step",
    )

    def check(self) -> None:
        """The tolerance is at least twice the numerical error of the limit surface."""
        if self.model != "sp" and (self.position < 2e-4 or self.angle < math.radians(0.01)):
            raise InputError(
                f"position = {self.position:g}, angle_deg = {math.degrees(self.angle):.3g}: must "
                "be at least 0.0002 m and 0.01: landings by the limit surface are known no better; "
                "model = 'sp' may have less"
            )


@dataclasses.dataclass(frozen=True)
class Landing(Section):
    """Bounds on the speed and the turning rate at landing."""

    speed_min: float = quantity(
        "m/s, of the CoM at landing; below `speed_max`", least=0, default=0.0
    )
    speed_max: float | None = optional("m/s; left out: no bound", above=0)
    rate_max: float | None = optional(
        "rad/s, turning rate at landing either way; left out: no bound", above=0
    )

    def check(self) -> None:
        """speed_min below speed_max."""
        if self.speed_max is not None and self.speed_min >= self.speed_max:
            raise InputError(
                f"speed_min = {self.speed_min:g}: must be below speed_max = {self.speed_max:g}"
            )


@dataclasses.dataclass(frozen=True)
class Cup(Section):
    """A cup, open above, that the bar enters with its lower end first. Needs `theta_deg` in
    [target], which determines that end.
    """

    rim: float = quantity("m, height of the rim; moves with another target")
    radius: float = quantity(
        "m, inside; above half the bar's width, or the largest radius of an outline, the clearance "
        "and 1 mm",
        above=0,
    )
    depth: float = quantity("m, inside", above=0)
    x: float = quantity(
        "m, centre, in the throw's plane; moves with another target; left out: at the target's "
        "middle",
        default=UNSET,
    )
    clearance: float = quantity(
        "m, from the bar's outline to wall and rim, from when the lower end is in the rim plane "
        "until it is `insertion` below",
        least=0,
        default=0.0,
    )
    insertion: float = quantity("m; at most `depth`", above=0, default=0.05)

    #: What messages call it.
    KIND: ClassVar[str] = "cup"

    def check(self) -> None:
        """The insertion is at most the depth of the cup."""
        if self.insertion > self.depth:
            raise InputError(
                f"insertion = {self.insertion:g}: must be at most the depth {self.depth:g}"
            )

    @property
    def plane_x(self) -> float:
        """x [m] of the centre in the throw's plane."""
        return self.x

    @property
    def reach(self) -> float:
        """Distance [m] of the wall's farthest point from the centre."""
        return self.radius

    def half_opening(self) -> float:
        """Half its opening [m] in the throw's plane."""
        return self.radius

    def holds(self, along: Any, aside: Any) -> Flags:
        """Flags (...) of the points between the walls, along and to the left of the throw's plane
        [m]."""
        return np.asarray(np.hypot(along - self.x, aside) < self.radius)

    def radius_for(self, thing: Object) -> float:
        """Inner radius [m] where the object is.

        A bar is as thick as it is wide, so a round cup is narrower off its middle. Capsules are
        round, and nearest to it in the middle.
        """
        return self.radius if thing.outline else math.sqrt(self.radius**2 - (thing.width / 2) ** 2)

    def why_outside(self, off: float, depth: float, error: float) -> str:
        """Why an end is not in the cup: `off` [m] its middle, `depth` [m] below its rim, each to
        an `error` [m]; empty if it is."""
        if off > self.radius + error:
            return f"{off:.3g} m off its centre, radius {self.radius:g} m"
        if depth > self.depth + error:
            return f"{depth:.3g} m below its rim, depth {self.depth:g} m"
        return ""

    def why_missed(self, thing: Object, pose: tuple[float, float, float], error: float) -> str:
        """Why an object with its CoM at x, z [m], theta [rad], to an `error` [m], cannot have
        entered; empty if it can."""
        (x, z, theta), cos, sin = pose, math.cos(pose[2]), math.sin(pose[2])
        if thing.outline:
            # Only the place of the lowest end: the plan finds whether the rest fits.
            along, across, radius = thing.lowest_end(theta)
            depth = self.rim - (z + along * sin + across * cos - radius)
            off = abs(x + along * cos - across * sin - self.x)
            return self.why_outside(off, depth, error) if depth > 0.0 else ""
        along = min(-thing.com, thing.length - thing.com, key=lambda s: s * sin)
        x, z = x + along * cos, z + along * sin
        if z >= self.rim:
            return ""
        # From the lower end up to the rim plane, or to the other end.
        up = min((self.rim - z) / abs(sin), thing.length) if sin else thing.length
        mouth = x - math.copysign(up, along) * cos
        return self.why_outside(max(abs(x - self.x), abs(mouth - self.x)), self.rim - z, error)

    def check_target(self, target: Pose) -> None:
        """InputError if the target leaves open which end goes in."""
        if target.theta is None:
            raise InputError("[cup] needs a target with theta_deg, to know which end goes in")
        heights = [math.sin(target.theta + side * target.half_widths[1]) for side in (-1, 1)]
        # Products of two ends that are level are 0 but for rounding.
        if target.half_widths[1] > math.pi / 2 + 1e-9 or math.prod(heights) < -1e-9:
            words = "[cup] needs a target whose theta_deg keeps one end below, as [-110, -70] does"
            raise InputError(words)


@dataclasses.dataclass(frozen=True)
class Workspace(Section):
    """Bounds of the workspace. Heights and distances in m, in the throw's plane."""

    floor: float | None = optional(
        "m, lowest height of arm and hand, as their capsules, and of the held bar; left out: none"
    )
    column_radius: float | None = optional(
        "m, the robot's base, for the bar; with `column_height`", above=0
    )
    column_height: float | None = optional("m; with `column_radius`", above=0)
    palm_clearance: float | None = optional(
        "m, from the detached bar to the hand of an arm: to its palm, without one to those of its "
        "capsules that are farther than this from the object as gripped",
        least=0,
    )

    def check(self) -> None:
        """Both column values or none."""
        if (self.column_radius is None) != (self.column_height is None):
            raise InputError("column_radius and column_height: give both or neither")


@dataclasses.dataclass(frozen=True)
class Obstacle(Section):
    """Something that arm, held bar and flying bar keep clear of, in the base frame; each under a
    heading [[obstacle]]. Without [robot] the throw's plane is y = 0, and only the bar has a shape.

    The bar may land on it or next to it: in the last 0.05 s of the flight it may come as near as it
    lands.
    """

    name: str = quantity("for messages")
    kind: str = quantity("shape; a capsule stands upright", choices=("box", "sphere", "capsule"))
    size: tuple[float, ...] = quantity(
        "m; box: length, width, height along its x, y, z; sphere: radius; capsule: radius, and "
        "distance of the centres of its ends",
        above=0,
        most=100.0,
    )
    position: tuple[float, float, float] = quantity(
        "m, x, y, z of its centre", least=-100.0, most=100.0
    )
    yaw: float = quantity("degrees, rotation about z", degrees=True, default=0.0)
    pitch: float = quantity(
        "degrees, before that about its y axis; 90 lays a capsule along x",
        degrees=True,
        default=0.0,
    )
    clearance: float = quantity("m, from everything that moves", least=0, most=1.0, default=0.01)

    def check(self) -> None:
        """`size` has as many numbers as its kind requires; a sphere is not turned."""
        said, count = {
            "box": ("length, width and height", 3),
            "sphere": ("radius", 1),
            "capsule": ("radius, and distance of the centres of its ends", 2),
        }[self.kind]
        if len(self.size) != count:
            raise InputError(f"size = {list(self.size)}: of a {self.kind} it must be [{said}]")
        for key, angle in (("yaw_deg", self.yaw), ("pitch_deg", self.pitch)):
            if angle and self.kind == "sphere":
                raise InputError(f"{key} = {math.degrees(angle):g}: not of a sphere")

    @property
    def solid(self) -> Solid:
        """Its shape in the base frame."""
        cos, sin = math.cos(self.pitch), math.sin(self.pitch)
        tilt = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
        half, radius = np.array(self.size) / 2, 0.0
        if self.kind != "box":
            half, radius = np.zeros(3), self.size[0]
            half[2] = self.size[-1] / 2 if self.kind == "capsule" else 0.0
        return Solid(np.array(self.position), (about_z(self.yaw) @ tilt).T, half, radius)


@dataclasses.dataclass(frozen=True)
class Rest(Section):
    """Where the object is to come to rest after it has landed; needs MuJoCo.

    Exactly one of `in`, `on` and `within`. The contact's defaults are about a plastic cube's on
    wood: restitution 0.125, friction 0.18 (the parameters beside the 570 recorded tosses of
    ContactNets, Pfrommer, Halm and Posa, 2020), and up to what rougher pairs have.
    """

    in_: str | None = optional("the object is to rest inside", choices=("cup", "bin"))
    on: str | None = optional("name of the obstacle on whose top it is to rest")
    within: float | None = optional(
        "m, largest horizontal distance of the resting CoM from the target", above=0
    )
    at_least: float = quantity(
        "share of throws that are to rest there; fewer are a warning", above=0, most=1, default=0.9
    )
    restitution: tuple[float, float] = quantity(
        "lowest and highest: share of its speed with which the object leaves what it hits",
        least=0,
        most=0.9,
        default=(0.05, 0.25),
    )
    friction: tuple[float, float] = quantity(
        "lowest and highest μ between the object and what it hits",
        least=0,
        most=2,
        default=(0.15, 0.45),
    )
    floor: float | None = optional("m, height of the ground; left out: under cup or bin, else 0")

    def check(self) -> None:
        """One place, and ranges in order."""
        if sum(value is not None for value in (self.in_, self.on, self.within)) != 1:
            raise InputError("give exactly one of in, on and within")
        for name in ("restitution", "friction"):
            low, high = getattr(self, name)
            if low > high:
                raise InputError(f"{name} = [{low:g}, {high:g}]: the lowest comes first")

    def check_place(
        self, cup: Section | None, bin_: Section | None, obstacles: Sequence[Obstacle]
    ) -> None:
        """InputError for a place that a scene does not have."""
        if self.in_ is not None and {"cup": cup, "bin": bin_}[self.in_] is None:
            raise InputError(f"in = {self.in_!r}: the scene has no [{self.in_}]")
        named = {obstacle.name: obstacle for obstacle in obstacles}
        if self.on is not None and self.on not in named:
            known = f"; obstacles: {', '.join(named)}" if named else ": the scene has none"
            raise InputError(f"on = {self.on!r}: must name an [[obstacle]]{known}")
        if self.on is not None and sum(one.name == self.on for one in obstacles) > 1:
            raise InputError(f"on = {self.on!r}: several [[obstacle]]s have this name: must be one")
        if self.on is not None and (named[self.on].kind != "box" or named[self.on].pitch):
            raise InputError(f"on = {self.on!r}: must be a box without pitch_deg")

    @property
    def place(self) -> str:
        """The wanted place as text, after "rests"."""
        if self.within is not None:
            return f"within {1e3 * self.within:g} mm of the target"
        return f"in the {self.in_}" if self.in_ else f"on {self.on}"


@dataclasses.dataclass(frozen=True)
class Cost(Section):
    """What the optimisation makes small, all weighted and added: the time until the hand opens, the
    integrals over time of the squared accelerations and jerks of the joints (or of the hand), each
    as a share of its limit, and the load on the pads while they open. A throw in less time is
    nearer to the limits; one without load lands alike whatever delay, opening time and friction
    are."""

    time: float = quantity("1/s, of the time until the hand opens", least=0, most=1e4, default=2.0)
    acceleration: float = quantity("1/s", least=1e-3, most=1e4, default=10.0)
    jerk: float = quantity("1/s", least=1e-3, most=1e4, default=1.0)
    quiet: float = quantity(
        "(m/s^2)^-2, of the mean square load on the pads while they open and for the latest delay "
        "after that, 10 ms at least; 0 leaves it out",
        least=0,
        most=1e4,
        default=10.0,
    )

    @property
    def usual(self) -> bool:
        """Whether the costs of motion, all but `quiet`, are the defaults."""
        return self == Cost(quiet=self.quiet)


@dataclasses.dataclass(frozen=True)
class Nlp(Section):
    """Numerical settings of the NLP. The defaults were chosen by measurement; few scenes need this
    section.
    """

    carry: int = quantity("intervals from rest to the opening", least=3, most=60, default=6)
    opening: int = quantity("intervals of the opening", least=2, most=60, default=6)
    grading: float = quantity(
        "above 1 the opening's intervals shrink towards its end", least=1, most=4, default=2.0
    )
    epsilon: float = quantity(
        "relative rounding width of the friction laws", above=0, most=1, default=0.02
    )
    carry_max: float = quantity(
        "s, longest carry; above the gripper's dwell by 0.05 s", above=0, default=2.0
    )


@dataclasses.dataclass(frozen=True)
class Choice(Section):
    """The cheapest by [cost] of several throws; without it the first one found is taken."""

    among: int = quantity("number of different throws to compare", least=1, most=20, default=4)
