"""Masses of a URDF's links, merged into those of an arm."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import LinkInertia
from ..section import InputError
from .file import UrdfChain, hanging
from .frames import origin

Array = npt.NDArray[np.float64]


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
