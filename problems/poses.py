"""Targets: landing poses and regions of them, at rest or moving, and the plane of a throw."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from ..models import Array
from ..models.robot import Solid
from .checks import InputError
from .section import Section, optional, quantity

#: Full turns of an angle from which messages say that Python takes radians.
MANY_TURNS = 3


@dataclasses.dataclass(frozen=True)
class ThrowPlane:
    """The vertical plane of a throw, in the base frame.

    azimuth [rad]: turned about the base's z axis; lateral [m]: beside that axis, to the left.
    """

    azimuth: float
    lateral: float

    @property
    def normal(self) -> Array:
        """Unit vector to the right of the throw; x in the plane, z up and it are left-handed."""
        return np.array([math.sin(self.azimuth), -math.cos(self.azimuth), 0.0])

    def points(self, x: Array | float, z: Array | float, aside: Array | float = 0.0) -> Array:
        """Points (..., 3) [m] at x and z in the plane, `aside` to its left."""
        cos, sin, sideways = math.cos(self.azimuth), math.sin(self.azimuth), self.lateral + aside
        return np.stack(
            np.broadcast_arrays(x * cos - sideways * sin, x * sin + sideways * cos, z), axis=-1
        )

    def poses(self, pose: Array) -> Array:
        """4x4 poses (N, 4, 4) of those in the plane (3, N): x at angle theta, z its normal."""
        cos, sin, here = np.cos(pose[2]), np.sin(pose[2]), ThrowPlane(self.azimuth, 0.0)
        poses = np.zeros((pose.shape[1], 4, 4))
        poses[:, :3, 0], poses[:, :3, 1] = here.points(cos, sin), here.points(-sin, cos)
        poses[:, :3, 2], poses[:, :3, 3] = self.normal, self.points(pose[0], pose[1])
        poses[:, 3, 3] = 1.0
        return poses

    def seen(self, solid: Solid) -> Solid:
        """A solid of the base frame as the plane sees it: x along it, y to its left."""
        turned = solid.turned(-self.azimuth)
        return dataclasses.replace(turned, centre=turned.centre - [0.0, self.lateral, 0.0])


@dataclasses.dataclass(frozen=True)
class Pose(Section):
    """A landing pose of the object's CoM. Required with [hand] and [robot]; `--target` replaces
    it. With [motion] only its height matters: that of the landing.

    theta is unwrapped; None leaves it open. For a hand scene x is in the throw's plane and y
    is 0; for an arm x, y, z are in the base frame.
    """

    x: float = quantity(
        "m, of the CoM; with [robot] in the base frame, else in the throw's plane; [lowest, "
        "highest]: any place between, along the throw's plane",
        least=-100,
        most=100,
        unit="m",
        range=100.0,
    )
    z: float = quantity("m, the CoM falls through this height", least=-100, most=100, unit="m")
    theta: float | None = optional(
        "degrees, from the grasped end to the CoM, full turns count; [lowest, highest]: any angle "
        "between, less than a turn apart; left out: any",
        degrees=True,
        least=-1e4,
        most=1e4,
        range=2 * math.pi,
    )
    y: float = quantity("m, base frame; only with [robot]", least=-100, most=100, default=0.0)
    velocity: tuple[float] | None = optional(
        "m/s, along x in the throw's plane, of a moving target and its cup; the pose is that at "
        "the start of the motion; left out: at rest",
        least=-5.0,
        most=5.0,
    )
    arrival: float | tuple[float, float] | None = optional(
        "s from the start of the motion: landing time, to 1 ms, or the "
        "earliest and the latest; left out: any time",
        above=0,
        most=60.0,
    )
    #: Distance [m] of the throw's plane from the base's z axis, from the arm; no key of files.
    lateral: float = 0.0
    #: Time [s] after the start of the motion at which a moving target has this pose; no key of
    #: files.
    since: float = 0.0

    #: What messages call it.
    DESCRIBED: ClassVar[str] = "a Pose or a Region, or an array of x, z [m] and theta [rad]"

    @classmethod
    def from_array(cls, values: Array) -> Pose:
        """The pose of an array x, z [m], theta [rad].

        ValueError for an array of another length or of other than finite numbers, and for an angle
        of so many turns that it may be in degrees.
        """
        x, z, theta = _finite(values)
        if _has_many_turns(theta):
            raise ValueError
        return Pose(x, z, theta)

    def check(self) -> None:
        """Ranges are a `Region`'s; the earliest arrival is not after the latest."""
        for key, value in (("x", self.x), ("theta", self.theta)):
            if isinstance(value, tuple):
                raise InputError(f"{key} = {list(value)}: a Pose has one number, a Region a range")
        earliest, latest = self.window
        if earliest > latest:
            raise InputError(f"arrival = [{earliest:g}, {latest:g}]: the earliest comes first")

    @property
    def window(self) -> tuple[float, float]:
        """The earliest and the latest time [s] of the landing."""
        if self.arrival is None:
            return 0.0, math.inf
        return self.arrival if isinstance(self.arrival, tuple) else (self.arrival, self.arrival)

    @property
    def is_fixed(self) -> bool:
        """Whether the target has no velocity and no time of arrival."""
        return self.velocity is None and self.arrival is None

    @property
    def half_widths(self) -> tuple[float, float]:
        """Half the widths of a `Region` about its middle: x [m], theta [rad]; 0 for a pose."""
        return 0.0, 0.0

    @property
    def is_region(self) -> bool:
        """Whether x or theta is a range."""
        return any(self.half_widths)

    @property
    def middle(self) -> Pose:
        """The pose itself, of a region the one in its middle."""
        return self

    @property
    def kind(self) -> tuple[bool, ...]:
        """Key of its kind of NLP: whether theta is fixed, a latest time is given, the target
        moves, x and theta are ranges."""
        x, theta = self.half_widths
        latest, moves = math.isfinite(self.window[1]), self.velocity is not None
        return self.theta is not None, latest, moves, x > 0.0, theta > 0.0

    @property
    def speed(self) -> float:
        """Rate of x in the throw's plane [m/s]."""
        return 0.0 if self.velocity is None else self.velocity[0]

    def at(self, time: float) -> Pose:
        """The pose of the target `time` [s] after the start of the motion.

        InputError if it has crossed the arm's base axis from an azimuth other than 0.
        """
        if self.velocity is None:
            return self
        x = self.plane_x + self.speed * (time - self.since)
        if self.y and x * self.plane_x <= 0.0:
            raise InputError("target: it moves past the base's z axis; with y = 0 it may")
        return self._moved(x, self.theta).changed(since=time)

    def with_lateral(self, lateral: float) -> Pose:
        """The pose for an arm with its plane beside its axis; InputError if no plane contains
        it."""
        if abs(lateral) >= abs(self.away) and lateral:
            raise InputError(
                f"target: is {abs(self.away):.3g} m from the base's z axis, must be above "
                f"{abs(lateral):.3g} m, for the throw's plane is as far beside it"
            )
        return self if lateral == self.lateral else self.changed(lateral=lateral)

    @property
    def words(self) -> str:
        """The pose as text."""
        (x, turn), theta = self.half_widths, "free"
        if self.theta is not None:
            theta = f"{_words(math.degrees(self.theta), math.degrees(turn), 1)} deg"
        aside = f", y {self.y:.3f} m" if abs(self.y) >= 5e-4 else ""
        words = f"x {_words(self.x, x, 3)} m{aside}, z {self.z:.3f} m, theta {theta}"
        if self.velocity is not None:
            words += f" at {self.since:.3f} s, moving at {self.speed:g} m/s"
        if self.arrival is not None:
            earliest, latest = self.window
            until = "" if latest == earliest else f" to {latest:g}"
            words += f", landing at {earliest:g}{until} s"
        return words

    @property
    def angle_hint(self) -> str:
        """What messages add for an angle that may be in degrees; empty for others."""
        if self.theta is None or not _has_many_turns(self.theta):
            return ""
        turns = self.theta / (2 * math.pi)
        return f"; theta {self.theta:g} rad is {turns:.1f} turns: Pose takes radians"

    @property
    def away(self) -> float:
        """Distance [m] from the base's z axis; below zero on the plane x-z behind it."""
        return math.hypot(self.x, self.y) if self.y != 0.0 else self.x

    @property
    def plane(self) -> ThrowPlane:
        """The vertical plane through the pose."""
        turn = math.atan2(self.y, self.x) if self.y != 0.0 else 0.0
        beside = math.asin(self.lateral / self.away) if self.lateral else 0.0
        return ThrowPlane(turn - beside, self.lateral)

    @property
    def table(self) -> dict[str, Any]:
        """The pose as JSON, with velocity and arrival if given; ranges as [lowest, highest]."""
        x, theta = self.in_file("x"), self.in_file("theta")
        pose = {"x": x, "y": self.y, "z": self.z, "theta": theta}
        given = {"velocity": self.velocity, "arrival": self.arrival}
        listed = {k: list(v) if isinstance(v, tuple) else v for k, v in given.items()}
        return pose | {key: value for key, value in listed.items() if value is not None}

    @property
    def plane_x(self) -> float:
        """x [m] in that plane."""
        if not self.lateral:
            return self.away
        return math.copysign(math.sqrt(self.away**2 - self.lateral**2), self.away)

    def in_plane(self, x: float, theta: float | None) -> Pose:
        """The pose at `x` [m] and `theta` [rad] in the same plane and at the same height."""
        return self.middle._moved(x, theta)

    def _moved(self, x: float, theta: float | None) -> Self:
        """This with its middle at `x` [m] and `theta` [rad]."""
        x, y, _ = map(float, self.plane.points(x, self.z))
        return self.changed(x=x, y=y, theta=None if theta is None else float(theta))

    def miss(self, x: Any, theta: Any) -> tuple[Any, Any]:
        """A landing less the target's nearest pose: dx [m], dtheta [rad] (0 with theta open).

        x [m], theta [rad]: in the throw's plane, floats or arrays (N,).
        """
        return x - self.plane_x, x - x if self.theta is None else theta - self.theta

    def nearest(self, x: float, theta: float) -> Pose:
        """The target's pose nearest to a landing at `x` [m], `theta` [rad]."""
        return self

    def grid(self, count: int) -> Array:
        """x [m] and theta [rad], 0 where open, (2, N) of a target's poses: `count` along each
        range, in the throw's plane."""
        middle, shares = (self.plane_x, self.theta or 0.0), np.linspace(-1.0, 1.0, count)
        ranges = [
            m + half * (shares if half else np.zeros(1))
            for m, half in zip(middle, self.half_widths, strict=True)
        ]
        return np.array(np.meshgrid(*ranges)).reshape(2, -1)

    def distance(self, other: Pose, lever: float) -> float:
        """Pose distance [m] in the throw's plane: |dx| + |dz| + |dtheta| `lever` [m] (39).

        theta counts if both fix it.
        """
        turn = 0.0 if self.theta is None or other.theta is None else self.theta - other.theta
        return abs(self.plane_x - other.plane_x) + abs(self.z - other.z) + abs(turn) * lever

    def shifted(self, dx: float, dtheta: float) -> Pose:
        """The pose moved by `dx` [m] in its plane, and by `dtheta` [rad] if theta is fixed."""
        return self._moved(self.plane_x + float(dx), self.turned(dtheta).theta)

    def turned(self, angle: float) -> Pose:
        """The pose with theta increased by `angle` [rad], if fixed."""
        return self if self.theta is None else self.changed(theta=float(self.theta + angle))


@dataclasses.dataclass(frozen=True)
class Region(Pose):
    """Landing poses between bounds: ``Region(x=(1.28, 1.42), z=0.1, theta=(-1.9, -1.2))``.

    x, theta or both are (lowest, highest), full turns counted. Afterwards `x` and `theta` are
    those of the middle, about which a place is measured along the throw's plane. A landing between
    the bounds has no error; that of another is its distance from the nearest bound. A cup stays
    where it is for all poses of a region; it moves with the middle of another target.
    """

    half_widths: tuple[float, float] = (0.0, 0.0)

    if TYPE_CHECKING:

        def __init__(
            self,
            x: float | tuple[float, float],
            z: float,
            theta: float | tuple[float, float] | None = None,
            y: float = 0.0,
            velocity: tuple[float] | None = None,
            arrival: float | tuple[float, float] | None = None,
            lateral: float = 0.0,
            since: float = 0.0,
            half_widths: tuple[float, float] = (0.0, 0.0),
        ) -> None: ...

    def check(self) -> None:
        """Takes ranges apart into middles and half widths."""
        half_widths = list(self.half_widths)
        for i, name in enumerate(("x", "theta")):
            value: Any = getattr(self, name)
            if isinstance(value, tuple):
                low, high = value
                object.__setattr__(self, name, (low + high) / 2)
                half_widths[i] = (high - low) / 2
        object.__setattr__(self, "half_widths", tuple(half_widths))
        super().check()

    def in_file(self, name: str) -> Any:
        """A range as (lowest, highest), where there is one."""
        value = getattr(self, name)
        half = dict(zip(("x", "theta"), self.half_widths, strict=True)).get(name, 0.0)
        # 15 digits are without the rounding errors of middle and half width.
        return [float(f"{value + side * half:.15g}") for side in (-1, 1)] if half else value

    @property
    def middle(self) -> Pose:
        """The pose in the middle."""
        return Pose(**{field.name: getattr(self, field.name) for field in dataclasses.fields(Pose)})

    def miss(self, x: Any, theta: Any) -> tuple[Any, Any]:
        """See `Pose.miss`; 0 between the bounds."""
        off, (half_x, half_theta) = super().miss(x, theta), self.half_widths
        dx, dtheta = np.clip(off[0], -half_x, half_x), np.clip(off[1], -half_theta, half_theta)
        return off[0] - dx, off[1] - dtheta

    def nearest(self, x: float, theta: float) -> Pose:
        """The target's pose nearest to a landing at `x` [m], `theta` [rad]."""
        dx, dtheta = self.miss(x, theta)
        return self.in_plane(x - dx, None if self.theta is None else theta - dtheta)


def _finite(values: Array) -> list[float]:
    """The three numbers of an array (3,); ValueError for others."""
    if values.shape != (3,) or values.dtype.kind not in "iuf" or not np.isfinite(values).all():
        raise ValueError
    return [float(value) for value in values]


def _words(middle: float, half_width: float, digits: int) -> str:
    """A number, or the ends of a range, as text."""
    if not half_width:
        return f"{middle:.{digits}f}"
    return f"{middle - half_width:.{digits}f} to {middle + half_width:.{digits}f}"


def _has_many_turns(theta: float) -> bool:
    """Whether an angle [rad] is one of many turns, as degrees taken for radians are."""
    return abs(theta) > MANY_TURNS * 2 * math.pi
