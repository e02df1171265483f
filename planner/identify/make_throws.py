"""Synthetic throws: the design's motions, thrown by a meshed patch, measured with noise.

Always labelled synthetic. Rates, filters and the tracker's accuracy are those of Liu and
Billard, section VI-A; all other noise is assumed and stated in `Noise`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ...models import LinearRelease, TableRelease
from ...problems import (
    Grasp,
    InputError,
    MeasuredThrow,
    Shared,
    ThrowData,
    ThrownObject,
    monotone_grip,
)
from ..check import Mover, make_mover
from .make_throws_design import GRIP, PITCHES, RELEASES, Throwing, design, grip_use
from .make_throws_scene import BARS, GRIPPER, HEIGHT, HELD, SURFACES, scene_with, surfaced
from .make_throws_truth import Event, Flown, Law, true_throws

Array = npt.NDArray[np.float64]

#: Sampling of joints, track and grip force [s], the paper's.
JOINTS, TRACK, FORCE = 1 / 500, 1 / 250, 1 / 1000
#: How long the track starts before the command and the force goes on after the fall [s].
BEFORE, AFTER = 0.1, 0.04
#: Draws are cut off at so many standard deviations: no bar slips in the full grip.
CUT = 3.0
#: Releases of the throws beside the batch that vary one factor.
FACTOR_RELEASES = (2, 4, 6)


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one throw against its condition, and of what is measured.

    What varies: opening [s], the gripper's dwell; force, full grip, and friction, relative.
    What is measured: joints [rad], each sample; sync [s], the force's clock against the
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
        """Nothing varies, everything is measured exactly."""
        return cls(**{part.name: 0.0 for part in dataclasses.fields(cls)})


@dataclass(frozen=True)
class Making:
    """What is asked for. friction and patch_radius [m] are of the base surface."""

    law: Law = field(default_factory=Law)
    friction: float = HELD[0]
    patch_radius: float = HELD[1]
    repeats: int = 5
    factors: bool = False
    noise: Noise = field(default_factory=Noise)
    seed: int = 1


@dataclass(frozen=True)
class Condition:
    """What is thrown how: a bar of BARS, pitch, number of the release from 1; a surface of
    SURFACES; labels of the row."""

    bar: str
    pitch: str
    release: int
    surface: str
    labels: dict[str, str]


def conditions(factors: bool) -> Iterator[Condition]:
    """The batch's 36 conditions, then those that vary surface, payload or inertia alone."""
    base = {"surface": "base", "payload": "base", "moi": "base"}
    for com in ("com1", "com2"):
        for pitch in PITCHES:
            for release in range(1, len(RELEASES) + 1):
                labels = {"set": "batch", "com": com, "pitch": pitch, "release": f"a{release}"}
                yield Condition(com, pitch, release, "base", labels | base)
    if not factors:
        return
    varied = [("surface", label, "com1", label) for label in ("plastic", "papertape")]
    varied += [("payload", label, label, "base") for label in ("metal", "plastic")]
    varied += [("moi", label, f"moi-{label}", "base") for label in ("small", "large")]
    for factor, label, bar, surface in varied:
        com = bar if bar == "com1" else "middle"
        for release in FACTOR_RELEASES:
            labels = {"set": "factors", "com": com, "pitch": "p2", "release": f"a{release}"}
            yield Condition(bar, "p2", release, surface, labels | base | {factor: label})


def make_throws(
    making: Making, progress: Callable[[int, int], None] | None = None
) -> tuple[ThrowData, list[Flown]]:
    """The data set, and each throw as it truly was.

    Raises InputError for a contact that does not hold the bars on their way.
    """
    mover = make_mover(scene_with("com1", *HELD))
    motions, wanted = design(), list(conditions(making.factors))
    _check_held(making, mover, motions, wanted)
    rng = np.random.default_rng(making.seed)
    drawn = [(one, k) for one in wanted for k in range(1, making.repeats + 1)]
    events = [_event(making, motions, one, rng) for one, _ in drawn]
    flown = true_throws(mover, events, making.law, HEIGHT, progress=progress)
    throws = []
    for number, ((one, repeat), throw) in enumerate(zip(drawn, flown, strict=True), start=1):
        factors = one.labels | {"repeat": str(repeat)}
        throws.append(_measured(f"t{number:03d}", factors, throw, making.noise, rng))
    shared = Shared(
        landing_height=HEIGHT,
        description=f"Synthetic batch: {len(throws)} throws of a bar by a Panda",
        synthetic=f"{making.law.words}, friction {making.friction:g}, patch radius "
        f"{1e3 * making.patch_radius:g} mm, {_noise_words(making.noise)}, seed {making.seed}",
        arm="panda",
        position_noise=making.noise.landing or Noise.landing,
        angle_noise=making.noise.landing_angle or Noise.landing_angle,
    )
    arm = scene_with("com1", *HELD).arm
    return ThrowData("throws", shared, tuple(throws), arm, _truth(making)), flown


def _truth(making: Making) -> dict[str, float]:
    """The section [truth]."""
    less, wider = SURFACES["papertape"]
    found = {"friction": making.friction, "patch_radius": making.patch_radius}
    if making.factors:
        found["papertape_friction"] = less * making.friction
        found["papertape_patch_radius"] = wider * making.patch_radius
    if making.law.kind == "lugre":
        found["stiffness"] = making.law.stiffness
    noise = {f"noise_{key}": value for key, value in dataclasses.asdict(making.noise).items()}
    everything = found | {"seed": float(making.seed)} | noise
    return {key: float(f"{value:.9g}") for key, value in everything.items()}


def _noise_words(noise: Noise) -> str:
    return "no noise" if noise == Noise.none() else "noise as in [truth]"


def _check_held(
    making: Making, mover: Mover, motions: dict[str, list[Throwing]], wanted: list[Condition]
) -> None:
    """InputError for a contact with which a bar uses too much of the grip on the way."""
    worst = (0.0, "")
    for one in wanted:
        scene = surfaced(one.bar, one.surface, making.friction, making.patch_radius)
        use = grip_use(mover, motions[one.pitch][one.release - 1], scene)
        worst = max(worst, (use, f"{one.bar}, {one.pitch}, a{one.release}"))
    if worst[0] > GRIP + 1e-9:
        raise InputError(
            f"--friction {making.friction:g} with --patch-radius {making.patch_radius:g}: the "
            f"grip does not hold the bar on its way ({worst[1]}: grip use {worst[0]:.2f}, at most "
            f"{GRIP:g}); make their product larger"
        )


def _event(
    making: Making,
    motions: dict[str, list[Throwing]],
    one: Condition,
    rng: np.random.Generator,
) -> Event:
    """One throw of a condition, with what varies from throw to throw."""
    late, stronger, rougher = np.clip(rng.standard_normal(3), -CUT, CUT)
    noise, motion = making.noise, motions[one.pitch][one.release - 1]
    less, wider = SURFACES[one.surface]
    full = float(GRIPPER.force or 0.0) * (1 + noise.force * stronger)
    grip = LinearRelease(full, GRIPPER.dwell + noise.opening * late, float(GRIPPER.opening or 0.0))
    friction = less * making.friction * (1 + noise.friction * rougher)
    command = motion.opening_time - GRIPPER.dwell
    return Event(motion, BARS[one.bar], friction, wider * making.patch_radius, grip, command)


def _measured(
    name: str, factors: dict[str, str], throw: Flown, noise: Noise, rng: np.random.Generator
) -> MeasuredThrow:
    """A true throw as it is recorded."""
    event, samples = throw.event, throw.event.motion.samples
    arm = scene_with("com1", *HELD).arm
    assert arm is not None
    times = JOINTS * np.arange(math.floor(samples.times[-1] / JOINTS + 1e-9) + 1)
    joints = np.tile(arm.posture, (times.size, 1))
    joints[:, [j - 1 for j in arm.throwing_joints]] = samples.at(times)[0].T
    joints += noise.joints * rng.standard_normal(joints.shape)
    first = math.ceil((event.command - BEFORE) / TRACK)
    seen: Array = TRACK * np.arange(first, math.ceil(throw.landed / TRACK) + 2.0)
    spread = np.array([noise.position, noise.position, noise.angle])
    poses = throw.poses(seen) + spread * rng.standard_normal((seen.size, 3))
    x, theta, _ = throw.landing
    off = rng.standard_normal(3) * [noise.landing, noise.landing, noise.landing_angle]
    landing = (float(x + off[0]), float(HEIGHT + off[1]), float(theta + off[2]))
    grip, track = _grip(event, noise, rng), np.column_stack([seen, poses])
    grasp = Grasp()
    return MeasuredThrow(
        name, event.bar, grasp, times, joints, event.command, grip, landing, track, factors
    )


def _grip(event: Event, noise: Noise, rng: np.random.Generator) -> TableRelease:
    """The force sensor's recording, from the command on, made to fall."""
    grip = event.grip
    times = np.arange(0.0, grip.dwell + grip.opening + AFTER, FORCE)
    late, offset = noise.sync * rng.standard_normal(), noise.grip * rng.standard_normal()
    raw = grip.force(times - grip.dwell - late)
    raw = raw + offset + noise.grip * rng.standard_normal(times.size)
    return monotone_grip(times, raw)


def object_names() -> dict[ThrownObject, str]:
    """The bars' names in the files."""
    return {bar: name for name, bar in BARS.items()}
