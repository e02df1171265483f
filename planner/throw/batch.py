"""One motion thrown with other parameters: N throws at once, or one of them by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from ...models import Array, Body, FlightState, ReadOnly, Trajectory
from ...models.release import (
    LOST,
    STEPPED_SURFACE,
    BatchRelease,
    ReleaseBatch,
    exact_releases,
    track_length,
)
from ...problems import Pose, Scene
from .manipulator import HandError
from .throw import EXACT, Throw, release_model

#: Longest cell [s] of the hand's tabulated motion.
CELL = 1e-4
#: Names of the hand's errors, in the order of `HandError`.
HAND = ("hand_x", "hand_z", "hand_theta", "hand_vx", "hand_vz", "hand_omega")


@dataclass(frozen=True)
class BatchFlights(ReadOnly):
    """N flights of one motion's throws, each array (N, ...).

    columns: the parameters by name, SI units. late [s]: delay of the opening after the planned one;
    opened, freed [s]: times on the motion's clock at which the force starts to fall and is zero.
    com_offset [m], grasp_angle [rad]: of the held body, with the hand's error; com [m]: from the
    bar's end; error (N, 6): of the hand. release: by the model; start (N, 6): state at detach;
    landing (N, 3): x [m], theta [rad] and flight time [s] at the target's height, NaN without one;
    way [m]: of a moving target between the throw's own landing and this one.
    """

    columns: dict[str, Array]
    late: Array
    opened: Array
    freed: Array
    com_offset: Array
    grasp_angle: Array
    com: Array
    error: Array
    release: BatchRelease
    start: Array
    landing: Array
    way: Array

    @property
    def pose(self) -> Array:
        """`landing` relative to a target that moves."""
        moved = np.zeros_like(self.landing)
        moved[:, 0] = self.way
        return self.landing - moved


@dataclass(frozen=True)
class ThrowBatch:
    """Throws a motion with other values of the parameters `names`, by `model`.

    throw: with the scene's own values, by the deciding model, its scene aimed at the target's pose
    at the landing; target: the plan's, which may move. hands: the hand's motion, with time 0 at the
    planned opening; reach [s]: the earliest and the latest opening on that clock, and its longest
    duration.
    """

    throw: Throw
    target: Pose
    model: str
    names: tuple[str, ...]
    hands: Trajectory
    reach: tuple[float, float, float]

    @classmethod
    def of(
        cls,
        throw: Throw,
        target: Pose,
        names: Sequence[str],
        reach: tuple[float, float, float],
        model: str = "",
    ) -> ThrowBatch:
        """Throws of a motion, with the hand tabulated over `reach`."""
        early, late, longest = reach
        begin = throw.opening_time
        span = max(begin + early, 0.0), min(begin + late + longest, throw.path.end)
        chosen = model or throw.model or throw.scene.deciding_model
        return cls(throw, target, chosen, tuple(names), tabulated(throw, span), reach)

    @property
    def scene(self) -> Scene:
        """The throw's scene."""
        return self.throw.scene

    def nominal(self, count: int = 1) -> Array:
        """Values (count, P) that the throw was planned with."""
        values = self.scene.values | {"delay": self.scene.mean_delay}
        return np.tile([values[name] for name in self.names], (count, 1))

    def columns(self, values: Array) -> dict[str, Array]:
        """All parameters (N,) by name: those given, and the scene's own."""
        known = self.scene.values | {"delay": self.scene.mean_delay}
        columns = {name: np.full(len(values), value) for name, value in known.items()}
        return columns | dict(zip(self.names, values.T, strict=True))

    def fly(self, values: Array) -> BatchFlights:
        """N throws: values (N, P) of the parameters, columns as `names`, SI units.

        Each is released as a throw by itself, if the core throws the model exactly.
        """
        columns = self.columns(values)
        batch, late = self.releases(columns), columns["delay"] - self.scene.mean_delay
        if self.model in EXACT:
            surface = self.model == STEPPED_SURFACE
            release = exact_releases(self.throw.case, batch, late, surface=surface)
        else:
            release = release_model(self.scene, self.model).throw(batch)
        return self._flights(columns, release)

    def _flights(self, columns: dict[str, Array], release: BatchRelease) -> BatchFlights:
        """The flights after releases by hands without error, to which the errors are added."""
        late, opening = columns["delay"] - self.scene.mean_delay, columns["opening"]
        com = columns["com_offset"] + self.scene.grasp.offset
        com_offset = com - columns["grasp_offset"]
        error = np.column_stack([columns[name] for name in HAND])
        start = release.detach.copy()
        # Friction depends on relative motion only: a constant error of the hand's place or
        # velocity moves the whole release.
        start[:, :2] += error[:, :2] + error[:, 3:5] * opening[:, None]
        start[:, 3:5] += error[:, 3:5]
        if release.track is not None:
            track = release.track.copy()
            for axis in range(2):
                drift = error[:, 3 + axis, None] * track[..., 0]
                track[..., 1 + axis] += error[:, axis, None] + drift
            release = replace(release, track=track)
        opened = self.throw.opening_time + late
        freed, landing = opened + opening, self.scene.flight.land(start, self.target.z)
        flown = np.where(landing[:, 2] > 0.0, landing[:, 2], np.inf)
        start = np.column_stack(astuple(self.scene.flight.calibrated(FlightState(*start.T), flown)))
        after = freed + landing[:, 2] - self.throw.landing_time
        # The pads are round: an error of the hand's angle is one of the grasp angle.
        angle = columns["grasp_angle"] + columns["hand_theta"]
        return BatchFlights(
            *(columns, late, opened, freed, com_offset, angle, com, error, release, start, landing),
            way=self.target.speed * after if self.target.speed else np.zeros(len(late)),
        )

    def releases(self, columns: dict[str, Array]) -> ReleaseBatch:
        """The releases of throws with these parameters."""
        scene, friction = self.scene, columns["friction"]
        profile = scene.gripper.profile()
        hands = self.hands.shifted(columns["delay"] - self.scene.mean_delay)
        if "hand_omega" in self.names:
            still = np.zeros(len(friction))
            hands = replace(hands, drift=np.array([still, still, columns["hand_omega"]]))
        com_offset = columns["com_offset"] + scene.grasp.offset - columns["grasp_offset"]
        return ReleaseBatch(
            count=friction.size,
            body=Body(columns["mass"], columns["inertia"], com_offset),
            contact=replace(scene.patch, friction=friction, patch_radius=columns["patch_radius"]),
            grip=profile,
            hands=hands,
            opening=columns["opening"],
            force=np.full(friction.size, profile.full),
            gravity=scene.gravity,
            grasp_angle=columns["grasp_angle"] + columns["hand_theta"],
        )

    def one(self, values: Array) -> Throw:
        """One of the throws by itself, by the deciding model: values (P,).

        Its scene has the values, and is aimed at the target's pose at the landing.
        """
        columns, scene = self.columns(values[None]), self.scene
        value = {name: float(column[0]) for name, column in columns.items()}
        bar, grip = scene.object, scene.gripper
        made = scene.changed(
            object=bar.changed(
                mass=value["mass"],
                inertia=value["inertia"],
                com=value["com_offset"] + scene.grasp.offset,
            ),
            contact=scene.contact.changed(
                friction=value["friction"], patch_radius=value["patch_radius"]
            ),
            grasp=scene.grasp.changed(offset=value["grasp_offset"], angle=value["grasp_angle"]),
            gripper=grip.stretched(value["opening"]),
        )
        late = value["delay"] - self.scene.mean_delay
        error = HandError(*(value[name] for name in HAND))
        opened = self.throw.opening_time + late
        found = replace(self.throw, scene=made, opening_time=opened, error=error)
        if not self.target.speed or not found.lands:
            return found
        target = self.throw.target
        way = self.target.speed * (found.landing_time - self.throw.landing_time)
        there = target.shifted(way, 0.0)
        return replace(found, scene=made.aimed_at(there))


def flight_of(throw: Throw) -> BatchFlights:
    """A throw's own flight, as one of a batch's; columns: of object and contact only."""
    scene, landing, release = throw.scene, throw.landing, throw.release
    body, patch = scene.body, scene.patch
    numbers = body.mass, body.inertia, patch.friction, patch.patch_radius
    names = "mass", "inertia", "friction", "patch_radius"
    columns = {name: np.full(1, value) for name, value in zip(names, numbers, strict=True)}
    error, none = throw.error, np.zeros(1)
    nodes = np.vstack([release.times, release.com]).T
    # As of a batch: the first nodes after even times, and the last.
    even = np.linspace(0.0, release.times[-1], track_length(float(release.times[-1])))
    which = np.minimum(np.searchsorted(release.times, even), len(nodes) - 1)
    which[-1] = len(nodes) - 1
    track = nodes[which][None]
    opened = np.full(1, throw.opening_time)
    return BatchFlights(
        columns,
        late=none,
        opened=opened,
        freed=opened + scene.gripper.profile().opening,
        com_offset=np.full(1, scene.com_offset),
        grasp_angle=np.full(1, scene.grasp.angle + error.theta),
        com=np.full(1, scene.object.com),
        error=np.array([error]),
        release=BatchRelease(release.end[None], np.full(1, release.trouble == LOST), track=track),
        start=np.array([astuple(landing.start)]),
        landing=np.array([[landing.x, landing.theta, landing.flight_time]]),
        way=none,
    )


def tabulated(throw: Throw, span: tuple[float, float]) -> Trajectory:
    """The hand of a throw over `span` [s] of its own clock, counted from its opening.

    At rest before time 0 and after the end. Its pieces are divided evenly.
    """
    motion = throw.path
    times, hand = motion.breaks, throw.manipulator.hand(motion)
    inside = times[(times > span[0]) & (times < span[1])]
    ends = np.concatenate([[span[0]], inside, [span[1]]])
    parts = np.maximum(np.ceil(np.diff(ends) / CELL - 1e-9), 1).astype(int)
    pieces = [
        np.linspace(begin, end, count, endpoint=False)
        for begin, end, count in zip(ends[:-1], ends[1:], parts, strict=True)
    ]
    edges = np.concatenate([*pieces, [span[1]]])
    at, knots = hand.at(edges), edges - throw.opening_time
    slope = np.diff(at.acceleration) / np.diff(edges)
    cells = np.stack([slope / 6, *(v[:, :-1] for v in (at.acceleration / 2, at.twist, at.pose))])
    # At rest before and after: cells of the pose alone.
    if span[0] <= 0.0:
        knots = np.append(knots[0] - 1.0, knots)
        cells = np.insert(cells, 0, 0.0, axis=2)
        cells[-1, :, 0] = at.pose[:, 0]
    if span[1] >= motion.end:
        knots = np.append(knots, knots[-1] + 1.0)
        cells = np.insert(cells, cells.shape[2], 0.0, axis=2)
        cells[-1, :, -1] = at.pose[:, -1]
    return Trajectory(knots, cells[..., None], np.empty(0))
