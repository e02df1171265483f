"""A serial chain of a robot's URDF, in an arm's frames."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array
from ...problems import InputError, JointFrame
from .holding import hold_joints
from .reading import frame_of, origin, unit_axis

#: Largest difference [m; -] of kinematics that counts as none.
EXACT = 1e-9
#: The hand points along an axis of the tool link if the cosine to its child links is above this.
POINTS = 0.8
#: Names of a hand's links, of links that are likely a hand or a flange, in order of preference, and
#: of links that are neither.
HAND = r"hand|gripper|finger|knuckle|robotiq|grasp|tcp"
LIKELY = (r"tool|hand|tcp|gripper", r"flange|end_?effector|(^|_)eef?(_|$)", r"")
FINGERS = r"finger|knuckle|thumb"
#: Names of the one joint that moves a gripper's jaw.
JAW = r"gripper|finger|jaw|claw"
SENSORS = r"camera|sensor|optical|depth|lidar|(^|_)imu(_|$)"
#: A link's axes by their names in options.
AXES = {
    sign + name: (-1.0 if sign else 1.0) * np.eye(3)[i]
    for i, name in enumerate("xyz")
    for sign in ("", "-")
}


class MissingOptionError(InputError):
    """Missing options of an arm, each with a value to try.

    proposals: to be tried in turn, each words for the command line by option.
    """

    def __init__(self, words: str, *proposals: Mapping[str, list[str]]) -> None:
        super().__init__(words)
        self.proposals = proposals


@dataclass(frozen=True)
class UrdfChain:
    """The chosen joints of a URDF, from the base frame to the hand's link.

    path: all of yourdfpy's joints from the first chosen one to the tool link; joints: the chosen
    ones of them. begin (4, 4): the first one's parent link in the base frame, which is that of the
    link `base`, moved by origin (3,) [m] onto the axis of the joint `azimuth`, which turns the
    throw's plane.
    held: positions [rad or m] of all other joints that could move, by name; `robot` counts them
    from there, so that they are at 0.
    turns (4, 4) each: how an arm's joint frame, whose z is the joint's axis, lies in the
    frame of the URDF's link; hand_turn (4, 4): how the hand's frame, whose z is the
    approach direction and y the closing direction, lies in the tool link's.
    """

    robot: Any
    path: tuple[Any, ...]
    joints: tuple[Any, ...]
    base: str
    tool: str
    azimuth: str
    begin: Array
    origin: Array
    held: Mapping[str, float]
    turns: tuple[Array, ...]
    hand_turn: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the chosen joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def flange(self) -> str | None:
        """The last link on the way to the tool that is no hand's by its name, and moves no fingers;
        None: the last joint moves a hand."""
        links = [str(joint.child) for joint in self.path[self.path.index(self.joints[-1]) :]]
        on_arm = itertools.takewhile(lambda link: not self._is_hand(link), links)
        return next(reversed([*on_arm]), None)

    @property
    def numbers(self) -> dict[str, int]:
        """Which of the arm's bodies each link is part of: 0 the base, else the joint's number from
        1 that moves it, or one more than the last for links of the hand.

        The hand begins where a link that the last joint moves is a hand's by its name, or moves
        fingers, wherever the tool's frame is.
        """
        children = {str(joint.child) for joint in self.robot.robot.joints}
        todo = [str(link) for link in self.robot.link_map if link not in children]
        numbers = dict.fromkeys(todo, 0)
        moved, last = {j.child: i for i, j in enumerate(self.joints, 1)}, len(self.joints)
        while todo:
            link = todo.pop()
            if numbers[link] == last and self._is_hand(link):
                numbers[link] = last + 1
            for joint in hanging(self.robot, link):
                child = str(joint.child)
                numbers[child] = moved.get(child, numbers[link])
                todo.append(child)
        return numbers

    @property
    def fixed_links(self) -> set[str]:
        """Links behind held joints that do not carry the arm: fixed in the base's frame, but no
        part of it."""
        carrying = {joint.name for joint in _path(self.robot, str(self.path[0].parent))}
        carrying |= {joint.name for joint in _path(self.robot, self.base)}
        aside = self.held.keys() - carrying
        return {
            link
            for link, number in self.numbers.items()
            if number == 0 and any(joint.name in aside for joint in _path(self.robot, link))
        }

    @property
    def hand_links(self) -> tuple[str, ...]:
        """The links of the hand, as in `numbers`, in the file's order."""
        last, numbers = len(self.joints) + 1, self.numbers
        return tuple(str(link) for link in self.robot.link_map if numbers[link] == last)

    @property
    def body_frames(self) -> list[tuple[str, Array]]:
        """By the numbers of `numbers`: a link, and in it the frame (4, 4) of the arm's body."""
        base = np.eye(4)
        base[:3, 3] = self.origin
        names = [self.base, *(joint.child for joint in self.joints), self.tool]
        return list(zip(names, [base, *self.turns, self.hand_turn], strict=True))

    def _is_hand(self, link: str) -> bool:
        """Whether a link is a hand's by its name, or moves fingers."""
        own = (joint for joint in hanging(self.robot, link) if joint not in self.path)
        fingers = any(joint.type != "fixed" for joint in own)
        return fingers or re.search(HAND, link, re.IGNORECASE) is not None

    @property
    def length(self) -> float:
        """Distance [m] from the base link's frame to the tool link along the links, the longest
        reach."""
        return math.hypot(*self.origin) + sum(math.hypot(*frame.xyz) for frame in self.frames())

    def frames(self) -> tuple[JointFrame, ...]:
        """The arm's joint frames, then the hand's, each in the frame before, at angle 0.

        Fixed joints, and joints not chosen, are folded in.
        """
        turns = dict(zip(self.names, self.turns, strict=True))
        poses, at = [], self.begin
        for joint in self.path:
            at = at @ origin(joint)
            if joint.name in turns:
                poses.append(frame_of(at @ turns[joint.name]))
                at = turns[joint.name].T
        return (*poses, frame_of(at @ self.hand_turn))

    def posed(self, q: Sequence[float]) -> tuple[Array, Array, Array]:
        """By yourdfpy: joint origins (n, 3), axes (n, 3) and the hand's pose (4, 4).

        In the base frame, at joint angles q [rad], the other joints as held.
        """
        self.robot.update_cfg(dict(zip(self.names, map(float, q), strict=True)))
        links = [self.robot.get_transform(joint.child, self.base) for joint in self.joints]
        pairs = zip(links, self.joints, strict=True)
        axes = [link[:3, :3] @ unit_axis(joint) for link, joint in pairs]
        hand = np.array(self.robot.get_transform(self.tool, self.base) @ self.hand_turn)
        hand[:3, 3] -= self.origin
        return np.array([link[:3, 3] - self.origin for link in links]), np.array(axes), hand


def chain_of(
    robot: Any,
    names: Sequence[str],
    tool: str | None = None,
    base: str | None = None,
    approach: str | None = None,
    closing: str | None = None,
    azimuth: str | None = None,
    hold: Mapping[str, float] | None = None,
) -> UrdfChain:
    """The chain of the joints `names`, in order from the base; InputError naming the joint.

    names: numbers count the joints that turn on the way to `tool`; none: these. tool: the hand's
    link; None for the last that hangs on the last joint without a branch. base: the link whose
    frame is the arm's base, None for the root. approach, closing: axes of the tool link (`AXES`)
    along which the hand points and its pads close; None: z, and y or z, where nothing speaks
    against it. azimuth: the joint that turns the throw's plane, None for the first that is upright.
    hold: positions [rad or m] of joints that are not chosen, see `hold_joints`.
    """
    if tool is not None:
        _link(robot, "--tool", tool)
    names = _named(robot, names, tool)
    robot, held = hold_joints(robot, names, hold or {})
    chosen = [_chosen(robot, name) for name in names]
    if len(set(names)) < len(names) or len(names) < 2:
        raise InputError("--joints: must name two joints or more, each once")
    _check_serial(robot, chosen)
    tool = _last_link(robot, chosen[-1]) if tool is None else tool
    base = robot.base_link if base is None else _link(robot, "--base", base)
    path = _path(robot, tool)
    if _root(robot, tool) != _root(robot, base):
        raise InputError(f"--base {base}: no joints lead from there to the link '{tool}'")
    if chosen[-1] not in path:
        raise InputError(f"--tool {tool}: must hang on the last joint '{names[-1]}'")
    under = _path(robot, base)
    if any(joint in under for joint in chosen):
        raise InputError(f"--base {base}: must not move with the joint '{names[0]}'")
    path = path[path.index(chosen[0]) :]
    for joint in robot.robot.joints:
        if joint.mimic is not None and joint.mimic.joint in names:
            raise InputError(f"joint '{joint.name}' mimics '{joint.mimic.joint}': not supported")
    robot.update_cfg(dict.fromkeys(robot.actuated_joint_names, 0.0))
    begin = robot.get_transform(chosen[0].parent, base).copy()
    upright = [joint.name for joint in chosen if _is_upright(robot, joint, base)]
    if azimuth is None and not upright:
        raise InputError(
            f"none of the joints {', '.join(names)} turns about the z axis of link '{base}', as "
            "one must to turn the throw's vertical plane: choose another --base or --tool"
        )
    turning = upright[0] if azimuth is None else joint_named(names, "--azimuth", azimuth)
    x, y = np.round(robot.get_transform(robot.joint_map[turning].child, base)[:2, 3], 12) + 0.0
    place = np.array([x, y, 0.0])
    begin[:3, 3] -= place
    if approach is None:
        approach = _approach(robot, path, tool)
    hand = _hand_turn(approach, closing or _closing(robot, tool, approach))
    turns = tuple(_axis_turn(joint) for joint in chosen)
    ends = base, tool, turning, begin, place
    return UrdfChain(robot, tuple(path), tuple(chosen), *ends, held, turns, hand)


def _is_upright(robot: Any, joint: Any, base: str) -> bool:
    """Whether a joint turns about the z axis of the base link's frame, as the joints stand."""
    axis = robot.get_transform(joint.child, base)[:3, :3] @ unit_axis(joint)
    return float(np.abs(axis[:2]).max()) < EXACT


def _turn(x: Array, y: Array, z: Array) -> Array:
    """4x4: the rotation whose columns are x, y, z."""
    turn = np.eye(4)
    turn[:3, :3] = np.column_stack([x, y, z])
    return turn


def _axis_turn(joint: Any) -> Array:
    """4x4: a frame whose z is the joint's axis; the link's own where that is z."""
    z = unit_axis(joint)
    y = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    y = y / np.linalg.norm(y)
    return _turn(np.cross(y, z), y, z)


def _hand_turn(approach: str, closing: str) -> Array:
    """4x4: the hand's frame in the tool link's."""
    z, y = AXES[approach], AXES[closing]
    if abs(z @ y) > 0.5:
        raise InputError(f"--closing {closing}: must not be the axis of --approach {approach}")
    return _turn(np.cross(y, z), y, z)


def joint_named(names: Sequence[str], option: str, name: str) -> str:
    """The chosen joint of an option's name, or of its number from 1."""
    if name in names:
        return name
    if name.isdigit() and 1 <= int(name) <= len(names):
        return names[int(name) - 1]
    raise InputError(f"{option}: no joint '{name}' among --joints {' '.join(names)}")


def _named(robot: Any, names: Sequence[str], tool: str | None) -> list[str]:
    """The chosen joints' names: those given, those of the numbers given, or all to the tool."""
    numbers = [name for name in names if name.isdigit() and name not in robot.joint_map]
    if names and not numbers:
        return list(names)
    if tool is None:
        hands = _hands(robot)
        if not hands:
            raise InputError("--tool: no link of this file is moved by two joints or more")
        raise MissingOptionError(
            f"--tool is missing: the link of the hand, one of {', '.join(hands)}",
            *({"--tool": [hand]} for hand in hands),
        )
    turning = _turning(robot, tool)
    return [
        joint_named(turning, "--joints", name) if name in numbers else name
        for name in names or turning
    ]


def _turning(robot: Any, link: str) -> list[str]:
    """The joints with motors that turn, from the root to a link."""
    kinds = ("revolute", "continuous")
    return [j.name for j in _path(robot, link) if j.type in kinds and j.mimic is None]


def _hands(robot: Any) -> list[str]:
    """Links that may be a hand, by `_rank`; of equal ones the last in the file first.

    At least two joints turn a hand. It moves nothing but fingers, or at most one joint.
    """
    moving = [joint for joint in robot.robot.joints if joint.type != "fixed"]
    bodies = {str(link): _body(robot, str(link)) for link in robot.link_map}

    def moved_by(body: str) -> list[Any]:
        return [joint for joint in moving if bodies[joint.parent] == body]

    def depth(body: str) -> int:
        return max((1 + depth(joint.child) for joint in moved_by(body)), default=0)

    hands, fingers = set[str](), set[str]()
    for body in {*bodies.values()}:
        turning, below = len(_turning(robot, body)), moved_by(body)
        if turning < 2:
            continue
        opens = any(
            joint.type == "prismatic" or joint.mimic or re.search(JAW, joint.name, re.IGNORECASE)
            for joint in below
        )
        if opens or (len(below) > 1 and depth(body) <= turning):
            fingers |= {joint.child for joint in below}
        elif depth(body) > 1:
            continue
        hands.add(body)

    def is_finger(link: str) -> bool:
        return any(joint.child in fingers for joint in _path(robot, link))

    last_first = list(bodies.items())[::-1]
    found = [link for link, body in last_first if body in hands and not is_finger(body)]
    return sorted(found, key=_rank)


def _body(robot: Any, link: str) -> str:
    """The link that a joint moves and that `link` is fixed to."""
    path = _path(robot, link)
    while path and path[-1].type == "fixed":
        link = str(path.pop().parent)
    return link


def _rank(link: str) -> int:
    """How likely a link is the hand's by its name, 0: most; fingers, then sensors last."""
    name = link.lower()
    last = [re.search(pattern, name) for pattern in (SENSORS, FINGERS)]
    if any(last):
        return len(LIKELY) + (1 if last[1] is None else 0)
    return next(rank for rank, pattern in enumerate(LIKELY) if re.search(pattern, name))


def _approach(robot: Any, path: Sequence[Any], tool: str) -> str:
    """z, the axis of the tool link out of the hand; InputError if the links suggest another one.

    The child links of the tool show the direction of the hand, else the way from the joint before.
    """
    hung = [at[:3, 3] for _, at in _below(robot, tool)]
    away = np.mean(hung, axis=0) if hung else np.zeros(3)
    back = np.eye(4)
    for joint in reversed(path):
        if np.linalg.norm(away) > 1e-3:
            break
        back = origin(joint) @ back
        away = -np.linalg.inv(back)[:3, 3]
    length = float(np.linalg.norm(away))
    likely = [name for name, axis in AXES.items() if axis @ away > POINTS * length > 0]
    if likely and likely != ["z"]:
        raise MissingOptionError(
            f"--approach is missing: the hand on link '{tool}' seems to point along its "
            f"{likely[0]}, not z: say --approach={likely[0]}, or --approach=z if it is z",
            {"--approach": likely[:1]},
        )
    return "z"


def _closing(robot: Any, tool: str, approach: str) -> str:
    """y, or z beside an approach along y; InputError where all fingers seem to move otherwise."""
    usual, ways = "z" if approach.endswith("y") else "y", set[str]()
    for joint, pose in _below(robot, tool):
        if joint.type == "fixed":
            continue
        way = pose[:3, :3] @ unit_axis(joint)
        if joint.type != "prismatic":
            way = np.cross(way, AXES[approach])
        length = POINTS * np.linalg.norm(way)
        ways.add(next((name for name in "xyz" if abs(way @ AXES[name]) > length > 0), ""))
    if len(ways) == 1 and ways - {usual, ""}:
        (likely,) = ways
        raise MissingOptionError(
            f"--closing is missing: the pads on link '{tool}' seem to close along its {likely}, "
            f"not {usual}: say --closing {likely}, or --closing {usual} if it is {usual}",
            {"--closing": [likely]},
        )
    return usual


def _below(robot: Any, link: str, at: Array | None = None) -> Iterator[tuple[Any, Array]]:
    """The joints below a link, with poses (4, 4) of their links in its frame, all at 0."""
    for joint in hanging(robot, link):
        pose = (np.eye(4) if at is None else at) @ origin(joint)
        yield joint, pose
        yield from _below(robot, str(joint.child), pose)


def _root(robot: Any, link: str) -> str:
    """The link that all joints up to `link` stand on."""
    path = _path(robot, link)
    return str(path[0].parent) if path else link


def hanging(robot: Any, link: str) -> list[Any]:
    """The joints whose parent is a link."""
    return [joint for joint in robot.robot.joints if joint.parent == link]


def _chosen(robot: Any, name: str) -> Any:
    """A joint that can be one of the arm's."""
    if name not in robot.joint_map:
        raise InputError(f"--joints: no joint '{name}'{_near(name, robot.joint_map)}")
    joint = robot.joint_map[name]
    if joint.mimic is not None:
        raise InputError(f"--joints: '{name}' mimics '{joint.mimic.joint}', it has no motor")
    if joint.type not in ("revolute", "continuous"):
        raise InputError(f"--joints: '{name}' is {joint.type}, must be revolute or continuous")
    unit_axis(joint)
    return joint


def _link(robot: Any, option: str, name: str) -> str:
    """The link that an option names."""
    if name not in robot.link_map:
        raise InputError(f"{option}: no link '{name}'{_near(name, robot.link_map)}")
    return name


def _near(name: str, names: Iterable[str]) -> str:
    """Words for the name that is like `name`, or else for all."""
    return InputError.hint(name, names) or f" (there are: {', '.join(names)})"


def _path(robot: Any, link: str) -> list[Any]:
    """The joints from the root to a link."""
    manipulators = {joint.child: joint for joint in robot.robot.joints}
    joints_to_root: list[Any] = []
    while link in manipulators:
        joints_to_root.insert(0, manipulators[link])
        link = manipulators[link].parent
    return joints_to_root


def _check_serial(robot: Any, chosen: list[Any]) -> None:
    """InputError unless the chosen joints follow each other on one chain."""
    paths = [_path(robot, joint.child) for joint in chosen]
    longest = max(paths, key=len)
    for joint in chosen:
        if joint not in longest:
            raise InputError(
                f"--joints: '{joint.name}' is not on the chain from the base to "
                f"'{longest[-1].name}'; must be one serial chain"
            )
    ordered = [joint.name for joint in longest if joint in chosen]
    if ordered != [joint.name for joint in chosen]:
        raise InputError(f"--joints: must go from the base on: {' '.join(ordered)}")


def _last_link(robot: Any, joint: Any) -> str:
    """The last link that is fixed to a joint's without a branch on the way."""
    link = str(joint.child)
    while len(after := hanging(robot, link)) == 1 and after[0].type == "fixed":
        link = str(after[0].child)
    return link
