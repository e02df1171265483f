"""Synthetic measured throws on the published design, to test a fit against a known truth.

As in Liu and Billard, section VI-A: per pitch angle one state of the joints as the grip force
starts to fall, and from there six constant joint accelerations along the joints' rates, from
speeding up to slowing down. Each motion starts at rest, keeps the Panda's limits on position,
velocity, acceleration and jerk, and brakes to rest. A meshed patch throws the bars; motion, grip
force and track are measured with noise. Rates, filters and the tracker's accuracy are the paper's;
all other noise is assumed and stated in `Noise`. The data are always labelled synthetic.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ...models import Array, Body, Contact, FlightLaw, FlightState, Trajectory, sticking_state
from ...models.release import LinearGrip, ReleaseBatch, TableGrip
from ...models.release.patch import PATCH_CHUNK, PatchRelease, PatchThrows
from ...problems import Grasp, Gripper, InputError, PadContact, Scene, ThrownObject, Workspace
from ...problems.scene_files import load_scene
from ...problems.throws import MeasuredThrow, Shared, ThrowData
from ..samples import carry
from ..throw import TICK, Manipulator, Samples, Throw, make_manipulator, send
from ..workers import Progress

#: The paper's bar, Table II, and those of its factor analysis. Where the paper gives no CoM it
#: is the middle of the bar; the inertia of a changed mass is taken as unchanged.
BARS = {
    "com1": ThrownObject(mass=0.24, inertia=535e-6, length=0.26, com=0.10, width=0.02),
    "com2": ThrownObject(mass=0.24, inertia=802e-6, length=0.26, com=0.16, width=0.02),
    "metal": ThrownObject(mass=0.246, inertia=535e-6, length=0.26, com=0.13, width=0.02),
    "plastic": ThrownObject(mass=0.122, inertia=535e-6, length=0.26, com=0.13, width=0.02),
    "moi-small": ThrownObject(mass=0.40, inertia=714e-6, length=0.26, com=0.13, width=0.02),
    "moi-large": ThrownObject(mass=0.40, inertia=1961e-6, length=0.26, com=0.13, width=0.02),
}
#: Full grip force [N] of one pad; the Robotiq 2F-85 reaches 235.
FORCE = 220.0
#: Time [s] from the opening command to the start of the force's fall.
DWELL = 0.05
#: Time [s] in which the force falls to zero.
OPENING = 0.06
#: Landing height [m] at which the batch's mean flight time is the paper's 0.6 s.
HEIGHT = -0.65
#: Friction and patch radius [m] at which the grip must hold the bars in all motions.
HELD = (0.8, 0.0031)
#: Factors on friction and patch radius of the surfaces: the paper's values for papertape, 0.4 and
#: 5 mm, over those for the plastic, 1.0 and 2.5 mm.
SURFACES = {"base": (1.0, 1.0), "plastic": (1.0, 1.0), "papertape": (0.4, 2.0)}
#: Positions [rad] and rates [rad/s] of joints 2, 4 and 6 at the start of the force's fall, drawn at
#: random: an upward throw, one in between, a forward one. All their motions pass a plan's checks.
PITCHES = {
    "p1": ((-0.120472, -2.706771, 3.368954), (-1.333137, 0.958174, 1.824863)),
    "p2": ((-0.060491, -2.421472, 2.874295), (-1.329277, 0.583433, 1.272851)),
    "p3": ((0.462194, -2.157387, 2.954733), (-0.109184, 1.228937, 1.434976)),
}
#: Duration [s] of the launch of each release.
LAUNCHES = {
    "p1": (0.5, 0.5, 0.5, 0.4, 0.4, 0.4),
    "p2": (0.5, 0.5, 0.5, 0.5, 0.5, 0.4),
    "p3": (0.5, 0.5, 0.5, 0.5, 0.4, 0.4),
}
#: Joint accelerations of the releases, as shares of the limit that is reached first.
RELEASES = (0.36, 0.18, 0.0, -0.3, -0.6, -0.9)
#: Time [s] after the opening with constant acceleration, for late openings and the low-pass filter.
LONGER = 0.025


@dataclass(frozen=True)
class Condition:
    """A condition: a bar of BARS, pitch, number of the release from 1; labels of its row in
    throws.csv, of which `surface` is one of SURFACES."""

    bar: str
    pitch: str
    release: int
    labels: dict[str, str]


def conditions(factors: bool) -> Iterator[Condition]:
    """The batch's 36 conditions, then those that vary surface, payload or inertia alone."""
    base = {"surface": "base", "payload": "base", "moi": "base"}
    for com, pitch, release in itertools.product(("com1", "com2"), PITCHES, range(1, 7)):
        labels = {"set": "batch", "com": com, "pitch": pitch, "release": f"a{release}"}
        yield Condition(com, pitch, release, labels | base)
    if not factors:
        return
    varied = [("surface", label, "com1") for label in ("plastic", "papertape")]
    varied += [("payload", label, label) for label in ("metal", "plastic")]
    varied += [("moi", label, f"moi-{label}") for label in ("small", "large")]
    for (factor, label, bar), release in itertools.product(varied, (2, 4, 6)):
        com = bar if bar == "com1" else "middle"
        labels = {"set": "factors", "com": com, "pitch": "p2", "release": f"a{release}"}
        yield Condition(bar, "p2", release, labels | base | {factor: label})


@cache
def scene_with(
    bar: str, surface: str = "base", friction: float = HELD[0], patch_radius: float = HELD[1]
) -> Scene:
    """The Panda on a high base with a bar and a surface; its target is not used.

    friction, patch_radius [m]: of the base surface.
    """
    less, wider = SURFACES[surface]
    return load_scene("pose").replace(
        workspace=Workspace(
            floor=-0.3, column_radius=0.12, column_height=0.45, palm_clearance=0.002
        ),
        object=BARS[bar],
        contact=PadContact(friction=less * friction, patch_radius=wider * patch_radius),
        gripper=Gripper(force=FORCE, dwell=DWELL, opening=OPENING),
    )


@cache
def panda() -> Manipulator:
    """The arm that throws all bars."""
    return make_manipulator(scene_with("com1"))


@dataclass(frozen=True)
class Throwing:
    """A motion of the design: samples at 1 kHz; opening_time [s]: nominal start of the fall."""

    samples: Samples
    opening_time: float


@cache
def design() -> dict[str, list[Throwing]]:
    """For each pitch the motions of the six release accelerations."""
    found = {}
    for pitch, (place, rate) in PITCHES.items():
        q, dq = np.array(place), np.array(rate)
        direction = dq / (np.abs(dq) / panda().planning.ddq).max()
        motions = []
        for share, time in zip(RELEASES, LAUNCHES[pitch], strict=True):
            state, constant = (q, dq, share * direction), OPENING + LONGER
            path = carry(panda(), state, time, constant, round(time / TICK))
            motions.append(Throwing(send(panda(), path), time))
        found[pitch] = motions
    return found


def grip_use(motion: Throwing, scene: Scene) -> float:
    """Largest friction use while the bar is carried, 1 is the limit."""
    late = motion.opening_time + LONGER / 2
    return Throw(scene, panda(), motion.samples.path, late).grip_use


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the scatter of throws, and of the measurement.

    Scatter: opening [s] of the gripper's dwell; force, of the full grip, and friction, relative.
    Measurement: joints [rad], each sample; sync [s], the force's clock against the
    joints'; grip [N], each sample, with an offset of the same size; position [m] and angle
    [rad] of each sample of the track; landing [m], landing_angle [rad].
    """

    opening: float = 0.002
    force: float = 0.03
    friction: float = 0.03
    joints: float = 5e-5
    sync: float = 0.0005
    grip: float = 0.3
    position: float = 0.0002
    angle: float = 0.002
    landing: float = 0.002
    landing_angle: float = math.radians(0.5)

    @classmethod
    def none(cls) -> Noise:
        """No scatter and exact measurements."""
        return cls(**{part.name: 0.0 for part in dataclasses.fields(cls)})


@dataclass(frozen=True)
class SynthesisConfig:
    """Settings of a synthetic batch.

    The true release is a meshed patch, rigid or of LuGre bristles of a stiffness [1/m], in
    `steps` over the opening, of first order: 8 times more steps move the design's landings by up to
    0.03 mm and 0.03 deg. friction and patch_radius [m] are of the base surface.
    """

    stiffness: float | None = None
    steps: int = 1000
    friction: float = HELD[0]
    patch_radius: float = HELD[1]
    repeats: int = 5
    factors: bool = False
    noise: Noise = field(default_factory=Noise)
    seed: int = 1


@dataclass(frozen=True)
class Event:
    """The truth of one throw: its motion, bar and contact, its grip (dwell after `command`)."""

    motion: Throwing
    bar: ThrownObject
    friction: float
    patch_radius: float
    grip: LinearGrip

    @property
    def command(self) -> float:
        """Time [s] of the opening command."""
        return self.motion.opening_time - DWELL

    @property
    def opening(self) -> float:
        """True time [s] at which the grip force starts to fall."""
        return self.command + self.grip.dwell


@dataclass(frozen=True)
class Flown:
    """A true throw: landing x [m], theta [rad], flight time [s]; com (3, K) at times (K,) [s]
    of the opening."""

    event: Event
    times: Array
    com: Array
    detach: FlightState
    landing: Array

    def poses(self, times: Array) -> Array:
        """CoM poses (K, 3) at times [s] of the motion's clock: held, let go, flying."""
        since = times - self.event.opening
        hand = panda().hand(self.event.motion.samples.path).at(times).pose
        held = sticking_state(hand, 0 * hand, 0.0, self.event.bar.com)[:3]
        going = [np.interp(since, self.times, values) for values in self.com]
        flying = scene_with("com1").flight.after(self.detach, since - self.times[-1])
        parts = np.array([held, going, flying.pose])
        phase = (since > 0).astype(int) + (since >= self.times[-1])
        return np.asarray(np.choose(phase, parts), float).T


def make_throws(
    making: SynthesisConfig, progress: Progress | None = None
) -> tuple[ThrowData, list[Flown]]:
    """The data set, and the truth of each throw.

    Raises InputError for a contact that does not hold the bars on their way.
    """
    batch = list(conditions(making.factors))
    _check_held(making, batch)
    rng = np.random.default_rng(making.seed)
    drawn = [(one, k) for one in batch for k in range(1, making.repeats + 1)]
    events = [_event(making, one, rng) for one, _ in drawn]
    flown = _thrown(events, making, progress or (lambda *_: None))
    throws = []
    for number, ((one, repeat), throw) in enumerate(zip(drawn, flown, strict=True), start=1):
        name, factors = f"t{number:03d}", one.labels | {"repeat": str(repeat)}
        recorded = _measured(throw, making.noise, rng)
        throws.append(dataclasses.replace(recorded, name=name, factors=factors))
    law = "rigid" if making.stiffness is None else f"LuGre bristles of {making.stiffness:g} 1/m"
    noise = "no noise" if making.noise == Noise.none() else "noise as in [truth]"
    shared = Shared(
        landing_height=HEIGHT,
        description=f"Synthetic batch: {len(throws)} throws of a bar by a Panda",
        synthetic=f"meshed patch, {law}, friction {making.friction:g}, patch radius "
        f"{1e3 * making.patch_radius:g} mm, {noise}, seed {making.seed}",
        arm="panda",
        position_noise=making.noise.landing or Noise.landing,
        angle_noise=making.noise.landing_angle or Noise.landing_angle,
    )
    return ThrowData("throws", shared, tuple(throws), scene_with("com1").arm, _truth(making)), flown


def _truth(making: SynthesisConfig) -> dict[str, float]:
    """The section [truth]."""
    found = {"friction": making.friction, "patch_radius": making.patch_radius}
    if making.factors:
        contact = scene_with("com1", "papertape", making.friction, making.patch_radius).contact
        found["papertape_friction"] = contact.friction
        found["papertape_patch_radius"] = contact.patch_radius
    if making.stiffness is not None:
        found["stiffness"] = making.stiffness
    found["seed"] = float(making.seed)
    found |= {f"noise_{key}": value for key, value in dataclasses.asdict(making.noise).items()}
    return {key: float(f"{value:.9g}") for key, value in found.items()}


def _check_held(making: SynthesisConfig, batch: Sequence[Condition]) -> None:
    """InputError for a contact with which a bar uses too much of the grip."""
    uses = {}
    for one in batch:
        scene = scene_with(one.bar, one.labels["surface"], making.friction, making.patch_radius)
        motion = design()[one.pitch][one.release - 1]
        uses[f"{one.bar}, {one.pitch}, a{one.release}"] = grip_use(motion, scene)
    # A fifth of the grip is reserve for weak throws.
    worst, most = max(uses, key=lambda name: uses[name]), 0.8
    if uses[worst] > most + 1e-9:
        raise InputError(
            f"--friction {making.friction:g} with --patch-radius {making.patch_radius:g}: the "
            f"grip does not hold the bar on its way ({worst}: grip use {uses[worst]:.2f}, at "
            f"most {most:g}); make their product larger"
        )


def _event(making: SynthesisConfig, one: Condition, rng: np.random.Generator) -> Event:
    """One throw of a condition, with its random scatter."""
    # Clipped, so that the full grip holds every bar.
    late, stronger, rougher = np.clip(rng.standard_normal(3), -3.0, 3.0)
    noise, motion = making.noise, design()[one.pitch][one.release - 1]
    scene = scene_with(one.bar, one.labels["surface"], making.friction, making.patch_radius)
    force, dwell = FORCE * (1 + noise.force * stronger), DWELL + noise.opening * late
    friction, radius = scene.contact.friction, scene.contact.patch_radius
    rough, grip = friction * (1 + noise.friction * rougher), LinearGrip(force, dwell, OPENING)
    return Event(motion, scene.object, rough, radius, grip)


def _thrown(events: Sequence[Event], law: SynthesisConfig, progress: Progress) -> list[Flown]:
    """All events, thrown by the true law and flown to the landing height.

    Raises ArithmeticError for a throw that the law does not solve.
    """
    gravity, found = scene_with("com1").gravity, []
    # The releases' hands go through their poses at 1 kHz.
    times = np.arange(-0.002, OPENING + 0.003, TICK)
    for first in range(0, len(events), PATCH_CHUNK):
        part = events[first : first + PATCH_CHUNK]
        paths = [(event.motion.samples.path, event.opening + times) for event in part]
        poses = np.array([panda().hand(path).at(at).pose.T for path, at in paths])
        bars = np.array([(event.bar.mass, event.bar.inertia, event.bar.com) for event in part])
        contacts = np.array([(event.friction, event.patch_radius) for event in part])
        batch = ReleaseBatch(
            len(part),
            Body(*bars.T),
            Contact(*contacts.T),
            part[0].grip,
            Trajectory.through(times, poses),
            np.full(len(part), OPENING),
            np.array([event.grip.full for event in part]),
            gravity,
        )
        throws = PatchThrows.of_batch(batch, law.steps)
        release = PatchRelease(stiffness=law.stiffness).march(throws)
        landing = FlightLaw(gravity).land(release.end.T, HEIGHT)
        if not np.isfinite(landing).all():
            raise ArithmeticError("a true throw could not be computed")
        for i, event in enumerate(part):
            state, com = FlightState(*release.end[:, i].tolist()), release.com[:, :, i]
            found.append(Flown(event, release.times[:, i], com, state, landing[i]))
        progress(len(found), len(events))
    return found


def _measured(throw: Flown, noise: Noise, rng: np.random.Generator) -> MeasuredThrow:
    """The recording of a throw, without name and factors.

    Joints at 500 Hz; the track at 250 Hz from 0.1 s before the command on; the grip force at 1 kHz
    from the command to 40 ms after its fall.
    """
    event, samples, arm = throw.event, throw.event.motion.samples, scene_with("com1").arm
    assert arm is not None
    times = np.arange(math.floor(500 * samples.times[-1] + 1e-9) + 1) / 500
    joints = np.tile(arm.posture, (times.size, 1))
    joints[:, [j - 1 for j in arm.throwing_joints]] = samples.path.at(times).pose.T
    joints += noise.joints * rng.standard_normal(joints.shape)
    landed = event.opening + throw.times[-1] + throw.landing[2]
    seen = np.arange(math.ceil(250 * (event.command - 0.1)), math.ceil(250 * landed) + 2) / 250
    spread = np.array([noise.position, noise.position, noise.angle])
    poses = throw.poses(seen) + spread * rng.standard_normal((seen.size, 3))
    x, theta, _ = throw.landing
    off = rng.standard_normal(3) * [noise.landing, noise.landing, noise.landing_angle]
    grip = event.grip
    clock = np.arange(0.0, grip.dwell + grip.opening + 0.04, TICK)
    late, offset = noise.sync * rng.standard_normal(), noise.grip * rng.standard_normal()
    force = grip.force(clock - grip.dwell - late) + offset
    force = force + noise.grip * rng.standard_normal(clock.size)
    return MeasuredThrow(
        name="",
        object=event.bar,
        grasp=Grasp(),
        times=times,
        motion=joints,
        command=event.command,
        grip=TableGrip.from_recording(clock, force),
        landing=(float(x + off[0]), float(HEIGHT + off[1]), float(theta + off[2])),
        track=np.column_stack([seen, poses]),
        factors={},
    )
