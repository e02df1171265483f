"""A throw: a motion, the time at which the pads open on it, and its release by the exact models.

Planned, sent, recorded and delayed motions are all throws of this type. Releases and landings are
computed when they are first read.
"""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ...core import Structure, array, library, out
from ...models import Array, FlightLaw, FlightState, HandSamples, HandTrack, Trajectory
from ...models.release import (
    MODELS,
    SLIDING_PIVOT,
    STEPPED_SURFACE,
    Release,
    ReleaseCase,
    ReleaseModel,
    exact_pivot_release,
    exact_surface_release,
    own_model,
)
from ...problems import InputError, Obstacle, Pose, Scene, checked
from .loads import load_steps
from .manipulator import EXACT_HAND, HandError, Manipulator
from .sent_samples import NO_SAMPLES, Samples

#: Exact releases by their models' names.
EXACT = {SLIDING_PIVOT: exact_pivot_release, STEPPED_SURFACE: exact_surface_release}


def release_model(scene: Scene, name: str) -> ReleaseModel:
    """The release model of a name, which may be that of a scene's own law."""
    own = scene.release is not None and name == scene.release.__name__
    return own_model(scene.release) if own and scene.release else MODELS[name]


@dataclass(frozen=True)
class LandingPoint:
    """Place and time at which the falling CoM passes a height; NaN if it never does.

    state: there; start: at detach, of the flight that ends there.
    """

    x: float
    z: float
    theta: float
    flight_time: float
    state: FlightState
    start: FlightState

    @classmethod
    def of(cls, release: Release, height: float, flight: FlightLaw) -> LandingPoint:
        """Flight of a release to `height` [m]."""
        time = library().flight_time(array(release.end, 6), height, flight.gravity)
        start = flight.calibrated(release.detach, time if time > 0.0 else math.inf)
        end = flight.after(start, time)
        z = height if math.isfinite(time) else math.nan
        return cls(end.x, z, end.theta, time, end, start)

    @property
    def pose(self) -> tuple[float, float, float]:
        """x, z [m], theta [rad]."""
        return self.x, self.z, self.theta


@dataclass(frozen=True, repr=False, eq=False)
class Throw:
    """A motion thrown to the height of its scene's target.

    scene: aimed at the target (a cup moves with it). path: the motion of the manipulator's
    coordinates that is judged, from rest at time 0: that of the samples, or a planned one up to
    detach. opening_time [s]: start of the grip force's fall. samples: what is sent, at 1 kHz from
    rest to rest; empty if nothing is. model: name of the release model in `EXACT`; empty for that
    of the scene's tolerance. error: of the hand against its motion. known_release: the `release`,
    if it is computed already.
    """

    scene: Scene
    manipulator: Manipulator
    path: Trajectory
    opening_time: float
    samples: Samples = NO_SAMPLES
    model: str = ""
    error: HandError = EXACT_HAND
    known_release: InitVar[Release | None] = None

    def __post_init__(self, known_release: Release | None) -> None:
        """Keep a known release; a copy with another motion, scene or model has none."""
        if known_release is not None:
            vars(self)["release"] = known_release

    @classmethod
    def sent(
        cls, scene: Scene, manipulator: Manipulator, samples: Samples, opening_time: float
    ) -> Throw:
        """The throw of a sent motion."""
        return cls(scene, manipulator, samples.path, opening_time, samples)

    def __repr__(self) -> str:
        """One line instead of the arrays."""
        return f"Throw({self.scene.name}, landing at {self.landing_time:.3f} s)"

    @property
    def target(self) -> Pose:
        """The target of the scene."""
        return self.scene.aim

    @cached_property
    def release(self) -> Release:
        """The object's motion from the opening's start to detach."""
        model = self.model or self.scene.deciding_model
        exact = EXACT.get(model) or release_model(self.scene, model).release
        return self._in_place(exact(self.case))

    def _in_place(self, released: Release) -> Release:
        """The release by a hand with `error`.

        Friction depends on relative motion only: the error moves the whole release.
        """
        error = self.error
        if not any(error):
            return released
        com, twist = released.com.copy(), released.com_twist.copy()
        com[0] += error.x + error.v_x * released.times
        com[1] += error.z + error.v_z * released.times
        twist[:2] += np.array([[error.v_x], [error.v_z]])
        return replace(released, com=com, com_twist=twist)

    def released(self, release: Release) -> Throw:
        """The throw with a known exact release of `case`."""
        return replace(self, known_release=self._in_place(release))

    @cached_property
    def onsets(self) -> tuple[float | None, float | None]:
        """Onsets [s] of pivot and slide after the opening's start; None without one."""
        if (self.model or self.scene.deciding_model) == STEPPED_SURFACE:
            return self.case.slip_onset()
        return self.release.pivot, self.release.slide

    @cached_property
    def landing(self) -> LandingPoint:
        """The landing at the target's height."""
        return LandingPoint.of(self.release, self.target.z, self.scene.flight)

    def __getstate__(self) -> dict[str, Any]:
        """The state without `load_steps`, which would come back writable."""
        return {name: value for name, value in vars(self).items() if name != "load_steps"}

    @cached_property
    def load_steps(self) -> Array:
        """Steps (n,) [N m] of the joints' load as the pads let go; for an arm with masses."""
        release = self.release
        return load_steps(self.scene, self.manipulator, self.path, self.opening_time, release)

    def miss(self, target: Pose | None = None) -> tuple[float, float]:
        """Landing error (Δx [m], Δtheta [rad]), see `Pose.miss`."""
        return (target or self.target).miss(self.landing.x, self.landing.theta)

    def with_model(self, model: str) -> Throw:
        """The throw by another of the models sp and ls-step; InputError for a further one."""
        if model not in (*EXACT, self.scene.deciding_model):
            raise InputError(f"model = {model!r}: must be one of {', '.join(EXACT)}")
        own = self.model or self.scene.deciding_model
        return self if own == model else replace(self, model=model)

    @cached_property
    def deciding(self) -> Throw:
        """The throw by the model of the tolerance, which decides."""
        return self.with_model(self.scene.deciding_model)

    @cached_property
    def sliding_pivot(self) -> Throw:
        """The throw by the sliding pivot."""
        return self.with_model(SLIDING_PIVOT)

    @cached_property
    def limit_surface(self) -> Throw:
        """The throw by the time-stepping limit surface."""
        return self.with_model(STEPPED_SURFACE)

    def in_scene(self, scene: Scene) -> Throw:
        """The motion in another scene."""
        return replace(self, scene=scene)

    def among(self, obstacles: tuple[Obstacle, ...]) -> Throw:
        """The throw with these obstacles around in place of its scene's; its release stays."""
        scene = self.scene.changed(obstacle=obstacles)
        return replace(self, scene=scene, known_release=self.release)

    def delayed(self, delay: float) -> Throw:
        """The throw opened later by `delay` [s], at time 0 at the earliest."""
        checked("delay", delay, float, {})
        return replace(self, opening_time=max(self.opening_time + delay, 0.0))

    @property
    def case(self) -> ReleaseCase:
        """The arguments of a release model."""
        hand = self.manipulator.hand(self.path.shifted(self.opening_time), self.error.omega)
        return case_of(self.scene, hand, self.error.theta)

    def hand(self, times: npt.ArrayLike) -> HandSamples:
        """The hand at `times` (K,) [s] on the motion's clock."""
        return self.manipulator.hand(self.path).at(np.asarray(times, float))

    def flight(self, times: Array) -> Array:
        """CoM poses (3, N) at `times` (N,) [s] after detach."""
        return self.scene.flight.after(self.landing.start, np.asarray(times, float)).pose

    @property
    def lands(self) -> bool:
        """Whether the object falls to the target's height."""
        return math.isfinite(self.landing.flight_time)

    @property
    def detach_time(self) -> float:
        """Time [s] at which the grip force is zero."""
        return self.opening_time + self.scene.gripper.profile().opening

    @property
    def command_time(self) -> float:
        """Time [s] at which the opening command is sent."""
        return self.opening_time - self.scene.gripper.profile().dwell - self.scene.mean_delay

    @property
    def landing_time(self) -> float:
        """Time [s] at which the falling CoM passes the target's height."""
        return self.detach_time + self.landing.flight_time


def column_of(scene: Scene) -> tuple[float, float] | None:
    """Half width [m] of the base column's section in the bar's plane, and its height [m].

    None without a column, and for an arm that throws beside it.
    """
    radius, height = scene.bounds.column_radius, scene.bounds.column_height
    if radius is None or height is None:
        return None
    lateral = 0.0 if scene.target is None else abs(scene.target.lateral)
    beside = max(lateral - scene.object.width / 2, 0.0)
    return None if beside >= radius else (math.sqrt(radius**2 - beside**2), height)


def core_scene(scene: Scene) -> Structure:
    """The scene's data for measures by the compiled core."""
    bar, cup, arm = scene.object, scene.cup, scene.arm
    column, room = column_of(scene), scene.palm_clearance
    found = {
        "gravity": scene.gravity,
        "behind": bar.com,
        "length": bar.length,
        "half_width": bar.width / 2,
        "cup_speed": 0.0 if scene.target is None else scene.target.speed,
        # A negative value marks an absent part of the scene.
        "column_radius": -1.0,
        "palm_half_width": -1.0,
        "palm_clearance": -1.0 if arm is None or room is None else room,
        "tool_length": -1.0,
        "cup_radius": -1.0,
        "bin_depth": -1.0,
    }
    if bar.outline:
        parts = len(bar.outline)
        found |= {"parts": parts, "outline": array(bar.capsules, parts, 5)}
    if column is not None:
        found["column_radius"], found["column_height"] = column
    if arm is not None:
        tool = arm.tool
        found["palm_back"], found["palm_front"] = tool.palm_back, tool.palm_front
        found["palm_half_width"] = tool.palm_half_width
        if scene.tool_speed is not None:
            found["tool_length"] = tool.tcp
    if cup is not None:
        found |= {"cup_x": cup.x, "cup_rim": cup.rim, "cup_insertion": cup.insertion}
        found["cup_radius"] = cup.radius_for(bar)
    if scene.bin is not None:
        found |= {"cup_x": scene.bin.plane_x, "cup_rim": scene.bin.rim}
        found |= {"bin_depth": scene.bin.depth, "bin_lead": scene.bin.clearance}
        found["cup_radius"] = scene.bin.half_opening(bar)
    return Structure("scene", **found)


def cup_entries(scene: Scene, detach: Array, flight: Array) -> Array:
    """Least clearance (N,) [m] of the bars' way into the scene's cup or bin; -inf for a missed one.

    detach (N, 6): CoM pose and twist; flight (N,) [s]: time to the landing height. The way in
    begins as the lower end passes the rim plane and ends `insertion` below it; the clearance is
    the least distance between outline and wall or rim, negative outside. The bar's thickness
    equals its width, so the walls of a round cup are nearer than `radius` off the middle.
    """
    n, found = len(detach), np.empty(len(detach))
    states = array(np.ascontiguousarray(detach), n, 6)
    times = array(np.ascontiguousarray(flight, float), n)
    library().cup_entries(core_scene(scene), n, states, times, out(found, n))
    return found if scene.bin is None else scene.bin.distance(scene.object, found)


def case_of(scene: Scene, hand: HandTrack, hand_error: float = 0.0) -> ReleaseCase:
    """The scene's release along a hand motion, counted from the opening's start.

    hand_error [rad]: of the hand's angle; as the pads are round, it adds to the grasp angle.
    """
    angle, grip = scene.grasp.angle + hand_error, scene.gripper.profile()
    return ReleaseCase(scene.body, scene.patch, grip, hand, scene.gravity, angle)
