"""An arm as the text of its data file."""

from __future__ import annotations

import json
from collections.abc import Sequence

from ..models import Arm, JointFrame


def arm_text(arm: Arm, remarks: Sequence[str] = (), names: Sequence[str] = ()) -> str:
    """TOML that `load_arm` reads as this arm, with units; remarks go in front.

    The arm's chain must be of `JointFrame`; names: of the joints, for comments.
    """
    names = names or [f"joint {i}" for i in range(1, arm.joints + 1)]
    lines = [f"# {' '.join(remark.split())}" for remark in remarks]
    lines += [
        f"name = {_text(arm.name)}",
        f"description = {_text(arm.description)}",
        "",
        "# Throwing in a vertical plane: this joint turns the plane, these throw, the rest keep a",
        "# posture [rad]. Joint numbers count from 1.",
        f"azimuth_joint = {arm.azimuth_joint}",
        f"throwing_joints = {_list(arm.throwing_joints)}",
        f"posture = {_list(arm.posture)}",
        "",
        "# Each joint's frame in the one before, at angle 0: xyz [m], rpy [rad] about the fixed",
        "# x, y, z axes in turn. It turns about its z axis.",
        "joints = [",
    ]
    for joint, name in zip(arm.chain, names, strict=True):
        assert isinstance(joint, JointFrame)
        lines.append(f"  {{ xyz = {_list(joint.xyz)}, rpy = {_list(joint.rpy)} }}, # {_line(name)}")
    return "\n".join([*lines, "]", "", *_tool(arm), *_limits(arm), *_links(arm, names)]) + "\n"


def _tool(arm: Arm) -> list[str]:
    tool = arm.tool
    return [
        "[tool]",
        f"xyz = {_list(tool.xyz)} # m, the hand in the last joint's frame; z points out of it,",
        f"rpy = {_list(tool.rpy)} # rad; y is how its pads close",
        f"flange = {tool.flange!r} # m, on along its z axis",
        f"rotation = {tool.rotation!r} # rad about that axis",
        f"tcp = {tool.tcp!r} # m, on along it to the pads' centre",
        f"palm_back = {tool.palm_back!r} # m, the hand's body behind the pads' centre: from here",
        f"palm_front = {tool.palm_front!r} # m, to here",
        f"palm_half_width = {tool.palm_half_width!r} # m, half its thickness in the plane",
        "",
    ]


def _limits(arm: Arm) -> list[str]:
    limits, slowing = arm.limits, arm.limits.slowing
    lines = [
        "[limits] # per joint",
        f"position_max = {_list(limits.position_max)} # rad",
        f"position_min = {_list(limits.position_min)} # rad",
        f"velocity = {_list(limits.velocity)} # rad/s",
        f"acceleration = {_list(limits.acceleration)} # rad/s^2",
        f"jerk = {_list(limits.jerk)} # rad/s^3",
        f"torque = {_list(limits.torque)} # N m",
    ]
    if slowing is not None:
        lines += [
            "",
            "# Velocity at most sqrt(2 deceleration (upper - q)) - offset, the same downwards.",
            "[limits.slowing]",
            f"deceleration = {_list(slowing.deceleration)} # rad/s^2",
            f"offset = {_list(slowing.offset)} # rad/s",
            f"upper = {_list(slowing.upper)} # rad",
            f"lower = {_list(slowing.lower)} # rad",
        ]
    return lines


def _links(arm: Arm, names: Sequence[str]) -> list[str]:
    if not arm.links:
        return []
    lines = [
        "",
        "# What each joint moves up to the next, in its frame, then the hand in its own:",
        "# mass [kg], CoM [m], inertia about the CoM (xx, xy, xz, yy, yz, zz) [kg m^2].",
    ]
    for link, name in zip(arm.links, [*names, "the hand"], strict=True):
        lines += [
            f"[[links]] # {_line(name)}",
            f"mass = {link.mass!r}",
            f"com = {_list(link.com)}",
            f"inertia = {_list(link.inertia)}",
        ]
    return lines


def _list(values: Sequence[float]) -> str:
    return f"[{', '.join(map(repr, values))}]"


def _text(words: str) -> str:
    """A basic string of TOML, whose escapes are JSON's."""
    return json.dumps(words, ensure_ascii=False)


def _line(words: str) -> str:
    """Words that fit into a comment."""
    return " ".join(words.split())
