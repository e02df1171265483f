"""A throw: a motion, when the pads open on it, and what the exact models make of it.

The same type for what the NLP planned, what is sent, what was read back and what a delay
scatters. Releases and landings are computed when they are first read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ...models import (
    SLIDING_PIVOT,
    STEPPED_SURFACE,
    Array,
    FlightState,
    HandSamples,
    HandTrack,
    Path,
    Release,
    ReleaseCase,
    exact_pivot_release,
    exact_surface_release,
    slip_onset,
    time_to_height,
)
from ...problems import Pose, Scene
from .measures import Measured, grip_use, measured
from .mover import Mover
from .sending import NO_SAMPLES, TICK, Samples
from .torques import Torques, torques_of

#: A throw that counts falls so fast [m/s] at least through the target's height. Nearer to the top
#: of its flight some micrometres of the release are millimetres of the landing.
FALLS = 0.02
#: Exact release models by their names: the paper's, and the time-stepping limit surface.
EXACT = {SLIDING_PIVOT: exact_pivot_release, STEPPED_SURFACE: exact_surface_release}


@dataclass(frozen=True)
class LandingPoint:
    """Where and when the CoM comes down through a height; NaN if it never does."""

    x: float
    z: float
    theta: float
    flight_time: float
    state: FlightState

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, z [m], theta [rad]."""
        return self.x, self.z, self.theta


@dataclass(frozen=True, repr=False, eq=False)
class Throw:
    """A motion thrown to the height of its scene's target.

    scene: aimed at the target (a cup comes along). path: the motion that counts, of the
    mover's coordinates from rest at time 0: the samples' for an arm, the planned one, up to
    detach, for a free hand. opening_time [s]: when the grip force starts to fall. samples:
    what is sent, at 1 kHz from rest to rest; empty where nothing is. model: whose release it
    is, of `EXACT`; empty for the one that the scene's tolerance names.
    """

    scene: Scene
    mover: Mover
    path: Path
    opening_time: float
    samples: Samples = NO_SAMPLES
    model: str = ""

    @classmethod
    def sent(
        cls, scene: Scene, mover: Mover, planned: Path, samples: Samples, opening_time: float
    ) -> Throw:
        """The throw that goes to the robot."""
        counts = planned if scene.robot is None else samples.path
        return cls(scene, mover, counts, opening_time, samples)

    def __repr__(self) -> str:
        """A line: its arrays would fill a screen."""
        return f"Throw({self.scene.name}, landing at {self.landing_time:.3f} s)"

    @property
    def target(self) -> Pose:
        """Where it should land."""
        assert self.scene.target is not None
        return self.scene.target

    # What it comes to.

    @cached_property
    def release(self) -> Release:
        """The object from the opening's start until the pads have let go."""
        return EXACT[self.model or self.scene.tolerance.model](self.case)

    @cached_property
    def onsets(self) -> tuple[float | None, float | None]:
        """When pivot and slide begin [s] from the opening's start; None for what does not."""
        if (self.model or self.scene.tolerance.model) == STEPPED_SURFACE:
            return slip_onset(self.case)
        return self.release.pivot, self.release.slide

    @cached_property
    def landing(self) -> LandingPoint:
        """The flight of that to the target's height."""
        return landing(self.release, self.target.z, self.scene.gravity)

    @cached_property
    def grip_use(self) -> float:
        """Largest friction use (ellipsoid, 1 is the limit) from rest to the opening's start."""
        return grip_use(self.scene, self.mover, self.path, self.opening_time)

    @cached_property
    def measured(self) -> Measured:
        """How near bar, hand and arm come to what is around them."""
        release, flight = self.release, self.landing.flight_time
        return measured(self.scene, self.mover, self.path, self.opening_time, release, flight)

    @cached_property
    def torques(self) -> Torques:
        """Of the arm's joints along it; for an arm with masses."""
        return torques_of(self.scene, self.mover, self.path, self.opening_time)

    def miss(self, target: Pose | None = None) -> tuple[float, float]:
        """(Δx [m], Δtheta [rad]) to the target; 0 where it leaves theta open."""
        target = target or self.target
        angle = 0.0 if target.theta is None else self.landing.theta - target.theta
        return self.landing.x - target.plane_x, angle

    # The same motion otherwise.

    def by(self, model: str) -> Throw:
        """Thrown by another of the `EXACT` models."""
        own = self.model or self.scene.tolerance.model
        return self if own == model else replace(self, model=model)

    @cached_property
    def final(self) -> Throw:
        """Thrown by the model of the tolerance."""
        return self.by(self.scene.tolerance.model)

    @cached_property
    def sliding_pivot(self) -> Throw:
        """Thrown by the sliding pivot."""
        return self.by(SLIDING_PIVOT)

    @cached_property
    def limit_surface(self) -> Throw:
        """Thrown by the time-stepping limit surface."""
        return self.by(STEPPED_SURFACE)

    def delayed(self, delay: float) -> Throw:
        """Opened so much later [s], at rest at the earliest."""
        return replace(self, opening_time=max(self.opening_time + delay, 0.0))

    # The hand, and when what happens.

    @property
    def case(self) -> ReleaseCase:
        """What a release model needs of it."""
        return case_of(self.scene, self.mover.hand(self.path.later(self.opening_time)))

    def hand(self, times: npt.ArrayLike) -> HandSamples:
        """The hand at `times` (K,) [s] on the motion's clock."""
        return self.mover.hand(self.path).at(times)

    @property
    def until(self) -> float:
        """When the motion that counts ends [s]: detach for a free hand, rest for an arm."""
        return self.path.end

    @cached_property
    def to_rest(self) -> Path:
        """The whole motion: of a free hand its brake too, which only the samples have."""
        samples = self.samples
        if not len(samples.q) or self.path is samples.path:
            return self.path
        planned, end = self.path, self.path.end
        first = min(math.ceil(end / TICK - 1e-9), len(samples.q) - 1)
        # From detach to the next sample at the even rate of the brake.
        before, ddq = end - TICK * first, samples.ddq[first]
        dq = samples.dq[first] + before * ddq
        q = samples.q[first] + before * (dq + samples.dq[first]) / 2
        step = Path.cubics(np.array([end, TICK * first]), *(v[None] for v in (q, dq, ddq, 0 * q)))
        between = [step] if before < -1e-12 else []
        return Path.joined([planned, *between, samples.path.beginning(first)])

    # The flight.

    def flight(self, times: Array) -> Array:
        """CoM poses (3, N) at `times` (N,) [s] after detach."""
        state = self.release.detach.after(times, self.scene.gravity)
        return np.array([state.x, state.z, state.theta])

    @property
    def lands(self) -> bool:
        """Whether the object comes down to the target's height."""
        return math.isfinite(self.landing.flight_time)

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
        return self.detach_time + self.landing.flight_time


def case_of(scene: Scene, hand: HandTrack) -> ReleaseCase:
    """The scene's release along a hand motion, counted from the opening's start."""
    grip, angle = scene.gripper.profile(), scene.grasp.angle
    return ReleaseCase(scene.body, scene.patch, grip, hand, scene.gravity, angle)


def landing(release: Release, height: float, gravity: float) -> LandingPoint:
    """Flight of a release to `height` [m]."""
    time = time_to_height(release.detach, height, gravity)
    end = release.detach.after(time, gravity)
    return LandingPoint(end.x, height if math.isfinite(time) else math.nan, end.theta, time, end)
