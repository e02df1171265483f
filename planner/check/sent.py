"""A throw as it is sent."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ...problems import Pose, Scene
from .check import Thrown, limit_surface_throw
from .motion import PiecewiseMotion, SampledMotion
from .mover import Mover


@dataclass(frozen=True, repr=False)
class SentThrow:
    """The throw that goes to the robot.

    scene: aimed at the target (a cup comes along); motion: what counts, until `until` [s]:
    the samples for an arm, the planned motion for a hand; samples: at 1 kHz from rest to
    rest; opening_time [s] on their clock; final: by the model of the tolerance.
    """

    scene: Scene
    mover: Mover
    motion: PiecewiseMotion
    until: float
    samples: SampledMotion
    opening_time: float
    final: Thrown

    def __repr__(self) -> str:
        """A line: its arrays would fill a screen."""
        return f"SentThrow({self.scene.name}, landing at {self.landing_time:.3f} s)"

    @property
    def target(self) -> Pose:
        """Where it should land."""
        assert self.scene.target is not None
        return self.scene.target

    @cached_property
    def limit_surface(self) -> Thrown:
        """The same motion thrown by the time-stepping limit surface."""
        return limit_surface_throw(
            self.scene, self.mover, self.motion, self.opening_time, self.target.z
        )

    @property
    def detach_time(self) -> float:
        """When the grip force is zero [s]."""
        return self.opening_time + self.scene.gripper.profile().opening

    @property
    def command_time(self) -> float:
        """When the opening command is sent [s]."""
        return self.opening_time - self.scene.gripper.profile().dwell - self.scene.mean_delay

    @property
    def landing_time(self) -> float:
        """When the CoM comes down through the target's height [s]."""
        return self.detach_time + self.final.landing.flight_time
