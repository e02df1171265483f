"""Where the object should land, and how near to that is near enough."""

from __future__ import annotations

import dataclasses
import math

from .errors import InputError
from .section import Section, quantity


@dataclasses.dataclass(frozen=True)
class Pose(Section):
    """A landing pose of the object's CoM.

    x, y, z [m]; theta [rad, unwrapped], None leaves it open. For a hand scene x is in
    the throw's plane and y is 0; for an arm x, y, z are in the base frame.
    """

    x: float = quantity(least=-1e4, most=1e4)
    z: float = quantity(least=-1e4, most=1e4)
    theta: float | None = quantity(degrees=True, least=-1e4, most=1e4, default=None)
    y: float = quantity(least=-1e4, most=1e4, default=0.0)

    def check(self) -> None:
        """All values finite."""

    @property
    def azimuth(self) -> float:
        """Angle [rad] about the base axis of the vertical plane through the pose."""
        return math.atan2(self.y, self.x) if self.y != 0.0 else 0.0

    @property
    def plane_x(self) -> float:
        """x [m] in that plane."""
        return math.hypot(self.x, self.y) if self.y != 0.0 else self.x

    def in_plane(self, x: float, theta: float | None) -> Pose:
        """The pose at `x` [m] and `theta` [rad] in the same plane and at the same height."""
        turn = self.azimuth
        return dataclasses.replace(self, x=x * math.cos(turn), y=x * math.sin(turn), theta=theta)

    def distance(self, other: Pose, lever: float) -> float:
        """Scaled distance [m] in the throw's plane: |dx| + |dz| + |dtheta| `lever` [m] (39).

        theta counts where both fix it.
        """
        turn = 0.0 if self.theta is None or other.theta is None else self.theta - other.theta
        return abs(self.plane_x - other.plane_x) + abs(self.z - other.z) + abs(turn) * lever

    def turned(self, angle: float) -> Pose:
        """The same pose with theta, if fixed, `angle` [rad] further."""
        return dataclasses.replace(self, theta=None if self.theta is None else self.theta + angle)


@dataclasses.dataclass(frozen=True)
class Tolerance(Section):
    """Accepted landing error.

    position [m], angle [rad]. model: the release model that the landing must be true for, on
    what is sent: 'sp' (the sliding pivot) or 'ls-step' (the limit surface, which throws as a
    meshed patch does). The NLP has the sliding pivot either way; its aim is corrected.
    """

    position: float = quantity(above=0, default=0.002)
    angle: float = quantity(above=0, degrees=True, default=math.radians(0.5))
    model: str = quantity(choices=("sp", "ls-step"), default="sp")


@dataclasses.dataclass(frozen=True)
class Landing(Section):
    """Bounds at landing: speed [m/s] of the CoM and turning rate [rad/s]."""

    speed_min: float = quantity(least=0, default=0.0)
    speed_max: float | None = quantity(above=0, default=None)
    rate_max: float | None = quantity(above=0, default=None)

    def check(self) -> None:
        """speed_min below speed_max."""
        if self.speed_max is not None and self.speed_min >= self.speed_max:
            raise InputError(
                f"speed_min = {self.speed_min:g}: must be below speed_max = {self.speed_max:g}"
            )
