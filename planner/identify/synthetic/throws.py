"""Synthetic throws: the design's motions, thrown by a meshed patch, measured with noise.

The data are always labelled synthetic. Rates, filters and the tracker's accuracy are those of Liu
and Billard, section VI-A; all other noise is assumed and stated in `Noise`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ....models import Array, Body, Contact, FlightLaw, FlightState, Trajectory, sticking_state
from ....models.release import LinearRelease, ReleaseBatch, TableRelease
from ....models.release.patch import PATCH_CHUNK, PatchRelease, PatchThrows
from ....problems import Grasp, InputError, ThrownObject
from ....problems.throws import MeasuredThrow, Shared, ThrowData
from ...throw import Manipulator, make_manipulator
from .design import (
    BARS,
    DWELL,
    FORCE,
    GRIP,
    HEIGHT,
    HELD,
    OPENING,
    Condition,
    Throwing,
    conditions,
    contact_of,
    design,
    grip_use,
    scene_with,
)

#: Sampling interval [s] of the joints, the paper's.
JOINTS = 1 / 500
#: Sampling interval [s] of the track, the paper's.
TRACK = 1 / 250
#: Sampling interval [s] of the grip force, the paper's.
FORCES = 1 / 1000
#: Time [s] before the command at which the track begins.
BEFORE = 0.1
#: Time [s] after the force's fall at which its recording ends.
AFTER = 0.04
#: Draws are clipped at this number of standard deviations, so that the full grip holds every bar.
CUT = 3.0


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
    """The truth of one throw: its motion, bar and contact, its grip (dwell after `command`).

    command [s]: when the opening command goes out, on the motion's clock.
    """

    motion: Throwing
    bar: ThrownObject
    friction: float
    patch_radius: float
    grip: LinearRelease
    command: float

    @property
    def opening(self) -> float:
        """When the grip force truly starts to fall [s]."""
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

    def poses(self, manipulator: Manipulator, times: Array) -> Array:
        """CoM poses (K, 3) at times [s] of the motion's clock: held, let go, flying."""
        since = times - self.event.opening
        hand = manipulator.hand(self.event.motion.samples.path).at(times).pose
        x, z, theta = sticking_state(hand, 0 * hand, 0.0, self.event.bar.com)[:3]
        going = [np.interp(since, self.times, values) for values in self.com]
        flying = scene_with("com1").flight.after(self.detach, since - self.times[-1])
        parts = [(x, z, theta), going, (flying.x, flying.z, flying.theta)]
        phase = (since > 0).astype(int) + (since >= self.times[-1])
        return np.asarray(np.choose(phase, np.array(parts)), float).T


def make_throws(
    making: SynthesisConfig, progress: Callable[[int, int], None] | None = None
) -> tuple[ThrowData, list[Flown]]:
    """The data set, and the truth of each throw.

    Raises InputError for a contact that does not hold the bars on their way.
    """
    manipulator, batch = make_manipulator(scene_with("com1")), list(conditions(making.factors))
    _check_held(making, manipulator, batch)
    rng = np.random.default_rng(making.seed)
    drawn = [(one, k) for one in batch for k in range(1, making.repeats + 1)]
    events = [_event(making, one, rng) for one, _ in drawn]
    flown = _thrown(manipulator, events, making, progress or (lambda *_: None))
    throws = []
    for number, ((one, repeat), throw) in enumerate(zip(drawn, flown, strict=True), start=1):
        recorded = _measured(manipulator, throw, making.noise, rng)
        factors = one.labels | {"repeat": str(repeat)}
        throws.append(dataclasses.replace(recorded, name=f"t{number:03d}", factors=factors))
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
    arm = scene_with("com1").arm
    return ThrowData("throws", shared, tuple(throws), arm, _truth(making)), flown


def object_names() -> dict[ThrownObject, str]:
    """The bars' names in the files."""
    return {bar: name for name, bar in BARS.items()}


def _truth(making: SynthesisConfig) -> dict[str, float]:
    """The section [truth]."""
    found = {"friction": making.friction, "patch_radius": making.patch_radius}
    if making.factors:
        papertape = contact_of("papertape", making.friction, making.patch_radius)
        found["papertape_friction"], found["papertape_patch_radius"] = papertape
    if making.stiffness is not None:
        found["stiffness"] = making.stiffness
    noise = {f"noise_{key}": value for key, value in dataclasses.asdict(making.noise).items()}
    everything = found | {"seed": float(making.seed)} | noise
    return {key: float(f"{value:.9g}") for key, value in everything.items()}


def _check_held(
    making: SynthesisConfig, manipulator: Manipulator, batch: Sequence[Condition]
) -> None:
    """InputError for a contact with which a bar uses too much of the grip."""
    uses = {}
    for one in batch:
        scene = scene_with(one.bar, one.surface, making.friction, making.patch_radius)
        motion = design()[one.pitch][one.release - 1]
        uses[f"{one.bar}, {one.pitch}, a{one.release}"] = grip_use(manipulator, motion, scene)
    worst = max(uses, key=lambda name: uses[name])
    if uses[worst] > GRIP + 1e-9:
        raise InputError(
            f"--friction {making.friction:g} with --patch-radius {making.patch_radius:g}: the "
            f"grip does not hold the bar on its way ({worst}: grip use {uses[worst]:.2f}, at "
            f"most {GRIP:g}); make their product larger"
        )


def _event(making: SynthesisConfig, one: Condition, rng: np.random.Generator) -> Event:
    """One throw of a condition, with what varies from throw to throw."""
    late, stronger, rougher = np.clip(rng.standard_normal(3), -CUT, CUT)
    noise, motion = making.noise, design()[one.pitch][one.release - 1]
    mu, radius = contact_of(one.surface, making.friction, making.patch_radius)
    grip = LinearRelease(
        FORCE * (1 + noise.force * stronger), DWELL + noise.opening * late, OPENING
    )
    command = motion.opening_time - DWELL
    return Event(motion, BARS[one.bar], mu * (1 + noise.friction * rougher), radius, grip, command)


def _thrown(
    manipulator: Manipulator,
    events: Sequence[Event],
    law: SynthesisConfig,
    progress: Callable[[int, int], None],
) -> list[Flown]:
    """All events, thrown by the true law and flown to the landing height.

    Raises ArithmeticError for a throw that the law does not solve.
    """
    gravity, found = scene_with("com1").gravity, []
    for first in range(0, len(events), PATCH_CHUNK):
        part = events[first : first + PATCH_CHUNK]
        throws = PatchThrows.of_batch(_batch(manipulator, part, gravity), law.steps)
        release = PatchRelease(stiffness=law.stiffness).march(throws)
        detach = release.end
        landing = FlightLaw(gravity).land(detach.T, HEIGHT)
        if not np.isfinite(landing).all():
            raise ArithmeticError("a true throw could not be computed")
        for i, event in enumerate(part):
            state = FlightState(*(float(value) for value in detach[:, i]))
            com = release.com[:, :, i]
            found.append(Flown(event, release.times[:, i], com, state, landing[i]))
        progress(len(found), len(events))
    return found


def _batch(manipulator: Manipulator, events: Sequence[Event], gravity: float) -> ReleaseBatch:
    """The events' releases, hands through their poses at 1 kHz."""
    times = np.arange(-0.002, OPENING + 0.003, FORCES)
    poses = [manipulator.hand(e.motion.samples.path).at(e.opening + times).pose.T for e in events]
    known = [
        (e.bar.mass, e.bar.inertia, e.bar.com, e.friction, e.patch_radius, e.grip.full)
        for e in events
    ]
    mass, inertia, com, friction, radius, full = np.array(known).T
    return ReleaseBatch(
        len(events),
        Body(mass, inertia, com),
        Contact(friction, radius),
        events[0].grip,
        Trajectory.through(times, np.array(poses)),
        np.full(len(events), OPENING),
        full,
        gravity,
    )


def _measured(
    manipulator: Manipulator, throw: Flown, noise: Noise, rng: np.random.Generator
) -> MeasuredThrow:
    """The recording of a throw, without name and factors."""
    event, samples, arm = throw.event, throw.event.motion.samples, scene_with("com1").arm
    assert arm is not None
    times = JOINTS * np.arange(math.floor(samples.times[-1] / JOINTS + 1e-9) + 1)
    joints = np.tile(arm.posture, (times.size, 1))
    joints[:, [j - 1 for j in arm.throwing_joints]] = samples.path.at(times).pose.T
    joints += noise.joints * rng.standard_normal(joints.shape)
    landed = event.opening + throw.times[-1] + throw.landing[2]
    first = math.ceil((event.command - BEFORE) / TRACK)
    seen: Array = TRACK * np.arange(first, math.ceil(landed / TRACK) + 2.0)
    spread = np.array([noise.position, noise.position, noise.angle])
    poses = throw.poses(manipulator, seen) + spread * rng.standard_normal((seen.size, 3))
    x, theta, _ = throw.landing
    off = rng.standard_normal(3) * [noise.landing, noise.landing, noise.landing_angle]
    return MeasuredThrow(
        name="",
        object=event.bar,
        grasp=Grasp(),
        times=times,
        motion=joints,
        command=event.command,
        grip=_recorded_force(event, noise, rng),
        landing=(float(x + off[0]), float(HEIGHT + off[1]), float(theta + off[2])),
        track=np.column_stack([seen, poses]),
        factors={},
    )


def _recorded_force(event: Event, noise: Noise, rng: np.random.Generator) -> TableRelease:
    """The force sensor's recording, from the command on, made to fall."""
    grip = event.grip
    times = np.arange(0.0, grip.dwell + grip.opening + AFTER, FORCES)
    late, offset = noise.sync * rng.standard_normal(), noise.grip * rng.standard_normal()
    raw = grip.force(times - grip.dwell - late)
    raw = raw + offset + noise.grip * rng.standard_normal(times.size)
    return TableRelease.from_recording(times, raw)
