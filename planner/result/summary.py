"""What a plan prints: eight lines at most, and what stands behind them with `--verbose`."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...models.release import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems import Pose, Scene
from ..throw import TICK, Throw, column_of, torque_limits
from ..uncertainty import SAID
from ..verdict import Code, Finding, measures_of
from .active_limits import CUT_SHORT

if TYPE_CHECKING:
    from .plan import Plan

#: Longest line [characters].
WIDTH = 110
#: A throw is quiet while its pads carry less than this share of their grip.
QUIET = 0.1
#: Speed [m/s] of the hand at the opening below which a throw is called a drop.
DROP = 0.1
#: Room [m] to a body that counts as much as half of another limit.
NEAR = 0.05
#: Arms that take the files of `export --franka`, the one that `run` moves, and how far their hand
#: opens at most [m].
FRANKA, RUNS, OPENS = ("panda", "fr3"), "fr3", 0.08
#: Sections of what is assumed: what moves a landing most stands first.
WEIGHTIEST = ("uncertainty", "gripper", "contact", "object", "arm")
#: Where a page says how to measure what is assumed.
MEASURE = "measure them: docs/first-throw.md"
#: Of what makers recommend: its name, unit, and scale from SI, and the scene's key.
_RECOMMENDED = {
    "torque_rate": ("torque rate", "N m/s", 1.0, "[torque] rate"),
    "torque": ("joint torque", "% of its limit", 100.0, "[torque] margin"),
    "tool_speed": ("tool speed", "m/s", 1.0, "[robot] tool_speed"),
    "grip_force": ("grip force", "N", 1.0, "[gripper] force"),
}


def summary(plan: Plan, verbose: bool = False, folder: str | None = None) -> str:
    """A plan as lines for people.

    folder: where its files are, for the commands to go on with. verbose: also the solver, all
    margins, notes and warnings in full.
    """
    first, *lines = _solved(plan, folder) if plan.solved else _not_found(plan, folder)
    if verbose:
        lines += _details(plan)
    lines += _alternatives(plan, verbose)
    return "\n".join([first, *(f"  {line}" for line in lines)])


def _solved(plan: Plan, folder: str | None) -> Iterator[str]:
    """The lines of a plan with a throw."""
    assert plan.throw is not None
    throw = plan.throw.deciding
    yield _status(plan)
    yield _where(plan)
    yield _quiet(plan)
    unchecked = unchecked_words(plan.scene)
    tail = f"; {unchecked}" if unchecked else ""
    yield _fit("margins: ", [words for _, words in margins(throw)], tail=tail)
    yield from exceeded_lines(plan.exceeds)
    if any(finding.code is Code.MODELS_DIFFER for finding in plan.verdict.warnings):
        yield models_words([throw], _robust_helps(plan))
    if plan.delay is not None:
        yield _delay(plan)
    if often := _often(plan):
        yield _fit("how often: ", often, "; ", count=True)
    if words := assumed_words(plan.scene, plan.assumed, plan.target):
        yield words
    yield _next(plan, folder)


def _status(plan: Plan) -> str:
    """What the plan is: how it was judged, its error against the tolerance, its time."""
    assert plan.throw is not None
    tolerance, goal, name = plan.scene.tolerance, plan.goal, plan.scene.name
    if plan.short_of is not None:
        return f"{name}: lands beside its target, {_pose(plan.short_of)}: the nearest throw found"
    model = "the limit surface" if tolerance.model == STEPPED_SURFACE else "the sliding pivot"
    model = model if plan.scene.release is None else plan.scene.release.__name__
    allowed = [f"{1e3 * tolerance.position:.3g} mm"]
    if goal.theta is not None:
        allowed.append(f"{math.degrees(tolerance.angle):.3g}°")
    off = _off(*plan.error_sent(), angle=goal.theta is not None)
    place = f"within {off} of the target (tolerance {', '.join(allowed)})"
    if goal.is_region:
        near = "inside" if not any(plan.error_sent()) else f"within {off} of"
        place = f"{near} the region (tolerance {', '.join(allowed)})"
    moves = "" if plan.target.velocity is None else f" at {plan.target.speed:g} m/s"
    return f"{name}: solved by {model}, {place}{moves}{_took(plan)}"


def _where(plan: Plan) -> str:
    """Where the object lands, and when the gripper is commanded, lets go, and the object lands."""
    assert plan.throw is not None
    throw, goal = plan.throw.deciding, plan.goal
    theta = None if goal.theta is None else throw.landing.theta
    place = _pose(goal.in_plane(throw.landing.x, theta) if goal.is_region else goal)
    if theta is None:
        place += f" ({_range(math.degrees(throw.landing.theta), 0.0, 1)}°)"
    v_x, v_z, _ = throw.hand(np.array([throw.opening_time])).twist[:, 0]
    verb = "throws" if math.hypot(v_x, v_z) > DROP else "drops"
    times = throw.command_time, throw.detach_time, throw.landing_time
    said = zip(("command", "let go", "lands"), times, strict=True)
    moments = [f"{words} {abs(time):.3f} s" for words, time in said]
    return _fit(f"{verb} to {place}; ", moments)


def _quiet(plan: Plan) -> str:
    """What the pads carry while they open, and what follows."""
    load = plan.peak_load
    assert load is not None
    if load < QUIET:
        return f"quiet: while the pads open they carry at most {load_words(load)} of their grip"
    counts, cure = "delay and friction count", "measure both"
    if plan.delay is not None:
        tolerance, x, theta = plan.scene.tolerance, *np.abs([plan.delay.early, plan.delay.late]).T
        turn = theta.max() if plan.target.theta is not None else 0.0
        if x.max() <= tolerance.position and turn <= tolerance.angle:
            counts, cure = "friction counts", "measure it"
    if _robust_helps(plan):
        cure = "plan with --robust"
    words = f"not quiet: to hold on, the opening pads need up to {load_words(load)} of their grip"
    return f"{words}, so {counts}: {cure}"


def load_words(load: float) -> str:
    """A load on the pads, a share of their grip, as text."""
    return f"{100 * load:.0f} %" if load >= QUIET else f"{100 * load:.2g} %"


def margins(throw: Throw) -> list[tuple[float, str]]:
    """Of each limit on a throw: the room to it, a share of the limit, and the value with the limit
    as text; the least room first."""
    scene, measures = throw.scene, measures_of(throw)
    found = list[tuple[float, str]]()

    def used(name: str, value: float, limit: float, unit: str, decimals: int = 0) -> None:
        words = f"{name} {value:,.{decimals}f} of {limit:,g} {unit}"
        found.append((1 - value / limit if limit > 0.0 else 0.0, words))

    grip = 100 * float(measures.value("grip")[0])
    used("grip", grip, round(100 * (1 - scene.gripper.sticking_margin), 2), "%")
    if torque_limits(scene) is not None:
        joints = throw.manipulator.joints
        shares = measures.torque[0][0, : len(joints)]
        worst, allowed = int(shares.argmax()), round(100 * (1 - scene.torque_margin), 2)
        used(f"{joints[worst]}'s torque", 100 * float(shares[worst]), allowed, "%")
        if scene.torque_rate is not None:
            used("torque rate", float(measures.value("rate")[0]), scene.torque_rate, "N m/s")
    if scene.tool_speed is not None:
        used("tool speed", float(measures.value("speed")[0]), scene.tool_speed, "m/s", 2)
    floor, column = scene.bounds.floor, None if column_of(scene) is None else 0.0
    room = scene.opening
    for name, keys, least, height in (
        (
            "wall" if room is None else f"{room.KIND}'s wall",
            ("cup",),
            None if room is None else room.clearance,
            0.0,
        ),
        ("palm", ("palm",), scene.palm_clearance, 0.0),
        ("base column", ("column_held", "column_flown"), column, 0.0),
        ("floor", ("arm", "held"), None if floor is None else 0.0, floor or 0.0),
    ):
        gaps = [measures.value(key) for key in keys]
        if keys == ("cup",) and scene.bin is not None:
            gaps = [scene.bin.distance(scene.object, gaps[0])]
        distance = min(float(gap[0]) for gap in gaps) - height
        if least is not None and math.isfinite(distance):
            left = max(distance - least, 0.0)
            words = f"{name} {1e3 * distance:.0f} mm (least {1e3 * least:.0f})"
            found.append((left / (left + NEAR), words))
    return sorted(found)


def models_words(throws: Iterable[Throw], robust: bool = False) -> str:
    """How far the landings of the two release models are apart at most, and what to do; robust:
    whether --robust may be asked for."""
    apart, tolerance = [0.0, 0.0], None
    for throw in throws:
        pivot, surface = (
            throw.with_model(model).landing for model in (SLIDING_PIVOT, STEPPED_SURFACE)
        )
        tolerance = throw.scene.tolerance
        turn = 0.0 if throw.target.theta is None else abs(pivot.theta - surface.theta)
        off = abs(pivot.x - surface.x), turn
        apart = [max(old, new) for old, new in zip(apart, off, strict=True)]
    assert tolerance is not None
    cure = "test slowly" + (", or plan with --robust" if robust else "")
    if not math.isfinite(apart[0]):
        return f"only one of the two release models comes down at the target's height: {cure}"
    allowed = [f"{1e3 * tolerance.position:.3g} mm"] if apart[0] > tolerance.position else []
    if apart[1] > tolerance.angle:
        allowed.append(f"{math.degrees(tolerance.angle):.3g}°")
    said = f"{_off(*apart)} (tolerance {', '.join(allowed)})"
    return f"the two release models disagree by {said}: {cure}"


def _delay(plan: Plan) -> str:
    """What an opening that is early or late does."""
    assert plan.delay is not None
    delay, angle = plan.delay, plan.target.theta is not None
    error = plan.scene.object.pose_error
    late = {"early": delay.early, "late": delay.late}
    when, (x, theta) = max(
        late.items(), key=lambda one: np.nan_to_num(error(*map(abs, one[1])), nan=math.inf)
    )
    lands = f"lands {_off(abs(x), abs(theta), angle=angle)} off"
    if not math.isfinite(x):
        lands = "misses the target's height"
    return f"delay: succeeds {delay.scan.words}; {1e3 * SAID:g} ms {when} {lands}"


def _often(plan: Plan) -> list[str]:
    """What is known of how often the throw succeeds, and what to do about it."""
    robust, warned = _robust_helps(plan), plan.verdict.warnings
    facts = [uncertain_words(one, robust) for one in warned if one.code is Code.UNCERTAIN]
    if (rests := plan.rests) is not None:
        words = f"rests {rests.rest.place} in {rests.rests} of {rests.of} throws"
        asked = f"{words}, {100 * rests.rest.at_least:g} % asked"
        cure = Code.REST.cure.partition(",")[0]
        facts.append(f"{asked}: {cure}" if rests.findings else words)
    if (known := plan.calibrated) is not None:
        different = (*known.setup, *known.speeds)
        facts.append(
            known.words or f"[calibration] does not hold here: {different[0]}: calibrate again"
        )
    if plan.sampled:
        facts.append(plan.sampled)
    if words := _at_bounds(plan):
        cure = "--robust aims inside" if robust else "throwplan map shows what is in reach"
        facts.append(f"{words}: {cure}")
    if (into := plan.scene.opening) is not None and plan.rests is None:
        facts.append(f"staying in the {into.KIND} is not counted ([rest] does)")
    return facts


def uncertain_words(finding: Finding, robust: bool = False) -> str:
    """How many throws break a limit under [uncertainty], and what to do; robust: as for
    `models_words`."""
    code = next(code for code in Code if code.value == finding.body)
    few = f"{100 * finding.value:.0f} %" if finding.value >= 0.005 else "less than 1 %"
    return f"under [uncertainty] {few} {code.fate}: {'plan with --robust' if robust else code.cure}"


def _at_bounds(plan: Plan) -> str:
    """A sentence about a landing at the bounds of a region; empty elsewhere.

    At a bound: nearer than the tolerance, or, with [calibration], than measured throws scatter.
    """
    assert plan.throw is not None
    scene, target, landing = plan.scene, plan.goal, plan.throw.deciding.landing
    known, tolerance = scene.calibration, scene.tolerance
    near = [tolerance.position, tolerance.angle]
    if known is not None:
        near = np.maximum(near, [known.position, known.angle]).tolist()
    off = abs(landing.x - target.plane_x), abs(landing.theta - (target.theta or 0.0))
    # Every landing in a range that is no wider than the tolerance is near both bounds.
    least = (0.0, 0.0) if known is not None else near
    bounds = [
        name
        for name, far, half, room, narrow in zip(
            ("x", "theta"), off, target.half_widths, near, least, strict=True
        )
        if half > narrow and far > half - room
    ]
    if not bounds:
        return ""
    words = f"at the region's bound of {' and '.join(bounds)}"
    return words if known is None else f"{words}, nearer than your throws scatter"


def exceeded_lines(found: Mapping[str, tuple[float, float]], may: str = "") -> Iterator[str]:
    """A line for each recommendation of a maker that a throw exceeds; may: words for what it only
    may."""
    for name, (value, most) in found.items():
        words, unit, scale, key = _RECOMMENDED[name]
        own = f"{scale * value:,.0f}" if scale * value >= 100.0 else f"{scale * value:.3g}"
        write = f"{1.0 - most if name == 'torque' else most:.9g}"
        yield (
            f"{may}{words} {own} {unit}, the maker recommends at most {scale * most:,.9g}: write "
            f"{key} = {write}"
        )


def unchecked_words(scene: Scene) -> str:
    """What is not checked, constraints of one's own or parts of an arm, and what to do; empty where
    all is."""
    names, cures = [one.name for one in scene.constraints if one.check is None], list[str]()
    if names:
        cures.append("give each constraint a check")
    if scene.robot is not None and (arm := scene.arm) is not None:
        parts = {"torques": ("[[links]]", arm.links), "contacts": ("[[capsules]]", arm.capsules)}
        missing = {name: key for name, (key, given) in parts.items() if not given}
        if missing:
            names += missing
            cures.append(f"give arm {arm.name} {', '.join(missing.values())}")
    return f"not checked: {', '.join(names)} ({'; '.join(cures)})" if names else ""


def assumed_words(scene: Scene, assumed: Sequence[str], target: Pose | None = None) -> str:
    """What a plan of a scene to a target assumes, and what to do, in one line; empty if nothing."""
    names = list[str]()
    for name in sorted(assumed, key=lambda name: WEIGHTIEST.index(name.partition(".")[0])):
        section, _, key = name.partition(".")
        if section == "uncertainty":
            spread = getattr(scene.uncertain, key)
            share = f"{100 * spread.uniform:g} %"
            names.append(f"{key} ±{share if spread.relative else f'{1e3 * spread.uniform:g} ms'}")
        else:
            # One section's keys stand together.
            new = not any(name.startswith(f"{section} ") for name in names)
            names.append((f"{section} " if new else "") + key.replace("_", " "))
    tail, floor = f" ({MEASURE})" if names else "", scene.bounds.floor
    if floor is not None and target is not None and target.z < floor:
        names.insert(0, "no [[obstacle]] below the floor")
    return _fit("assumed: ", names, tail=tail, count=True) if names else ""


def _next(plan: Plan, folder: str | None) -> str:
    """Commands to go on with, which fit the scene's robot."""
    if plan.short_of is not None:
        return "next: plan to this landing, or change the limits that hold the throw there"
    if plan.scene.release is not None:
        return (
            "next: tp.sweep(plan) and robots.export(plan) in Python, where the release law is known"
        )
    where = "DIR" if folder is None else shlex.quote(folder)
    commands = [f"throwplan sweep {where}", f"throwplan replay {where}"]
    if (arm := plan.scene.arm) is not None:
        own_hand = arm.tool.open_width <= OPENS
        if arm.name == RUNS and own_hand:
            commands.insert(1, f"throwplan run {where} --robot HOST --rehearse")
        else:
            files = "--franka" if arm.name in FRANKA and own_hand else "--ros"
            commands.append(f"throwplan export {where} {files} TO")
    head = "next: "
    if notes := len(plan.scene.notes):
        head += f"--verbose ({notes} note{'s' if notes > 1 else ''}), "
    head += "" if folder is not None else "plan with --out DIR, then "
    return _fit(head, commands)


def _not_found(plan: Plan, folder: str | None) -> Iterator[str]:
    """The lines of a plan without a throw."""
    target, name = plan.target, plan.scene.name
    yield f"{name}: no throw found to {_pose(target)}{_took(plan)}"
    if plan.bound is not None:
        yield f"out of reach: {plan.bound.words}"
    if plan.nearest is not None and plan.nearest.throw is not None:
        pose = plan.nearest.target
        miss = target.miss(pose.plane_x, pose.theta or 0.0)
        at = "" if folder is None else f": {shlex.quote(folder)}/nearest"
        off = _off(*map(abs, miss), angle=target.theta is not None)
        yield f"the nearest throw found lands at {_pose(pose)}, {off} off{at}"
    if plan.binding:
        holds = "held there by " if plan.nearest is not None else "most attempts end at "
        yield _fit(holds, [one.limit for one in plan.binding], count=True)
        helps = list(dict.fromkeys(one.advice for one in plan.binding if one.advice))
        if helps:
            yield _fit("what helps: ", helps, "; ", count=True)
    elif (why := plan.message.removeprefix("no throw found: ")) != plan.message:
        yield f"why: {why}"
    scene = shlex.quote(plan.scene.file or name)
    advice = [f"throwplan map {scene} --z {target.z:g} (what it reaches)"]
    if CUT_SHORT in plan.message:
        advice.append("a longer --patience")
    if target.angle_hint:
        advice.append(target.angle_hint.removeprefix("; "))
    yield _fit("next: ", advice)


def _alternatives(plan: Plan, verbose: bool) -> Iterator[str]:
    """A line for each other throw."""
    for number, other in enumerate(plan.alternatives, start=1):
        if other.throw is None:
            continue
        throw = other.throw.deciding
        flight = throw.landing.flight_time
        effort = f", effort {other.throw.effort:.2f}" if verbose else ""
        yield (
            f"alternative {number}: opening commanded at {throw.command_time:.3f} s, flies "
            f"{flight:.3f} s{effort}"
        )


def _details(plan: Plan) -> Iterator[str]:
    """What stands behind the lines: solver, models, margins, warnings and notes."""
    scene = plan.scene
    yield (
        f"{plan.solver}, {plan.iterations} iterations from {plan.starts} starts, "
        f"{plan.variables} variables, {plan.constraints} constraints"
    )
    if not plan.solved:
        yield plan.message
    elif plan.throw is not None:
        throw = plan.throw.deciding
        models = {"limit_surface": "the limit surface", "sent": "the sliding pivot"}
        if scene.release is not None:
            models = {"own": scene.release.__name__} | models
        for key, model in models.items():
            x, z, theta = plan.throw.landings[key]
            pose = plan.target.in_plane(x, theta).changed(z=z, velocity=None, arrival=None)
            yield f"by {model} it lands at {_pose(pose, 4)}"
        for _, words in margins(throw):
            yield f"margin: {words}"
        if torque_limits(scene) is not None:
            joint, step = max(
                zip(throw.manipulator.joints, throw.load_steps.tolist(), strict=True),
                key=lambda one: one[1],
            )
            yield (
                f"as the pads let go, {joint} loses a load of {step:.2f} N m in {1e3 * TICK:g} ms: "
                "a disturbance, not a command"
            )
    if plan.calibrated is not None:
        yield plan.calibrated.aim_words
    if plan.rests is not None:
        yield plan.rests.words
    if plan.solved and (words := _at_bounds(plan)):
        yield words
    if plan.assumed:
        yield f"assumed: {', '.join(plan.assumed)}"
    yield from (f"warning: {finding.words}" for finding in plan.verdict.warnings)
    yield from (f"note: {words}" for words in scene.notes)
    if scene.gripper.raw:
        grip = scene.gripper.profile()
        yield (
            f"grip from the recording: full {grip.full:.4g} N, dwell {1e3 * grip.dwell:.1f} ms, "
            f"opening {1e3 * grip.opening:.1f} ms"
        )


def _robust_helps(plan: Plan) -> bool:
    """Whether --robust may be advised: not for a target that moves, nor twice."""
    return plan.target.is_fixed and not plan.robust and plan.manipulator.under_way is None


def _took(plan: Plan) -> str:
    """The time of planning, empty for a saved plan."""
    if not plan.time:
        return ""
    seconds = plan.time["total"]
    return f", in {seconds:.0f} s" if seconds >= 10.0 else f", in {seconds:.2g} s"


def _off(x: float, theta: float, *, angle: bool = True) -> str:
    """The sizes of an error [m, rad] as text; angle: with theta."""
    sizes = [(1e3 * x, " mm"), (math.degrees(theta), "°")][: 1 + angle]
    return " and ".join(f"{_size(size)}{unit}" for size, unit in sizes)


def _size(size: float) -> str:
    """A size rounded up to two digits, to 0.01 at least."""
    least = max(size, 0.01)
    step = 10.0 ** max(math.floor(math.log10(least)) - 1, -2)
    return f"{math.ceil(least / step - 1e-9) * step:.9g}"


def _pose(pose: Pose, digits: int = 3) -> str:
    """A pose or a region as text; digits: decimals of lengths."""
    x, turn = pose.half_widths
    aside = f", y {_range(pose.y, 0.0, digits)}" if abs(pose.y) >= 5e-4 else ""
    theta = "any theta"
    if pose.theta is not None:
        theta = f"theta {_range(math.degrees(pose.theta), math.degrees(turn), digits - 2)}°"
    return f"x {_range(pose.x, x, digits)}{aside}, z {_range(pose.z, 0.0, digits)} m, {theta}"


def _range(middle: float, half: float, digits: int) -> str:
    """A number, or the ends of a range, as text."""
    ends = [middle - half, middle + half] if half else [middle]
    return " to ".join(f"{round(end, digits) + 0.0:g}" for end in ends)


def _fit(
    head: str, parts: Sequence[str], between: str = ", ", tail: str = "", *, count: bool = False
) -> str:
    """A line of as many parts as it takes, one at least, and the tail; count: says how many are
    left out."""
    for kept in range(len(parts), 0, -1):
        left = [f"{len(parts) - kept} more"] if count and kept < len(parts) else []
        line = head + between.join([*parts[:kept], *left]) + tail
        if len(line) <= WIDTH - 2:
            break
    return line
