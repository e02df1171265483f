"""An arm from a URDF's chain: what moves in the throw, limits from file and user, masses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import Arm, JointFrame, JointLimits, LinkInertia, PlanarArm, Tool
from ..section import InputError
from .chain import UrdfChain, hanging, origin

Array = npt.NDArray[np.float64]
#: A value per joint, None where there is none.
Given = Sequence[float | None]

#: Limits by their names in an arm data file, in the order of `JointLimits`, with the options
#: that give them.
LIMIT_OPTIONS = {
    "position_min": "--position-min-deg",
    "position_max": "--position-max-deg",
    "velocity": "--velocity",
    "acceleration": "--acceleration",
    "jerk": "--jerk",
    "torque": "--torque",
}
#: Joint states at which the written file is held against yourdfpy, and how far it may be off.
STATES, EXACT = 24, 1e-9
#: Without a palm the hand is a point this far [m] behind the pads at least, off the bar.
NO_PALM = 0.1


@dataclass(frozen=True)
class Choices:
    """What a URDF does not say; None or empty: found from the chain.

    azimuth, throwing: joint names; posture [rad]: a value per joint. tcp [m]: from the tool
    link to the pads' centre along the approach direction; palm [m]: back, front and half
    width, as in `Tool`, None for a hand without a body.
    """

    name: str
    azimuth: str | None = None
    throwing: tuple[str, ...] = ()
    posture: tuple[float, ...] = ()
    tcp: float = 0.0
    palm: tuple[float, float, float] | None = None


def limits_of(chain: UrdfChain, given: Mapping[str, Given]) -> JointLimits:
    """The joints' limits: given ones before the file's; InputError naming all that are missing.

    given: by the names in `LIMIT_OPTIONS`, in SI units.
    """
    found: dict[str, tuple[float, ...]] = {}
    missing = []
    for name, option in LIMIT_OPTIONS.items():
        own = [_in_file(joint, name) for joint in chain.joints]
        more = given.get(name, [None] * len(own))
        values = [a if b is None else b for a, b in zip(own, more, strict=True)]
        lacking = [joint for joint, v in zip(chain.names, values, strict=True) if v is None]
        if lacking:
            who = "all joints" if len(lacking) == len(values) else ", ".join(lacking)
            missing.append(f"{name} of {who} ({option})")
        found[name] = tuple(v for v in values if v is not None)
    if missing:
        raise InputError(f"limits that the URDF lacks must be given: {'; '.join(missing)}")
    for name, option in LIMIT_OPTIONS.items():
        for joint, value in zip(chain.names, found[name], strict=True):
            if not name.startswith("position") and value <= 0:
                raise InputError(f"{option}: {value:g} for '{joint}': must be above 0")
    for joint, *ends in zip(chain.names, found["position_min"], found["position_max"], strict=True):
        if ends[0] >= ends[1]:
            first, last = map(math.degrees, ends)
            words = f"{first:g} for '{joint}': must be below {last:g}"
            raise InputError(f"--position-min-deg: {words}")
    low, high, velocity, acceleration, jerk, torque = (found[name] for name in LIMIT_OPTIONS)
    return JointLimits(low, high, velocity, acceleration, jerk, torque)


def arm_of(chain: UrdfChain, limits: JointLimits, choices: Choices) -> Arm:
    """The arm; InputError if it does not throw in a vertical plane of its azimuth joint."""
    *joints, mount = chain.frames()
    behind = max(choices.tcp, NO_PALM)
    palm = choices.palm or (behind, behind, 0.0)
    tool = Tool(0.0, 0.0, choices.tcp, *palm, xyz=mount.xyz, rpy=mount.rpy)
    azimuth = 1 if choices.azimuth is None else _number(chain, "--azimuth", choices.azimuth)
    posture = choices.posture or _posture(limits)
    words = f"{choices.name}, joints {', '.join(chain.names)}"
    masses = link_inertias(chain)
    draft = Arm(choices.name, words, tuple(joints), tool, limits, azimuth, (), posture, masses)
    axes, hand = _at_posture(draft)
    _check_base(draft, chain)
    throwing = tuple(_number(chain, "--throwing", name) for name in choices.throwing)
    if azimuth in throwing or len(set(throwing)) < len(throwing):
        raise InputError("--throwing: must name joints once each, and not the azimuth joint")
    if not throwing:
        across = np.abs(axes[:, 1]) > 1 - 1e-6
        throwing = tuple(i for i in range(1, draft.joints + 1) if across[i - 1] and i != azimuth)
    if not throwing:
        raise InputError(
            "no joint's axis is normal to the plane y = 0 at the posture: give --posture-deg, "
            "--throwing or --azimuth"
        )
    if not choices.posture:
        posture = _pads_in_plane(draft, axes, hand, max(throwing))
    arm = Arm(choices.name, words, tuple(joints), tool, limits, azimuth, throwing, posture, masses)
    _check_posture(arm, chain)
    try:
        PlanarArm(arm)
    except ValueError as error:
        raise InputError(
            f"{error}; change --azimuth, --throwing, --posture-deg, --tool or --approach"
            f"{_rounded(arm)}"
        ) from None
    return arm


def kinematics_difference(arm: Arm, chain: UrdfChain, states: int = STATES) -> float:
    """Largest difference [m; -] of the arm's kinematics to yourdfpy's at random joint states.

    Of the joints' origins and axes, and of the hand's pose.
    """
    q = ca.SX.sym("q", arm.joints)
    function = ca.Function("frames", [q], arm.frames(q))
    reach = np.eye(4)
    reach[2, 3] = arm.tool.tcp
    low, high = np.array(arm.limits.position_min), np.array(arm.limits.position_max)
    most = 0.0
    for state in np.random.default_rng(0).uniform(low, high, (states, arm.joints)):
        *frames, _, tcp = (np.array(pose) for pose in function(state))
        origins, axes, hand = chain.posed(state)
        for frame, place, axis in zip(frames, origins, axes, strict=True):
            most = max(most, np.abs(frame[:3, 3] - place).max(), np.abs(frame[:3, 2] - axis).max())
        most = max(most, np.abs(tcp - hand @ reach).max())
    return float(most)


def _in_file(joint: object, name: str) -> float | None:
    """A joint's limit in the URDF; None where it has none that means anything."""
    limit = getattr(joint, "limit", None)
    if limit is None:
        return None
    if name.startswith("position"):
        low, high = limit.lower or 0.0, limit.upper or 0.0
        if getattr(joint, "type", "") == "continuous" or not low < high:
            return None
        return float(low if name == "position_min" else high)
    value = {"velocity": limit.velocity, "torque": limit.effort}.get(name)
    return None if value is None or not value > 0 or not math.isfinite(value) else float(value)


def _number(chain: UrdfChain, option: str, name: str) -> int:
    """The number, from 1, of the chosen joint that an option names."""
    if name not in chain.names:
        raise InputError(f"{option}: no joint '{name}' among --joints {' '.join(chain.names)}")
    return chain.names.index(name) + 1


def _posture(limits: JointLimits) -> tuple[float, ...]:
    """0 where the limits allow it, else their middle."""
    pairs = zip(limits.position_min, limits.position_max, strict=True)
    return tuple(0.0 if low <= 0 <= high else (low + high) / 2 for low, high in pairs)


def _at_posture(arm: Arm) -> tuple[Array, Array]:
    """Joint axes (n, 3) and the hand's rotation (3, 3) at the posture and azimuth 0."""
    posture = np.array(arm.posture)
    posture[arm.azimuth_joint - 1] = 0.0
    frames = [np.array(ca.evalf(pose)) for pose in arm.frames(ca.SX(ca.DM(posture)))]
    return np.array([pose[:3, 2] for pose in frames[: arm.joints]]), frames[-1][:3, :3]


def _check_base(arm: Arm, chain: UrdfChain) -> None:
    """InputError unless the azimuth joint turns about the base's z axis."""
    pose = np.array(ca.evalf(arm.frames(ca.SX(ca.DM(list(arm.posture))))[arm.azimuth_joint - 1]))
    if np.abs(pose[:2, 3]).max() > EXACT or np.abs(pose[:3, 2] - [0, 0, 1]).max() > EXACT:
        raise InputError(
            f"joint '{chain.names[arm.azimuth_joint - 1]}' does not turn upwards about the z axis "
            f"of link '{chain.base}': choose another --azimuth or --base{_rounded(arm)}"
        )


def _rounded(arm: Arm) -> str:
    """A hint where the URDF has right angles like 1.5708: these bend the plane."""
    for joint in arm.chain:
        for angle in joint.rpy if isinstance(joint, JointFrame) else ():
            off = abs(angle - round(angle / (math.pi / 2)) * math.pi / 2)
            if 1e-10 < off < 1e-3:
                return "; or write the URDF's right angles in full, 1.5707963267948966"
    return ""


def _pads_in_plane(arm: Arm, axes: Array, hand: Array, last: int) -> tuple[float, ...]:
    """The posture with the hand rolled so that its pads close across the plane, if it can."""
    posture = list(arm.posture)
    for i in range(arm.joints - 1, last - 1, -1):
        if i == arm.azimuth_joint - 1 or abs(axes[i] @ hand[:, 2]) < 1 - 1e-9:
            continue
        closing = hand[:, 1]
        roll = math.atan2(np.cross(axes[i], closing)[1], closing[1])
        low, high = arm.limits.position_min[i], arm.limits.position_max[i]
        turns = [posture[i] + roll + k * math.pi for k in range(-3, 4)]
        inside = [turn for turn in turns if low <= turn <= high]
        if inside:
            posture[i] = min(inside, key=abs)
            posture[i] = 0.0 if abs(posture[i]) < 1e-12 else posture[i]
        break
    return tuple(posture)


def _check_posture(arm: Arm, chain: UrdfChain) -> None:
    """InputError for a joint that keeps an angle outside its limits."""
    for i, angle in enumerate(arm.posture):
        low, high = arm.limits.position_min[i], arm.limits.position_max[i]
        if i + 1 not in (arm.azimuth_joint, *arm.throwing_joints) and not low <= angle <= high:
            raise InputError(
                f"--posture-deg: {math.degrees(angle):g} for '{chain.names[i]}': must be in "
                f"[{math.degrees(low):g}, {math.degrees(high):g}]"
            )


# Masses.


def link_inertias(chain: UrdfChain) -> tuple[LinkInertia, ...]:
    """What each chosen joint moves up to the next, then the hand, in the arm's own frames.

    Links on fixed joints, and on joints held at 0, are merged into the link they hang on;
    the tool link and what hangs on it are the hand. Empty if the file has no masses.
    """
    stops = [*chain.names, *(joint.name for joint in chain.path if joint.child == chain.tool)]
    found = []
    for joint, turn in zip(chain.joints, chain.turns, strict=True):
        is_hand = joint.child == chain.tool
        bodies = [] if is_hand else list(_bodies(chain.robot, joint.child, turn.T, stops))
        found.append(_merged(bodies))
    hand = _bodies(chain.robot, chain.tool, chain.hand_turn.T, stops)
    found.append(_merged(list(hand)))
    return tuple(found) if any(link.mass for link in found) else ()


def held_joints(chain: UrdfChain) -> list[str]:
    """Names of the joints that could move and are held at 0: on the chain, or hanging on it."""
    joints = [*chain.path]
    todo = [chain.joints[0].child]
    while todo:
        for joint in hanging(chain.robot, todo.pop()):
            todo.append(joint.child)
            if joint not in chain.path:
                joints.append(joint)
    held = [j for j in joints if j.type != "fixed" and j.name not in chain.names]
    for joint in held:
        if joint.mimic is not None and joint.mimic.joint in chain.names:
            raise InputError(f"joint '{joint.name}' mimics '{joint.mimic.joint}': not supported")
    return [joint.name for joint in held]


def _bodies(
    robot: Any, link: str, at: Array, stops: list[str]
) -> Iterator[tuple[float, Array, Array]]:
    """Mass, CoM (3,) and inertia about it (3, 3) of a link at pose `at` and of all on it."""
    inertial = robot.link_map[link].inertial
    if inertial is not None and inertial.mass is not None:
        if not inertial.mass >= 0:
            raise InputError(f"link '{link}': mass = {inertial.mass:g}: must be at least 0")
        pose = at if inertial.origin is None else at @ np.asarray(inertial.origin)
        own = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia)
        turn = pose[:3, :3]
        yield float(inertial.mass), pose[:3, 3], turn @ own @ turn.T
    for joint in hanging(robot, link):
        if joint.name not in stops:
            yield from _bodies(robot, joint.child, at @ origin(joint), stops)


def _merged(bodies: list[tuple[float, Array, Array]]) -> LinkInertia:
    """Bodies as one: masses added, inertias moved to the common CoM (Steiner)."""
    mass = sum(body[0] for body in bodies)
    if not mass:
        return LinkInertia(0.0, (0.0, 0.0, 0.0), (0.0,) * 6)
    com = sum((m * at for m, at, _ in bodies), np.zeros(3)) / mass
    total = np.zeros((3, 3))
    for m, at, own in bodies:
        away = at - com
        total += own + m * (away @ away * np.eye(3) - np.outer(away, away))
    x, y, z = map(float, com)
    xx, xy, xz, yy, yz, zz = (float(total[i, j]) for i, j in zip(*np.triu_indices(3), strict=True))
    return LinkInertia(float(mass), (x, y, z), (xx, xy, xz, yy, yz, zz))
