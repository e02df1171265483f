"""Given motions through release models: a scene's own, recorded joints, or arrays of N."""

from __future__ import annotations

import math
import pathlib
import time
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from ...models import (
    Array,
    Body,
    FlightLaw,
    HandTrack,
    MovedHand,
    PinchContact,
    ReadOnly,
    Trajectory,
    low_pass,
)
from ...models.release import (
    BATCH_MODELS,
    MODELS,
    SLIDING_PIVOT,
    STEPPED_SURFACE,
    BatchRelease,
    Release,
    ReleaseBatch,
    ReleaseCase,
    ReleaseModel,
    ShapedRelease,
    SlidingPivot,
    own_model,
)
from ...models.robot import Arm, PlanarArm, hand_motion
from ...problems import InputError, Motion, Scene, checked
from ...problems.files import plain
from ...problems.scene_files import as_scene, load_scene
from .batch import ThrowBatch
from .throw import LandingPoint, Throw, case_of

#: Largest angle [rad] between the arm's posture and a recorded joint that does not throw.
POSTURE_ROOM = 0.05
#: Most steps of an opening that may be asked for.
MOST_STEPS = 100_000
#: Samples of a scene's own motion over the opening.
GIVEN_SAMPLES = 1001

_HAND = ("pose", "twist", "acceleration")
_SAMPLED = ("times", "poses")


def given_hand(scene: Scene) -> HandTrack:
    """The hand of the scene's [motion]; InputError without one, and for one that does not fit."""
    motion = scene.motion
    if motion is None:
        raise InputError(f"{scene.place}: has no section [motion] to simulate")
    try:
        track = _track(scene, motion)
    except ValueError as error:
        raise InputError(f"{scene.place}: [motion] {error}") from None
    if motion.samples:
        (first, *_), (last, *_) = motion.samples[0], motion.samples[-1]
        needed = motion.opening_time + scene.gripper.profile().opening
        if not first <= motion.opening_time or needed > last + 1e-9:
            raise InputError(
                f"{scene.place}: [motion] opening_time = {motion.opening_time:.12g}: the opening "
                f"lasts until {needed:.12g} s, the samples cover {first:.12g} to {last:.12g} s"
            )
    return track


def _track(scene: Scene, motion: Motion) -> HandTrack:
    pose, twist = (*motion.position, motion.angle), (*motion.velocity, motion.rate)
    if motion.samples:
        table = np.array(motion.samples, float)
        if motion.joints is None:
            return Trajectory.through(table[:, 0] - motion.opening_time, table[:, 1:])
        assert scene.arm is not None  # checked by Scene
        joints = table[:, 1:]
        kinematics, times = PlanarArm(scene.arm), table[:, 0]
        return recorded_joints(kinematics, times, joints, motion.opening_time, motion.cutoff)
    if motion.accelerations:
        return Trajectory.stepping(pose, twist, motion.times, motion.accelerations)
    return Trajectory.accelerating(pose, twist, (*motion.acceleration, motion.angular_acceleration))


def recorded_joints(
    kinematics: PlanarArm, times: Array, joints: Array, opening_time: float, cutoff: float
) -> MovedHand:
    """The hand of an arm's recorded joints (K, joints) [rad], in the plane that joint 1 is in.

    ValueError as `planar_joints` and `low_pass`.
    """
    throwing = planar_joints(kinematics.arm, joints)
    if not times[0] <= opening_time < times[-1]:
        raise ValueError(f"opening_time {opening_time:.12g} s is outside the recording")
    # The processing of Liu and Billard, section VI-A.
    path = Trajectory.through(*low_pass(times - opening_time, throwing, cutoff))
    return MovedHand(path, hand_motion(kinematics), kinematics.core)


def planar_joints(arm: Arm, joints: Array) -> Array:
    """The throwing joints (K, n) of recorded joints (K, joints) [rad].

    ValueError where the others do not keep the throwing posture.
    """
    throwing = [j - 1 for j in arm.throwing_joints]
    for joint in range(arm.joints):
        if joint in throwing or joint == arm.azimuth_joint - 1:
            continue
        away = np.abs(joints[:, joint] - arm.posture[joint]).max()
        if away > POSTURE_ROOM:
            hint = " (is it in degrees?)" if away > math.tau else ""
            raise ValueError(
                f"joints: joint {joint + 1} is {away:.2f} rad from the throwing posture, at "
                f"most {POSTURE_ROOM} is allowed{hint}"
            )
    turning = np.ptp(joints[:, arm.azimuth_joint - 1])
    if turning > POSTURE_ROOM:
        raise ValueError(
            f"joints: joint {arm.azimuth_joint} turns the throw's plane by {turning:.2f} rad, at "
            f"most {POSTURE_ROOM} is allowed"
        )
    return joints[:, throwing]


def named_model(
    name: str, known: Mapping[str, ReleaseModel], allowed: str = "", prefix: str = ""
) -> ReleaseModel:
    """The model of that name.

    InputError for a name that is not `known`, with what is `allowed`; `prefix` as on the
    command line.
    """
    if name not in known:
        allowed = allowed or f"one of {', '.join(known)}"
        raise InputError(
            f"{prefix}model = {name!r}: must be {allowed}{InputError.hint(str(name), known)}"
        )
    return known[name]


@dataclass(frozen=True)
class Simulation:
    """One release by one model; landing is None where the scene gives no height."""

    model: str
    release: Release = field(repr=False)
    landing: LandingPoint | None
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """SI units, radians; events in s from the start of the opening."""
        end = self.release.detach
        detach = {"x": end.x, "z": end.z, "theta": end.theta}
        detach |= {"vx": end.v_x, "vz": end.v_z, "omega": end.omega}
        land = self.landing
        pose = None if land is None else {"x": land.x, "z": land.z, "theta": land.theta}
        return {
            "status": self.release.trouble or "ok",
            "detach": plain(detach),
            "landing": plain(pose),
            "events": {"pivot": self.release.pivot, "slide": self.release.slide},
            "time": self.seconds,
        }


def simulate(
    scene: Scene | str | pathlib.Path, model: str | type[SlidingPivot] = "all"
) -> dict[str, Simulation]:
    """The [motion] of a scene, built-in name or TOML file through a release model.

    model: a name of MODELS, 'all', or a law of one's own (see `Planner`). With [contact] shape
    'ls-step' is the only one.
    Raises InputError for a scene without a motion and for an unknown model.
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    case, shape, known = case_of(scene, given_hand(scene)), scene.contact.surface, MODELS
    names = f"all or one of {', '.join(MODELS)}"
    if shape is not None:
        stepped = MODELS[STEPPED_SURFACE]
        known = {stepped.name: replace(stepped, model=ShapedRelease(shape))}
        names = f"all or {stepped.name}, which alone knows [contact] shape"
    if isinstance(model, type):
        return {model.__name__: _simulated(scene, own_model(model), case)}
    if model == "all":
        return {name: _simulated(scene, known[name], case) for name in known}
    return {model: _simulated(scene, named_model(model, known, names), case)}


def _simulated(scene: Scene, model: ReleaseModel, case: ReleaseCase) -> Simulation:
    start = time.perf_counter()
    release = model.with_pressure(scene.contact.pressure).release(case)
    height = None if scene.target is None else scene.target.z
    land = None if height is None else LandingPoint.of(release, height, FlightLaw(scene.gravity))
    return Simulation(model.name, release, land, time.perf_counter() - start)


# Arrays of throws.


@dataclass(frozen=True)
class BatchResult(ReadOnly):
    """Detach states and landings of N throws.

    detach (N, 6): x, z, theta, v_x, v_z, omega of the CoM; landing (N, 3): x, theta and
    flight time [s] at the scene's landing height, NaN where a throw never comes down
    through it; None where the scene gives no height. trouble (N,): why a throw is not to
    be trusted, in the words of the single models' status; empty where it is.
    """

    detach: Array
    landing: Array | None
    trouble: npt.NDArray[np.object_]


@runtime_checkable
class SendsThrow(Protocol):
    """A plan."""

    def sent_throw(self) -> Throw:
        """The throw that is sent; InputError without one."""


def simulate_batch(
    source: Scene | str | pathlib.Path | Throw | SendsThrow,
    model: str = SLIDING_PIVOT,
    *,
    hand: Mapping[str, npt.ArrayLike] | None = None,
    delays: npt.ArrayLike = 0.0,
    steps: int | None = None,
    executor: Executor | None = None,
    **values: npt.ArrayLike,
) -> BatchResult:
    """N different throws through a release model.

    source: a scene, built-in name or TOML file; or a plan, or the throw of one, whose hand moves as
    it is sent. hand, for a scene: `pose`, `twist`, `acceleration`, each (N, 3) (constant
    acceleration from the opening's start), or `times` (K,) and `poses` (N, K, 3) or (1, K, 3)
    (cubic splines); the scene's [motion] where left out. delays [s]: by which the opening starts
    later on the hand's motion.
    values: mass [kg], inertia [kg m^2], com_offset [m], friction, patch_radius [m], torsion, faces,
    force [N] of one pad, opening [s]; the scene's where left out. Values and delays are numbers or
    arrays (N,).
    steps: of the opening, instead of the model's usual ones; `ls-step` takes twice as many
    too and extrapolates, `sp` doubles them for throws that swing fast.
    executor: spreads chunks over its workers; the result does not depend on it.
    Raises InputError for unknown names, unequal lengths, NaN, times that do not rise, a motion that
    does not cover the opening, and a plan without a throw.
    """
    source = source.sent_throw() if isinstance(source, SendsThrow) else source
    throw = source if isinstance(source, Throw) else None
    scene = source.scene if isinstance(source, Throw) else as_scene(source)
    chosen = named_model(model, BATCH_MODELS).with_pressure(scene.contact.pressure)
    checked("steps", steps, int | None, {"least": 1, "most": MOST_STEPS})
    batch = _batch(scene, throw, hand or {}, _array("delays", delays), values)
    run = partial(chosen.throw, steps=steps or 0)
    if executor is None:
        release = run(batch)
    else:
        shares = np.array_split(np.arange(batch.count), max(batch.count // 4096, 1))
        release = BatchRelease.joined(list(executor.map(run, map(batch.part, shares))))
    height = None if scene.target is None else scene.target.z
    flight = FlightLaw(scene.gravity) if throw is None else scene.flight
    landing = None if height is None else flight.land(release.detach, height)
    return BatchResult(release.detach, landing, release.trouble)


def _batch(
    scene: Scene,
    throw: Throw | None,
    hand: Mapping[str, Any],
    delays: Array,
    given: Mapping[str, npt.ArrayLike],
) -> ReleaseBatch:
    """N releases; given: numbers or arrays (N,) by name."""
    profile = scene.gripper.profile()
    own = asdict(scene.body) | asdict(scene.patch)
    own |= {"force": profile.full, "opening": profile.opening}
    values = _numbers(own, given)
    lengths = {name: value.size for name, value in values.items() if value.ndim}
    if delays.ndim > 1:
        raise InputError("delays: must be a number or an array (N,)")
    if delays.ndim:
        lengths["delays"] = delays.size
    if throw is None:
        hands, hand_lengths = _hands(scene, hand)
        lengths |= hand_lengths
    elif hand:
        raise InputError("hand: a plan's hand moves as it is sent: leave it out")
    else:
        longest = float(np.max(values.get("opening", profile.opening)))
        hands = _sent_hand(throw, float(delays.min()), float(delays.max()), longest)
    count = max(lengths.values(), default=1)
    for name, length in lengths.items():
        if length != count:
            raise InputError(f"{name}: has {length} entries, other arrays have {count}")
    full = {
        name: np.broadcast_to(values.get(name, np.asarray(value, float)), count).copy()
        for name, value in own.items()
    }
    opening, force = full.pop("opening"), full.pop("force")
    hands = hands.shifted(np.broadcast_to(delays, count))
    _check_cover(hands, opening)
    body = Body(**{name: full.pop(name) for name in asdict(scene.body)})
    gravity, angle = scene.gravity, scene.grasp.angle
    return ReleaseBatch(
        count, body, PinchContact(**full), profile, hands, opening, force, gravity, angle
    )


def _sent_hand(throw: Throw, early: float, late: float, longest: float) -> Trajectory:
    """The hand of a throw, counted from its opening, for these delays and openings [s]."""
    if any(throw.error):
        raise InputError("the throw has errors of the hand: take the plan that it is of")
    return ThrowBatch.of(throw, throw.target, (), (early, late, longest)).hands


def _numbers(known: Mapping[str, float], values: Mapping[str, npt.ArrayLike]) -> dict[str, Array]:
    """Checked numbers or arrays (N,), all above zero (com_offset: at least)."""
    result = {}
    for name, value in values.items():
        if name not in known:
            hint = InputError.hint(name, known)
            raise InputError(f"{name}: unknown name (known: {', '.join(known)}){hint}")
        array = _array(name, value)
        if array.ndim > 1:
            raise InputError(f"{name}: must be a number or an array (N,)")
        if (array < 0).any() or (name != "com_offset" and (array == 0).any()):
            raise InputError(f"{name}: must be above 0")
        result[name] = array
    return result


def _hands(scene: Scene, hand: Mapping[str, Any]) -> tuple[Trajectory, dict[str, int]]:
    """The hand motions, and the lengths of the arrays that tell N."""
    for name in hand:
        if name not in _HAND + _SAMPLED:
            known = ", ".join(_HAND + _SAMPLED)
            raise InputError(f"hand: unknown key '{name}' (known: {known})")
    if any(name in hand for name in _SAMPLED):
        return _sampled(hand)
    motion = scene.motion
    if motion is not None and not hand and (motion.samples or motion.accelerations):
        # One motion for all throws, as dense samples.
        opening = scene.gripper.profile().opening
        times = np.linspace(0.0, opening, GIVEN_SAMPLES)
        return Trajectory.through(times, given_hand(scene).at(times).pose.T), {}
    if motion is None and "pose" not in hand:
        raise InputError(f"{scene.place}: has no [motion]: give hand pose, twist, acceleration")
    defaults: dict[str, Any] = {name: np.zeros(3) for name in _HAND}
    if motion is not None:
        defaults = {
            "pose": (*motion.position, motion.angle),
            "twist": (*motion.velocity, motion.rate),
            "acceleration": (*motion.acceleration, motion.angular_acceleration),
        }
    arrays = {name: _array(f"hand.{name}", hand.get(name, defaults[name])) for name in _HAND}
    for name, array in arrays.items():
        if array.ndim not in (1, 2) or array.shape[-1] != 3:
            raise InputError(f"hand.{name}: must be an array (N, 3), has shape {array.shape}")
    lengths = {f"hand.{name}": len(array) for name, array in arrays.items() if array.ndim == 2}
    count = max(lengths.values(), default=1)
    if set(lengths.values()) - {count}:
        raise InputError(f"hand: arrays of unequal length {sorted(set(lengths.values()))}")
    return Trajectory.accelerating(*(arrays[name] for name in _HAND)), lengths


def _check_cover(hands: Trajectory, opening: Array) -> None:
    """InputError if sampled hands end before an opening does, or begin after its start."""
    begin, end = float(hands.breaks[0]), hands.end
    first, last = float(np.min(hands.delays)), float(np.max(hands.delays + opening))
    if first < begin - 1e-9 or last > end + 1e-9:
        raise InputError(
            f"hand: its motion must cover {first:g} to {last:g} s, it covers {begin:g} to {end:g} s"
        )


def _sampled(hand: Mapping[str, Any]) -> tuple[Trajectory, dict[str, int]]:
    if any(name in hand for name in _HAND):
        raise InputError("hand: give pose, twist, acceleration or times, poses, not both")
    if "times" not in hand or "poses" not in hand:
        raise InputError("hand: a sampled motion needs 'times' and 'poses'")
    times, poses = _array("hand.times", hand["times"]), _array("hand.poses", hand["poses"])
    if times.ndim != 1 or times.size < 4:
        raise InputError("hand.times: must be an array (K,) of at least four times")
    if (np.diff(times) <= 0).any():
        raise InputError("hand.times: must rise from sample to sample")
    if poses.ndim != 3 or poses.shape[1:] != (times.size, 3):
        raise InputError(f"hand.poses: must be (N, {times.size}, 3), has shape {poses.shape}")
    lengths = {"hand.poses": len(poses)} if len(poses) > 1 else {}
    return Trajectory.through(times, poses), lengths


def _array(name: str, value: Any) -> Array:
    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: must be numbers") from None
    if not array.size or not np.isfinite(array).all():
        raise InputError(f"{name}: must be finite numbers")
    return array
