"""An arm from a URDF's chain: throwing joints, limits from file and user, masses."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array
from ...planner import PlanarArm, SpatialArm
from ...problems import Arm, InputError, JointLimits, LinkInertia, Tool
from .chain import EXACT, MissingOptionError, UrdfChain, joint_named
from .holding import joint_range

#: One value per joint; None without an option for it.
Given = Sequence[float | None]
#: Mass [kg], CoM (3,) [m] and inertia about it (3, 3) [kg m^2] of a body.
Body = tuple[float, Array, Array]

#: Options for limits by their names in an arm data file, in the order of `JointLimits`.
LIMIT_OPTIONS = {
    "position_min": "--position-min-deg",
    "position_max": "--position-max-deg",
    "velocity": "--velocity",
    "acceleration": "--acceleration",
    "jerk": "--jerk",
    "torque": "--torque",
}
#: Proposed limits, of a slow arm of medium size, in the options' units [deg; rad/s^k; N m].
PROPOSED = dict(zip(LIMIT_OPTIONS, ("-180", "180", "1", "10", "1000", "50"), strict=True))
#: Number of random joint states in the comparison with yourdfpy.
STATES = 24
#: Number of random states at rest, and gravity [m/s^2], of the torques that hold the arm.
REST_STATES, GRAVITY = 1000, 9.81
#: Largest cosine of perpendicular axes, and largest deviation from 1 of parallel ones.
ALIGNED = 1e-6
CHANGE = "; change --azimuth, --throwing, --posture-deg, --tool or --approach"


@dataclass(frozen=True)
class Choices:
    """Properties that a URDF does not have; None or empty: derived from the chain.

    throwing: joint names; posture [rad]: a value per joint. tcp [m]: from the tool
    link to the pads' centre along the approach direction; palm [m]: back, front and half
    width, as in `Tool`, None for a hand without a body.
    """

    name: str
    throwing: tuple[str, ...] = ()
    posture: tuple[float, ...] = ()
    tcp: float = 0.0
    palm: tuple[float, float, float] | None = None


def limits_of(chain: UrdfChain, given: Mapping[str, Given]) -> JointLimits:
    """The joints' limits: given ones, else the file's.

    given: by the names in `LIMIT_OPTIONS`, in SI units. MissingOptionError with all limits in
    neither.
    """
    limits: dict[str, tuple[float, ...]] = {}
    missing, proposals = list[str](), dict[str, list[str]]()
    for name, option in LIMIT_OPTIONS.items():
        own = [_in_file(joint, name) for joint in chain.joints]
        more = given.get(name, [None] * len(own))
        values = [a if b is None else b for a, b in zip(own, more, strict=True)]
        lacking = [joint for joint, v in zip(chain.names, values, strict=True) if v is None]
        if lacking:
            every = len(lacking) == len(values)
            missing.append(f"{option} ({name} of {'all joints' if every else ', '.join(lacking)})")
            unit = math.radians(1.0) if name.startswith("position") else 1.0
            said = ["-" if value is None else f"{value / unit:.15g}" for value in more]
            proposed = [
                PROPOSED[name] if v is None else word for v, word in zip(values, said, strict=True)
            ]
            proposals[option] = proposed[:1] if every else proposed
        limits[name] = tuple(v for v in values if v is not None)
    if missing:
        raise MissingOptionError(
            f"limits are missing that the URDF does not hold; the robot's data sheet has them: "
            f"{', '.join(missing)}",
            proposals,
        )
    for name, option in LIMIT_OPTIONS.items():
        for joint, value in zip(chain.names, limits[name], strict=True):
            if not name.startswith("position") and value <= 0:
                raise InputError(f"{option}: {value:g} for '{joint}': must be above 0")
    low, high, velocity, acceleration, jerk, torque = (limits[name] for name in LIMIT_OPTIONS)
    for joint, *ends in zip(chain.names, low, high, strict=True):
        if ends[0] >= ends[1]:
            first, last = map(math.degrees, ends)
            raise InputError(f"--position-min-deg: {first:g} for '{joint}': must be below {last:g}")
    return JointLimits(low, high, velocity, acceleration, jerk, torque)


def arm_of(chain: UrdfChain, limits: JointLimits, choices: Choices) -> Arm:
    """The arm; InputError if it does not throw in a vertical plane of its azimuth joint."""
    *joints, mount = chain.frames()
    # A hand without a palm is a point, at least 0.1 m behind the pads.
    behind = max(choices.tcp, 0.1)
    palm = choices.palm or (behind, behind, 0.0)
    tool = Tool(0.0, 0.0, choices.tcp, *palm, xyz=mount.xyz, rpy=mount.rpy)
    azimuth = _number(chain, "--azimuth", chain.azimuth)
    bare = chain.flange == chain.tool and not choices.tcp and choices.palm is None
    draft = Arm(
        name=choices.name,
        description=f"{choices.name}, joints {', '.join(chain.names)}",
        chain=tuple(joints),
        tool=tool,
        limits=limits,
        azimuth_joint=azimuth,
        throwing_joints=tuple(_number(chain, "--throwing", name) for name in choices.throwing),
        posture=choices.posture or _posture(limits),
        links=link_inertias(chain),
        joint_names=chain.names,
        hand=None if bare else chain.tool,
        hand_links=chain.hand_links,
    )
    throwing = draft.throwing_joints
    if len(set(throwing)) < len(throwing) or min(throwing, default=azimuth + 1) <= azimuth:
        raise InputError(
            f"--throwing: must name joints once each, behind '{chain.azimuth}' that turns the plane"
        )
    _check_base(draft, chain)
    if throwing:
        _check_posture(draft, chain)
    quarters = () if choices.posture else (math.pi, math.pi / 2, -math.pi / 2)
    arm = _find_planar_posture(draft, quarters)
    _check_posture(arm, chain)
    try:
        PlanarArm(arm)
    except ValueError as error:
        axes = np.array([pose[:3, 2] for pose in arm.placed(arm.posture)])
        first = arm.throwing_joints[0]
        tilts = [_tilt(arm, axes, axes[first - 1], j) for j in (*arm.throwing_joints, None)]
        # Where they agree, the first is off the plane along x.
        tilts.append(_tilt(arm, axes, np.array([0.0, 1.0, 0.0]), first))
        words = next((words for angle, words in tilts if angle > EXACT), tilts[-1][1])
        raise InputError(f"{error}: {words}{CHANGE}") from None
    return arm


def weak_joints(arm: Arm) -> dict[str, tuple[float, float]]:
    """Joints too weak to hold the arm at rest wherever its throwing joints may be: largest torque
    and limit [N m] by name. Empty for an arm without masses."""
    if not arm.links:
        return {}
    low, high = np.array(arm.limits.position_min), np.array(arm.limits.position_max)
    q, moving = np.tile(arm.posture, (REST_STATES, 1)), np.array(arm.throwing_joints) - 1
    q[:, moving] = np.random.default_rng(0).uniform(low, high, q.shape)[:, moving]
    still, nothing = np.zeros_like(q), np.zeros((REST_STATES, 6))
    needed = np.abs(SpatialArm(arm).torques(q, still, still, GRAVITY, nothing)).max(axis=0)
    rows = zip(arm.joint_names, needed.tolist(), arm.limits.torque, strict=True)
    return {name: (torque, limit) for name, torque, limit in rows if torque > limit}


def kinematics_difference(arm: Arm, chain: UrdfChain) -> float:
    """Largest difference [m; -] of the arm's kinematics to yourdfpy's at random joint states.

    Of the joints' origins and axes, and of the hand's pose.
    """
    q = ca.SX.sym("q", arm.joints)
    function = ca.Function("frames", [q], arm.frames(q))
    reach = np.eye(4)
    reach[2, 3] = arm.tool.tcp
    low, high = np.array(arm.limits.position_min), np.array(arm.limits.position_max)
    largest = 0.0
    for state in np.random.default_rng(0).uniform(low, high, (STATES, arm.joints)):
        *frames, _, tcp = (np.array(pose) for pose in function(state))
        origins, axes, hand = chain.posed(state)
        for frame, place, axis in zip(frames, origins, axes, strict=True):
            largest = max(
                largest, np.abs(frame[:3, 3] - place).max(), np.abs(frame[:3, 2] - axis).max()
            )
        largest = max(largest, np.abs(tcp - hand @ reach).max())
    return float(largest)


def _in_file(joint: Any, name: str) -> float | None:
    """A joint's limit in the URDF; None without a meaningful one."""
    if name.startswith("position"):
        ends = joint_range(joint)
        if ends is None or ends[0] == ends[1]:
            return None
        return ends[0] if name == "position_min" else ends[1]
    if joint.limit is None:
        return None
    value = {"velocity": joint.limit.velocity, "torque": joint.limit.effort}.get(name)
    return None if value is None or not value > 0 or not math.isfinite(value) else float(value)


def _number(chain: UrdfChain, option: str, name: str) -> int:
    """The number, from 1, of the chosen joint that an option names."""
    return chain.names.index(joint_named(chain.names, option, name)) + 1


def _posture(limits: JointLimits) -> tuple[float, ...]:
    """0 where the limits allow it, else their middle."""
    pairs = zip(limits.position_min, limits.position_max, strict=True)
    return tuple(0.0 if low <= 0 <= high else (low + high) / 2 for low, high in pairs)


def _check_base(arm: Arm, chain: UrdfChain) -> None:
    """InputError unless the azimuth joint turns about the base's z axis."""
    pose = arm.placed(arm.posture)[arm.azimuth_joint - 1]
    if np.abs(pose[:2, [2, 3]]).max() > EXACT:
        raise InputError(
            f"joint '{chain.names[arm.azimuth_joint - 1]}' does not turn about the z axis, which "
            f"is upright, of link '{chain.base}': choose another --azimuth or --base"
        )


def _find_planar_posture(arm: Arm, ways: Sequence[float]) -> Arm:
    """The arm with the posture in which the most joints throw in one vertical plane.

    Postures in which the pads close across the plane come first. ways [rad]: what joints that do
    not throw may keep, besides the posture's own angle; the least turns first; none: the posture is
    given. The azimuth joint's angle turns the plane along x. InputError where the hand is in no
    such plane.
    """
    q = ca.SX.sym("q", arm.joints)
    function = ca.Function("axes", [q], [ca.horzcat(*(pose[:3, 2] for pose in arm.frames(q)))])
    low, high = arm.limits.position_min, arm.limits.position_max
    postures: list[tuple[int, float, Array, tuple[int, ...], Array]] = []
    misses = list[tuple[int, float, str]]()
    todo: list[tuple[int, Array, tuple[int, ...], Array | None]] = [
        (1, np.array(arm.posture), (), None)
    ]
    while todo:
        joint, posture, throwing, normal = todo.pop()
        axes = np.array(function(posture)).T
        if joint > arm.joints:
            enough = len(throwing) >= len(arm.throwing_joints)
            if enough and normal is not None and abs(axes[-1] @ normal) < ALIGNED:
                turned = np.abs(
                    np.delete(posture, [arm.azimuth_joint - 1, *np.array(throwing) - 1])
                )
                postures.append((-len(throwing), float(turned.sum()), posture, throwing, normal))
            able = arm.throwing_joints or range(arm.azimuth_joint + 1, arm.joints + 1)
            others = {*able} - {*throwing}
            tilts = [(j, *_tilt(arm, axes, normal, j)) for j in others]
            misses += [tilt for tilt in tilts if tilt[1] < math.pi / 4]
            if normal is not None:
                misses.append((arm.joints + 1, *_tilt(arm, axes, normal, None)))
            continue
        axis, behind = axes[joint - 1], joint > arm.azimuth_joint
        throws = behind and joint in (arm.throwing_joints or (joint,))
        level = abs(axis[2]) < ALIGNED if normal is None else abs(axis @ normal) > 1 - ALIGNED
        if throws and level:
            todo.append((joint + 1, posture, (*throwing, joint), axis))
        if not (throws and level) or normal is None:
            turns = ways if behind and not level else ()
            for angle in [*turns, posture[joint - 1]]:
                if angle == posture[joint - 1] or low[joint - 1] <= angle <= high[joint - 1]:
                    other = posture.copy()
                    other[joint - 1] = angle
                    todo.append((joint + 1, other, throwing, normal))
    if not postures:
        raise InputError(
            f"arm {arm.name}: its joints do not move the hand in the vertical plane of the azimuth "
            f"joint: {min(misses, default=(0, 0.0, 'no axis behind it is level'))[2]}{CHANGE}"
        )
    first: Arm | None = None
    for _, _, posture, throwing, normal in sorted(postures, key=lambda each: each[:2]):
        up = float(np.array(function(posture))[2, arm.azimuth_joint - 1])
        found = _turned_along_x(arm, posture, math.atan2(normal[1], normal[0]), up)
        found = dataclasses.replace(found, throwing_joints=throwing)
        if ways:
            found = dataclasses.replace(found, posture=_pads_in_plane(found))
        first = first or found
        if abs(found.placed(found.posture)[-1][1, 1]) > 1 - EXACT:
            return found
    assert first is not None
    return first


def _turned_along_x(arm: Arm, posture: Array, normal: float, up: float) -> Arm:
    """The arm in a posture whose plane, with a normal at an angle [rad], is turned along x.

    up: z of the azimuth joint's axis. The least turn that its limits allow, if any.
    """
    turn, at = math.pi / 2 - normal, arm.azimuth_joint - 1
    low, high = arm.limits.position_min[at], arm.limits.position_max[at]
    angles = [posture[at] + up * (turn + k * math.pi) for k in (0, -1, 1, -2)]
    angles = [0.0 if abs(angle) < 1e-12 else angle for angle in angles]
    posture[at] = min(angles, key=lambda angle: (not low <= angle <= high, abs(angle)))
    return dataclasses.replace(arm, posture=tuple(posture.tolist()))


def _tilt(arm: Arm, axes: Array, normal: Array | None, joint: int | None) -> tuple[float, str]:
    """How far [rad] a joint, None: the hand, is off the plane of a normal, and words that say it.

    axes (joints + 2, 3): of the joints, then of the hand; normal None: any level one.
    """
    axis = axes[-1 if joint is None else joint - 1]
    if joint is None:
        assert normal is not None
        angle = abs(math.asin(np.clip(axis @ normal, -1.0, 1.0)))
        return angle, f"the hand points {math.degrees(angle):.3g} deg out of it"
    if normal is None:
        angle, what = abs(math.asin(np.clip(axis[2], -1.0, 1.0))), "level"
    else:
        angle = math.atan2(float(np.linalg.norm(np.cross(axis, normal))), abs(float(axis @ normal)))
        what = "its normal"
    name = arm.joint_names[joint - 1]
    return angle, f"the axis of '{name}' is {math.degrees(angle):.3g} deg off {what}"


def _pads_in_plane(arm: Arm) -> tuple[float, ...]:
    """The posture with the hand rolled so that its pads close across the plane, if it can."""
    frames, posture = arm.placed(arm.posture), list(arm.posture)
    approach, closing = frames[-1][:3, 2], frames[-1][:3, 1]
    for i in range(arm.joints - 1, max(arm.throwing_joints) - 1, -1):
        axis = frames[i][:3, 2]
        if i == arm.azimuth_joint - 1 or abs(axis @ approach) < 1 - 1e-9:
            continue
        roll = math.atan2(np.cross(axis, closing)[1], closing[1])
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
    """The body that each chosen joint moves, up to the next, then the hand, in the arm's frames.

    Links on fixed joints, and on joints that are held, count to the body that moves them; the hand
    is that of `UrdfChain.numbers`. Empty if the file has no masses.
    """
    robot, frames = chain.robot, chain.body_frames
    robot.update_cfg(dict.fromkeys(robot.actuated_joint_names, 0.0))
    bodies = [list[Body]() for _ in frames]
    for link, number in chain.numbers.items():
        frame, turn = frames[number]
        at = np.linalg.inv(turn) @ robot.get_transform(link, frame)
        bodies[number] += _body(robot.link_map[link], at)
    inertias = tuple(map(_merge_bodies, bodies[1:]))
    return inertias if any(link.mass for link in inertias) else ()


def _body(link: Any, at: Array) -> Iterator[Body]:
    """The mass, CoM and inertia of a link at pose `at`; none of a link without a mass."""
    inertial = link.inertial
    if inertial is not None and inertial.mass is not None:
        if not inertial.mass >= 0:
            raise InputError(f"link '{link.name}': mass = {inertial.mass:g}: must be at least 0")
        pose = at if inertial.origin is None else at @ np.asarray(inertial.origin)
        own = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia)
        turn = pose[:3, :3]
        yield float(inertial.mass), pose[:3, 3], turn @ own @ turn.T


def _merge_bodies(bodies: list[Body]) -> LinkInertia:
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
