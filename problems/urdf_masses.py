"""Masses of a URDF's links, merged into those of an arm."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ..models.arm import LinkInertia
from .errors import InputError
from .urdf_file import UrdfChain, hanging, origin

Array = npt.NDArray[np.float64]


def link_inertias(chain: UrdfChain) -> tuple[LinkInertia, ...]:
    """What each chosen joint moves, up to the next, then the hand, in the arm's own frames.

    Links on fixed joints, and on joints held at 0, count to the link that they hang on;
    the tool link and what hangs on it are the hand. Empty if the file has no masses.
    """
    stops = {*chain.names, _mover(chain, chain.tool)}
    roots = [(joint.child, turn) for joint, turn in zip(chain.joints, chain.turns, strict=True)]
    found = []
    for link, turn in [*roots, (chain.tool, chain.hand_turn)]:
        bodies = _bodies(chain, link, turn.T, stops)
        skip = link == chain.tool and len(found) < len(roots)
        found.append(_merged([] if skip else list(bodies)))
    return tuple(found) if any(link.mass for link in found) else ()


def held_joints(chain: UrdfChain) -> list[str]:
    """Joints that are not chosen, move, and are held at 0, between base and hand or on them."""
    moved = [joint for joint in chain.path if joint.name not in chain.names]
    todo = [joint.child for joint in chain.path]
    on_path = {joint.name for joint in chain.path}
    while todo:
        for joint in hanging(chain.robot, todo.pop()):
            if joint.name not in on_path:
                moved.append(joint)
                todo.append(joint.child)
    first = chain.path.index(chain.joints[0])
    before = {joint.child for joint in chain.path[:first]}
    for joint in moved:
        if joint.mimic is not None and joint.mimic.joint in chain.names:
            raise InputError(f"joint '{joint.name}' mimics '{joint.mimic.joint}': not supported")
    return [joint.name for joint in moved if joint.type != "fixed" and joint.parent not in before]
