"""`throwplan import-robot`: a robot's URDF as an arm data file."""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import math
import shlex
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from ...planner import Planner
from ...problems import (
    Arm,
    InputError,
    arm_from,
    arm_table,
    arm_text,
    copy_out,
    measured_overlaps,
    scene_from_table,
    shape_overlaps,
    toml_tables,
)
from ...terminal import DONE, Add, Progress, number, print_result, toml_out
from .arm import (
    LIMIT_OPTIONS,
    STATES,
    Choices,
    arm_of,
    kinematics_difference,
    limits_of,
    weak_joints,
)
from .chain import AXES, EXACT, MissingOptionError, UrdfChain, chain_of
from .holding import quantity
from .reading import read_urdf, urdf_file
from .shapes import LinkShapes, link_shapes

#: A scene of which the arm alone may be wrong: a light object, held firmly.
ANY_SCENE: dict[str, Any] = {
    "object": {"mass": 1e-3, "length": 0.02, "width": 0.002, "com": 0.01},
    "contact": {"friction": 1.0, "patch_radius": 0.01},
    "gripper": {"force": 100.0, "opening": 0.05},
    "target": {"x": 1.0, "z": 0.0},
}
LIMIT_UNITS = {"velocity": "rad/s", "acceleration": "rad/s^2", "jerk": "rad/s^3", "torque": "N m"}
#: Recommendations that are assumed where no option gives them, and their units.
ASSUMED = {"tool_speed": (1.5, "m/s"), "torque_rate": (1000.0, "N m/s")}


def arguments(add: Add) -> None:
    """The command's options."""
    words = "URDF or xacro of the robot, or its name in robot_descriptions"
    add("urdf", metavar="FILE.urdf", help=words)
    words = "arguments of a xacro, behind the file, such as ur_type:=ur10e"
    add("arguments", nargs="*", type=_argument, metavar="NAME:=VALUE", default=[], help=words)
    words = "joints, base first, by name or number on the way to --tool (default: all of them)"
    add("--joints", nargs="+", metavar="J", default=[], help=words)
    add("--out", required=True, metavar="FILE.toml", help="the arm data file")
    add("--force", action="store_true", help="overwrite an existing file")
    add("--name", help="the arm's name (default: the URDF's)")
    words = "link of the base frame, z upwards (default: the root)"
    add("--base", metavar="LINK", help=words)
    add("--tool", metavar="LINK", help="link of the hand (default: the link of the last joint)")
    words = "axis of the tool link that points out of the hand, such as --approach=-z (default: z "
    add("--approach", choices=list(AXES), help=words + "if the hand's links agree)")
    words = (
        "axis of the tool link along which the pads close (default: that of the fingers, else y "
    )
    words += "or, if --approach is y or -y, z)"
    add("--closing", choices=["x", "y", "z"], help=words)
    words = "distance from the tool link to the pads' centre (default: 0)"
    add("--tcp", type=number(), metavar="M", default=0.0, help=words)
    words = "the hand's body behind the pads' centre, in m (default: none)"
    form = ("BACK", "FRONT", "HALF_WIDTH")
    add("--palm", nargs=3, type=number(), metavar=form, help=words)
    words = "joint that turns the throw's plane (default: the first that is upright)"
    add("--azimuth", metavar="J", help=words)
    words = "joints that throw (default: those that turn in the plane y = 0)"
    add("--throwing", nargs="+", metavar="J", default=[], help=words)
    words = "angles of all joints; those that do not throw keep them (default: 0 if allowed, pads "
    words += "across the plane)"
    add("--posture-deg", nargs="+", type=number(), default=[], metavar="DEG", help=words)
    words = "where joints are held that the throw does not move, in deg or m (default: 0, or the "
    words += "end of their range nearest to it)"
    add("--hold", nargs="+", type=_position, metavar="J=VALUE", default=[], help=words)
    for name, option in LIMIT_OPTIONS.items():
        words = f"{name.replace('_', ' ')} limits [{LIMIT_UNITS.get(name, 'deg')}]: one for all "
        words += "joints or one per joint; - keeps the URDF's"
        add(option, nargs="+", type=number(other="-"), metavar="VALUE", help=words)
    words = "highest speed that the maker recommends, of flange and pads' centre (default: "
    words += "1.5 m/s, assumed)"
    add("--tool-speed", type=number(1e-3), metavar="M/S", help=words)
    words = "largest rate of any joint's torque that the maker recommends (default: 1000 N m/s, "
    words += "assumed)"
    add("--torque-rate", type=number(1e-3), metavar="N_M/S", help=words)


def run(options: argparse.Namespace) -> int:
    """Turn a robot's URDF into an arm data file.

    example: throwplan import-robot my.urdf --joints j1 j2 j3 j4 j5 j6 --tool gripper
    --tcp 0.12 --acceleration 10 --jerk 1000 --out my-arm.toml
    """
    out, urdf = toml_out(options), Path(options.urdf)
    if options.name is not None and not (options.name and options.name.isprintable()):
        raise InputError("--name: must be a word")
    with Progress(f"{urdf}: reading"):
        robot, turned = read_urdf(urdf, dict(options.arguments))
        turned = {name: math.degrees(angle) for name, angle in turned.items()}
        try:
            robot_import = _import(options, robot)
        except MissingOptionError:
            raise _proposal(options, robot).within(str(urdf)) from None
        except InputError as error:
            raise error.within(str(urdf)) from None
    chain, arm, shapes = robot_import.chain, robot_import.arm, robot_import.shapes
    text = arm_text(arm, _remarks(chain, urdf, shapes, turned))
    copy_out(text, out, force=options.force)
    result = _facts(options, arm, chain) | {
        "held": chain.held,
        "states": STATES,
        "difference": robot_import.difference,
        "capsules": len(arm.capsules),
        "overlaps": _overlaps(arm),
        "unread": list(shapes.unread),
        "tried": shapes.tried,
        "not_z_up": list(shapes.not_z_up),
        "turned_deg": turned,
        "weak": weak_joints(arm),
    }
    print_result(options, result, _text(options, result, _held(chain)))
    return DONE


def _with_recommendations(arm: Arm, options: argparse.Namespace) -> Arm:
    """The arm with the recommended tool speed and, if its masses are known, torque rate."""
    names = ["tool_speed", "torque_rate"] if arm.links else ["tool_speed"]
    given = {name: getattr(options, name) for name in names}
    if options.torque_rate is not None and not arm.links:
        raise InputError(f"--torque-rate {options.torque_rate:g}: only for a URDF with masses")
    assumed = tuple(name for name, value in given.items() if value is None)
    limits = dataclasses.replace(arm.limits, **given | {name: ASSUMED[name][0] for name in assumed})
    return dataclasses.replace(arm, limits=limits, assumed=assumed)


def _argument(word: str) -> tuple[str, str]:
    """Name and value of a xacro's argument."""
    name, sign, value = word.partition(":=")
    if not (name and sign):
        raise argparse.ArgumentTypeError(f"{word}: must be NAME:=VALUE, an argument of a xacro")
    return name, value


def _position(word: str) -> tuple[str, float]:
    """Name and position of a joint that is held."""
    name, _, value = word.rpartition("=")
    position = number()(value) if name else None
    if position is None:
        raise argparse.ArgumentTypeError(f"{word}: must be JOINT=VALUE, in deg or m")
    return name, position


@dataclasses.dataclass(frozen=True)
class _Import:
    """An arm that scenes take, its chain and shapes, and how far [m; -] its kinematics differ from
    yourdfpy's."""

    chain: UrdfChain
    arm: Arm
    shapes: LinkShapes
    difference: float


def _import(options: argparse.Namespace, robot: Any) -> _Import:
    """The arm of complete options; MissingOptionError for what they lack."""
    ends = options.tool, options.base, options.approach, options.closing, options.azimuth
    chain = chain_of(robot, options.joints, *ends, hold=_given_positions(options, robot))
    options.joints = list(chain.names)
    arm = arm_of(chain, limits_of(chain, _given_limits(options)), _choices(options, chain))
    shapes = link_shapes(chain, urdf_file(Path(options.urdf)), chain.length + options.tcp)
    arm = dataclasses.replace(arm, capsules=shapes.capsules)
    arm = dataclasses.replace(arm, overlaps=measured_overlaps(arm, shapes.surfaces))
    arm = _with_recommendations(arm, options)
    arm = arm_from(toml_tables(arm_text(arm), options.out))
    _check_takes(options, arm)
    difference = kinematics_difference(arm, chain)
    if not difference <= EXACT:
        raise InputError(
            f"the arm's kinematics differ by {difference:.1e} from yourdfpy's, must be at most "
            f"{EXACT:.0e}"
        )
    return _Import(chain, arm, shapes, difference)


def _check_takes(options: argparse.Namespace, arm: Arm) -> None:
    """InputError, by what every scene checks, if scenes do not take the arm."""

    def check(arm: Arm) -> None:
        scene = {"name": "a scene", "arm": arm_table(arm), "robot": {"arm": arm.name}}
        Planner(scene_from_table(scene | ANY_SCENE))

    try:
        check(arm)
    except InputError:
        try:
            limits = dataclasses.replace(arm.limits, torque_rate=None, torque_margin=None)
            assumed = tuple(key for key in arm.assumed if key != "torque_rate")
            check(dataclasses.replace(arm, links=(), limits=limits, assumed=assumed))
        except InputError as error:
            words = "change --approach, --closing, --throwing or --posture-deg"
            raise InputError(f"{error}; {words}") from None
        # It is the torques.
        weak = weak_joints(arm)
        words = f"limits do not hold the arm at rest: {_weak(weak)}; take the data sheet's"
        values = [f"{2 * weak[n][0]:.2g}" if n in weak else "-" for n in options.joints]
        if options.torque:
            given = options.torque * (len(values) if len(options.torque) == 1 else 1)
            pairs = zip(values, given, strict=True)
            values = [a if a != "-" or b is None else f"{b:.15g}" for a, b in pairs]
        raise MissingOptionError(f"--torque: {words}", {"--torque": values}) from None


@dataclasses.dataclass(frozen=True)
class _Attempt:
    """A command line, and the lines about what had been missing before; error: why it fails."""

    words: list[str]
    missing: list[str]
    error: InputError | None = None


def _proposal(options: argparse.Namespace, robot: Any) -> InputError:
    """All that a command line lacks, and one that works; where none does, why."""
    own = [word for word in options.words if word != "--json"]
    attempt = _attempt(options.parser, robot, own, {}, [])
    tried = shlex.join(["throwplan", *attempt.words])
    if attempt.error is None:
        return InputError(*attempt.missing, f"with values to try: {tried}")
    return InputError(*attempt.missing, f"{attempt.error}; tried: {tried}")


def _attempt(
    parser: argparse.ArgumentParser,
    robot: Any,
    own: list[str],
    added: Mapping[str, list[str]],
    missing: list[str],
) -> _Attempt:
    """The first command line that leads to an arm, of `own` words and proposed options; else the
    first that was tried."""
    words = _without(own, added)
    for option, values in added.items():
        alone = len(values) == 1 and values[0].startswith("-")
        words += [f"{option}={values[0]}"] if alone else [option, *values]
    try:
        _import(parser.parse_args(words[1:]), robot)
    except MissingOptionError as error:
        attempts, missing = list[_Attempt](), [*missing, str(error)]
        for proposal in error.proposals:
            attempts.append(_attempt(parser, robot, own, {**added, **proposal}, missing))
            if attempts[-1].error is None:
                return attempts[-1]
        return attempts[0]
    except InputError as error:
        return _Attempt(words, missing, error)
    return _Attempt(words, missing)


def _without(words: list[str], names: Collection[str]) -> list[str]:
    """The words of a command line without some options and their values."""
    kept, drop = list[str](), False
    for word in words:
        if word.startswith("--"):
            drop = word.partition("=")[0] in names
        if not drop:
            kept.append(word)
    return kept


def _given_limits(options: argparse.Namespace) -> dict[str, list[float | None]]:
    """Limits from the options, per joint, in SI units."""
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


def _given_positions(options: argparse.Namespace, robot: Any) -> dict[str, float]:
    """Positions of held joints from the options, in SI units."""
    joints = robot.joint_map
    turns = {n: n in joints and joints[n].type != "prismatic" for n, _ in options.hold}
    return {name: math.radians(at) if turns[name] else at for name, at in options.hold}


def _check_count(options: argparse.Namespace, option: str, values: list[Any]) -> None:
    """InputError unless an option has a value per joint."""
    if len(values) != len(options.joints):
        raise InputError(f"{option}: must be {len(options.joints)} values, one per joint")


def _choices(options: argparse.Namespace, chain: UrdfChain) -> Choices:
    """Choices of the options about hand and joints."""
    if options.posture_deg:
        _check_count(options, "--posture-deg", options.posture_deg)
    if options.palm is not None:
        back, front, half_width = options.palm
        if not (back > front > 0 and half_width > 0):
            raise InputError("--palm: must be BACK above FRONT, both and HALF_WIDTH above 0")
    return Choices(
        options.name or " ".join(str(chain.robot.robot.name or "arm").split()),
        tuple(options.throwing),
        tuple(map(math.radians, options.posture_deg)),
        options.tcp,
        None if options.palm is None else tuple(options.palm),
    )


def _remarks(
    chain: UrdfChain, urdf: Path, shapes: LinkShapes, turned: Mapping[str, float]
) -> list[str]:
    """Remarks at the head of the file about its origin."""
    remarks = [f"Made by 'throwplan import-robot' from {urdf.name}.", f"Base link: {chain.base}"]
    remarks[1] += f"{_moved(chain.origin)}; hand: {chain.tool}."
    if chain.held:
        remarks.append(f"Held: {_held(chain)}.")
    if turned:
        remarks.append(f"Joints' {_turned(turned)}.")
    unread = f"; no mesh was read of {', '.join(shapes.unread)}" if shapes.unread else ""
    return [*remarks, f"Capsules: around the meshes of the links{unread}."]


def _facts(options: argparse.Namespace, arm: Arm, chain: UrdfChain) -> dict[str, Any]:
    """The arm as JSON."""
    names = dict(enumerate(chain.names, start=1))
    out_of_hand = chain.hand_turn[:3, 2]
    return {
        "out": str(options.out),
        "name": arm.name,
        "joints": list(chain.names),
        "base": chain.base,
        "origin": chain.origin.tolist(),
        "approach": next(name for name, axis in AXES.items() if axis @ out_of_hand > 0.5),
        "lateral": arm.lateral,
        "tool": chain.tool,
        "hand": arm.hand,
        "hand_links": list(arm.hand_links),
        "hand_mass": arm.links[-1].mass if arm.links else None,
        "flange": chain.flange,
        "azimuth": names[arm.azimuth_joint],
        "throwing": [names[joint] for joint in arm.throwing_joints],
        "posture_deg": [math.degrees(angle) for angle in arm.posture],
        "limits": {k: v for k, v in dataclasses.asdict(arm.limits).items() if v is not None},
        "assumed": list(arm.assumed),
        "mass": sum(link.mass for link in arm.links) if arm.links else None,
    }


def _overlaps(arm: Arm) -> list[dict[str, Any]]:
    """Links, the base is 0, and how deep [m] their capsules may overlap, deepest first, None: as
    deep as they like; told: whether a deeper overlap is where their meshes meet."""
    allowed, deepest = shape_overlaps(arm), dict[tuple[str, bool], float]()
    told = {each.capsules for each in arm.overlaps}
    for (i, one), (j, other) in itertools.combinations(enumerate(arm.capsules, start=1), 2):
        depth = float(allowed[i - 1, j - 1])
        if depth >= 1e-3 and abs(one.link - other.link) > 1:
            key = f"{one.link}-{other.link}", (i, j) in told
            deepest[key] = max(deepest.get(key, 0.0), depth)
    pairs = sorted(deepest.items(), key=lambda pair: -pair[1])
    return [
        {"links": links, "depth": depth if math.isfinite(depth) else None, "told": told}
        for (links, told), depth in pairs
    ]


def _shapes(result: dict[str, Any]) -> list[str]:
    """Lines on the capsules."""
    if not result["capsules"]:
        words = "no shapes of links in the URDF: collisions of the arm are not checked"
        return [f"{words} (no [[capsules]])"]
    lines = [f"shapes: {result['capsules']} capsules that contain the links' meshes"]
    overlaps = result["overlaps"]
    told, untold = ([_depth(each) for each in overlaps if each["told"] == told] for told in (1, 0))
    if told:
        words = (
            "links whose capsules overlap (0: base), and how deep they may until the meshes meet"
        )
        lines.append(f"{words}: {', '.join(told)}")
    if untold:
        words = "links whose capsules do not tell contacts; only deeper overlaps count as such"
        lines.append(f"{words}: {', '.join(untold)}")
    return lines


def _depth(overlap: Mapping[str, Any]) -> str:
    """Two links and how deep their capsules may overlap, as text."""
    depth = overlap["depth"]
    return f"{overlap['links']} {'any' if depth is None else f'{1e3 * depth:.0f} mm'}"


def _held(chain: UrdfChain) -> str:
    """Where the joints are that the throw does not move, as text: those at 0 last."""
    joints = chain.robot.joint_map
    words = [f"{name} at {quantity(joints[name], at)}" for name, at in chain.held.items() if at]
    still = [name for name, at in chain.held.items() if not at]
    return "; ".join(words + ([f"at 0: {', '.join(still)}"] if still else []))


def _turned(turned: Mapping[str, float]) -> str:
    """Which joints' angles were taken as multiples of 90 deg, as text."""
    joints = (f"{name} ({angle:.2g} deg off)" for name, angle in turned.items())
    return f"angles near multiples of 90 deg are taken as these: {', '.join(joints)}"


def _weak(weak: Mapping[str, tuple[float, float]]) -> str:
    """Which joints are too weak to hold the arm, as text."""
    return ", ".join(
        f"{name} needs {need:.3g} N m, has {has:g}" for name, (need, has) in weak.items()
    )


def _moved(origin: Any) -> str:
    """The shift of the base frame as text; empty without one."""
    x, y = (round(value, 4) + 0.0 for value in origin[:2])
    return f" moved to x {x:.4f}, y {y:.4f} m" if x or y else ""


def _assumed(names: list[str]) -> list[str]:
    """A line on the recommendations that no option gives, if any."""
    words = list[str]()
    for name in names:
        value, unit = ASSUMED[name]
        option = name.replace("_", "-")
        words.append(f"{name.replace('_', ' ')} {value:g} {unit} (--{option})")
    return [f"assumed: {', '.join(words)}"] if words else []


def _text(options: argparse.Namespace, result: dict[str, Any], held: str) -> str:
    """The arm as text; held: words for the joints that are."""
    mass, angles = result["mass"], " ".join(f"{angle:.6g}" for angle in result["posture_deg"])
    lines = [
        f"{result['name']}: written to {options.out}; a scene takes it by [robot] arm = "
        f'"{Path(options.out).name}"',
        f"base {result['base']}{_moved(result['origin'])}, hand {result['tool']}, "
        f"{result['approach']} points out of it, pads' centre at {options.tcp:g} m (--tcp)",
        f"{result['azimuth']} turns the plane, {', '.join(result['throwing'])} throw",
        f"posture {angles} deg",
    ]
    if result["turned_deg"]:
        lines.append(_turned(result["turned_deg"]))
    if result["weak"]:
        words = (
            f"torque limits that do not hold the arm at rest in all poses: {_weak(result['weak'])}"
        )
        lines.append(f"{words}; if they are placeholders, give --torque from the data sheet")
    if result["lateral"]:
        lines.append(f"the throw's plane is {result['lateral']:.4g} m beside the base's z axis")
    if held:
        lines.append(f"held (--hold): {held}")
    if result["hand_links"]:
        weight = f" ({result['hand_mass']:.3g} kg)" if result["mass"] is not None else ""
        lines.append(f"links of the hand: {', '.join(result['hand_links'])}{weight}")
        if not result["hand"]:
            lines[-1] += "; a scene's [gripper] file takes their place"
    if result["hand"]:
        lines.append(
            f"includes the hand on {result['hand']}, so a scene's [gripper] file is refused; for "
            f"one, import with --tool {result['flange'] or 'FLANGE'}, without --tcp and --palm"
        )
    if options.palm is None:
        lines.append("no --palm: the flying bar is kept clear of the hand's capsules only")
    lines += _shapes(result)
    if result["unread"]:
        links = ", ".join(result["unread"])
        links += f" (tried {result['tried']})" if result["tried"] else ""
        lines.append(f"meshes not read: {links}: these links have no shape")
    if result["not_z_up"]:
        lines.append(
            "COLLADA meshes whose up axis is not z, taken as they stand, as in RViz and MoveIt: "
            + ", ".join(result["not_z_up"])
        )
    lines.append(
        f"moved mass {mass:.4g} kg"
        if mass is not None
        else "no masses in the URDF: torques are not checked"
    )
    lines += _assumed(result["assumed"])
    lines.append(
        f"kinematics at {result['states']} random states: at most {result['difference']:.1e} "
        "from yourdfpy's"
    )
    return "\n  ".join(lines)


#: The functions of the command.
COMMANDS = {"import-robot": (arguments, run)}
