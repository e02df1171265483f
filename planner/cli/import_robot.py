"""`throwplan import-robot`: a robot's URDF as an arm data file."""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path
from typing import Any

from ...models import Arm
from ...problems import InputError, arm_from, arm_text, copy_out, toml_tables
from ...problems.urdf import (
    AXES,
    EXACT,
    LIMIT_OPTIONS,
    STATES,
    Choices,
    UrdfChain,
    arm_of,
    chain_of,
    held_joints,
    kinematics_difference,
    limits_of,
    read_urdf,
)
from .common import DONE, Add, Progress, add_force, answer, number

LIMIT_UNITS = {"velocity": "rad/s", "acceleration": "rad/s^2", "jerk": "rad/s^3", "torque": "N m"}


def arguments(add: Add) -> None:
    """The command's options."""
    add(
        "urdf", metavar="FILE.urdf", help="the robot; or a xacro, or its name in robot_descriptions"
    )
    words = "joints, base first, by name or by number on the way to --tool (default: all of these)"
    add("--joints", nargs="+", metavar="J", default=[], help=words)
    add("--out", required=True, metavar="FILE.toml", help="the arm data file")
    add_force(add)
    add("--name", help="the arm's name (default: the URDF's)")
    words = "link of the base frame, z upwards (default: the root)"
    add("--base", metavar="LINK", help=words)
    add("--tool", metavar="LINK", help="link of the hand (default: the last on --joints)")
    add(
        "--approach",
        choices=list(AXES),
        help="axis of the tool link that points out of the hand; write --approach=-z (default: z, "
        "where nothing speaks against it)",
    )
    add(
        "--closing",
        choices=["x", "y", "z"],
        help="axis of the tool link along which the pads close (default: y, or z, the same)",
    )
    words = "from the tool link on to the pads' centre (0)"
    add("--tcp", type=number(), metavar="M", default=0.0, help=words)
    add(
        "--palm",
        nargs=3,
        type=number(),
        metavar=("BACK", "FRONT", "HALF_WIDTH"),
        help="the hand's body behind the pads' centre, in m (default: none)",
    )
    _motion_arguments(add)


def _motion_arguments(add: Add) -> None:
    """The options on joints: what they do in a throw, and their limits."""
    add("--azimuth", metavar="J", help="joint that turns the plane (the first)")
    add(
        "--throwing",
        nargs="+",
        metavar="J",
        help="joints that throw (default: those that turn in the plane y = 0)",
    )
    add(
        "--posture-deg",
        nargs="+",
        type=number(),
        default=[],
        metavar="DEG",
        help="what the other joints keep, per joint (default: 0 where allowed, pads across)",
    )
    for name, option in LIMIT_OPTIONS.items():
        add(
            option,
            nargs="+",
            type=number(other="-"),
            metavar="VALUE",
            help=f"{name.replace('_', ' ')} limits [{LIMIT_UNITS.get(name, 'deg')}]: one for all "
            "joints or one per joint; - keeps the URDF's",
        )


def run(options: argparse.Namespace) -> int:
    """Reads the URDF, checks the arm that comes of it, writes and prints."""
    out, urdf = Path(options.out), Path(options.urdf)
    if out.suffix != ".toml":
        raise InputError(f"--out {out}: must end in .toml")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: its folder is not there")
    if options.name is not None and not (options.name and options.name.isprintable()):
        raise InputError("--name: must be a word")
    with Progress(f"{urdf}: reading"):
        robot = read_urdf(urdf)
        try:
            ends = options.tool, options.base, options.approach, options.closing, options.azimuth
            chain = chain_of(robot, options.joints, *ends)
            options.joints, held = list(chain.names), held_joints(chain)
            limits, choices = limits_of(chain, _given_limits(options)), _choices(options, chain)
            drawn = arm_of(chain, limits, choices)
        except InputError as error:
            raise error.within(str(urdf)) from None
        text = arm_text(drawn, _remarks(chain, urdf, held))
        arm = arm_from(toml_tables(text, str(out)))
        difference = kinematics_difference(arm, chain)
    if not difference <= EXACT:
        raise InputError(
            f"{urdf}: the arm's kinematics are {difference:.1e} off yourdfpy's, nothing written"
        )
    copy_out(text, out, force=options.force)
    found = _found(options, arm, chain, held) | {"states": STATES, "difference": difference}
    answer(options, found, _text(options, found))
    return DONE


def _given_limits(options: argparse.Namespace) -> dict[str, list[float | None]]:
    """The limits that options give, per joint, in SI units."""
    given: dict[str, list[float | None]] = {}
    for name, option in LIMIT_OPTIONS.items():
        words = getattr(options, option[2:].replace("-", "_"))
        if words is None:
            continue
        unit = math.radians(1.0) if name.startswith("position") else 1.0
        each = words * len(options.joints) if len(words) == 1 else words
        _check_count(options, option, each)
        given[name] = [None if value is None else unit * value for value in each]
    return given


def _check_count(options: argparse.Namespace, option: str, values: list[Any]) -> None:
    """InputError unless an option has a value per joint."""
    if len(values) != len(options.joints):
        raise InputError(f"{option}: must be {len(options.joints)} values, one per joint")


def _choices(options: argparse.Namespace, chain: UrdfChain) -> Choices:
    """What the options say of the hand and of the joints' parts."""
    if options.posture_deg:
        _check_count(options, "--posture-deg", options.posture_deg)
    if options.palm is not None:
        back, front, half_width = options.palm
        if not (back > front > 0 and half_width > 0):
            raise InputError("--palm: must be BACK above FRONT, both and HALF_WIDTH above 0")
    return Choices(
        options.name or " ".join(str(chain.robot.robot.name or "arm").split()),
        options.azimuth,
        tuple(options.throwing or ()),
        tuple(map(math.radians, options.posture_deg)),
        options.tcp,
        None if options.palm is None else tuple(options.palm),
    )


def _remarks(chain: UrdfChain, urdf: Path, held: list[str]) -> list[str]:
    """What the file says of where it comes from."""
    remarks = [f"Made by 'throwplan import-robot' from {urdf.name}.", f"Base link: {chain.base}"]
    remarks[1] += f"{_moved(chain.origin)}; hand: {chain.tool}."
    return remarks + ([f"Held at 0: {', '.join(held)}."] if held else [])


def _found(
    options: argparse.Namespace, arm: Arm, chain: UrdfChain, held: list[str]
) -> dict[str, Any]:
    """What was made of the robot, for JSON."""
    names = dict(enumerate(chain.names, start=1))
    return {
        "out": str(options.out),
        "name": arm.name,
        "joints": list(chain.names),
        "base": chain.base,
        "origin": chain.origin.tolist(),
        "approach": _approach_of(chain),
        "lateral": arm.lateral,
        "tool": chain.tool,
        "azimuth": names[arm.azimuth_joint],
        "throwing": [names[joint] for joint in arm.throwing_joints],
        "posture_deg": [math.degrees(angle) for angle in arm.posture],
        "limits": {k: v for k, v in dataclasses.asdict(arm.limits).items() if v is not None},
        "mass": sum(link.mass for link in arm.links) if arm.links else None,
        "held": held,
    }


def _approach_of(chain: UrdfChain) -> str:
    """The axis of the tool link out of the hand."""
    return next(name for name, axis in AXES.items() if axis @ chain.hand_turn[:3, 2] > 0.5)


def _moved(origin: Any) -> str:
    """Where the base frame is moved to, in words; nothing where it is not."""
    x, y = (round(value, 4) + 0.0 for value in origin[:2])
    return f" moved to x {x:.4f}, y {y:.4f} m" if x or y else ""


def _text(options: argparse.Namespace, found: dict[str, Any]) -> str:
    """The same for people."""
    mass, kept = found["mass"], " ".join(f"{angle:.6g}" for angle in found["posture_deg"])
    lines = [
        f"{found['name']}: written to {options.out}; a scene takes it by [robot] arm = "
        f'"{Path(options.out).name}"',
        f"  base {found['base']}{_moved(found['origin'])}, hand {found['tool']}, "
        f"{found['approach']} points out of it, pads' centre {options.tcp:g} m beyond (--tcp)",
        f"  {found['azimuth']} turns the plane, {', '.join(found['throwing'])} throw",
        f"  posture {kept} deg",
    ]
    if found["lateral"]:
        lines.append(f"  the throw's plane is {found['lateral']:.4g} m beside the base's z axis")
    if found["held"]:
        lines.append(f"  held at 0: {', '.join(found['held'])}")
    if options.palm is None:
        lines.append("  no --palm: nothing keeps the bar off the hand's body")
    lines.append(f"  moved mass {mass:.4g} kg" if mass is not None else "  no masses in the URDF")
    lines.append(
        f"  kinematics at {found['states']} random states: at most {found['difference']:.1e} "
        "off yourdfpy's"
    )
    return "\n".join(lines)
