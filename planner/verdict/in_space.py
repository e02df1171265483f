"""The verdict on a motion of all joints of an arm, with the object in the hand or without.

Throws move in a vertical plane, and `verdict` judges them there; this is for what is between them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...models import Array
from ...models.robot import PadMotion, segment_distance
from ..throw import TICK, Samples, Throw, arm_excesses
from .clearance import BAR, Clearance, SpatialScene, bar_ends, bar_radii
from .findings import JOINT_LIMITS, Code, Finding, Verdict
from .grip_in_space import grip_findings
from .motion import FLYING, NEAR, collision

#: Distance [samples] of the instants by which most motions are found clear of collisions.
PLACES = 10
#: Distance [samples] of the instants by which a search refuses most motions.
COARSE = 8


def motion_verdict(
    space: SpatialScene, samples: Samples, *, held: bool, loads: bool = True
) -> Verdict:
    """All limits that a motion of all joints breaks.

    samples: of all joints, (N, joints); held: whether the hand holds the object all the time;
    loads: whether grip, torques and tool speed are judged, too, which an emergency stop may exceed.
    """
    limits = _findings(space, samples, held, 1, loads)
    return Verdict((*limits, *_collisions(space, samples, held)))


def first_finding(space: SpatialScene, samples: Samples, *, held: bool) -> Finding | None:
    """The first limit found that a motion breaks, None if it breaks none; see `motion_verdict`.

    A search refuses most motions by few samples.
    """
    found = itertools.chain(
        _findings(space, samples, held, COARSE),
        _collisions(space, samples, held),
        _findings(space, samples, held, 1),
    )
    return next(found, None)


def _findings(
    space: SpatialScene, samples: Samples, held: bool, step: int, loads: bool = True
) -> Iterator[Finding]:
    """Broken limits but collisions, by every `step`-th sample and the last; those of the joints,
    and the grip between samples, by all only."""
    count = len(samples.q)
    rows = np.unique(np.append(np.arange(0, count, step), count - 1))
    states = samples.q[rows], samples.dq[rows], samples.ddq[rows]
    motion = _SpatialMotion(space, TICK * rows, *states, space.spatial.pads(*states), held)
    if held and loads:
        yield from _grip(motion) if step > 1 or count < 2 else _grip_between(motion, samples)
    for rule in (_tool_speed, _low, _column, _torque) if loads else (_low, _column):
        yield from rule(motion)
    for e in arm_excesses(space.kinematics.arm, samples) if step == 1 else ():
        yield Finding(JOINT_LIMITS[e.kind], e.value, e.limit, e.time, e.joint)


@dataclass(frozen=True)
class _SpatialMotion:
    """A motion that is judged: joints (N, joints) at times (N,) [s], and the pads' motion."""

    space: SpatialScene
    times: Array
    q: Array
    dq: Array
    ddq: Array
    pads: PadMotion
    held: bool


def _worst(
    code: Code, times: Array, values: Array, limit: float, body: str = ""
) -> Iterator[Finding]:
    """A finding if the largest of values (N,) at times (N,) [s] is above the limit."""
    k = int(values.argmax())
    if values[k] > limit:
        yield Finding(code, float(values[k]), limit, float(times[k]), body)


def _tool_speed(motion: _SpatialMotion) -> Iterator[Finding]:
    limit = motion.space.scene.tool_speed
    if limit is not None:
        both = np.linalg.norm([motion.pads.velocity, motion.pads.flange_velocity], axis=2)
        yield from _worst(Code.TOOL_SPEED, motion.times, both.max(axis=0), limit)


def _torque(motion: _SpatialMotion) -> Iterator[Finding]:
    scene, arm = motion.space.scene, motion.space.kinematics.arm
    if not arm.links:
        return
    limits, most = np.array(arm.limits.torque), 1.0 - scene.torque_margin
    throwing, section = np.array(motion.space.kinematics.throwing_joints) - 1, scene.torque
    if section is not None:
        limits[throwing] = section.of(arm, motion.space.kinematics.throwing_joints)
    load = np.zeros((len(motion.q), 6))
    if motion.held:
        load = np.hstack(motion.space.object_wrench(motion.pads))
    states = motion.q, motion.dq, motion.ddq
    torques = motion.space.spatial.torques(*states, scene.gravity, load)
    for j, use in enumerate((np.abs(torques) / limits).T, start=1):
        yield from _worst(Code.TORQUE, motion.times, use, most, f"joint {j}")
    if scene.torque_rate is not None and len(torques) > 1:
        change = np.abs(np.diff(torques[:, throwing], axis=0)).max(axis=1)
        rates = change / np.diff(motion.times)
        yield from _worst(Code.TORQUE_RATE, motion.times[1:], rates, scene.torque_rate)


def _grip(motion: _SpatialMotion) -> Iterator[Finding]:
    return grip_findings(motion.space, motion.pads, motion.times)


def _grip_between(motion: _SpatialMotion, samples: Samples) -> Iterator[Finding]:
    """The grip at all samples, and in the middle between two: where a jerk changes there, the
    object accelerates more."""
    space, times = motion.space, np.linspace(0.0, samples.times[-1], 2 * len(samples.q) - 1)
    pads = space.spatial.pads(*(rows.T for rows in samples.path.at(times)))
    return grip_findings(space, pads, times)


def _low(motion: _SpatialMotion) -> Iterator[Finding]:
    floor = motion.space.scene.bounds.floor
    if floor is None:
        return
    lowest = {"hand": motion.pads.pose[:, 2, 3]}
    if motion.held:
        lowest[BAR] = motion.space.lowest_of_bar(motion.pads)
    for body, heights in lowest.items():
        if floor - heights.min() > NEAR:
            when = float(motion.times[heights.argmin()])
            yield Finding(Code.FLOOR, float(heights.min()), floor, when, body)


def _column(motion: _SpatialMotion) -> Iterator[Finding]:
    bounds = motion.space.scene.bounds
    if not motion.held or bounds.column_radius is None or bounds.column_height is None:
        return
    room = motion.space.column_distance(motion.pads, bounds.column_radius, bounds.column_height)
    if room.min() < -NEAR:
        yield Finding(Code.COLUMN, float(room.min()), 0.0, float(motion.times[room.argmin()]), BAR)


def _collisions(space: SpatialScene, samples: Samples, held: bool) -> Iterator[Finding]:
    """Bodies too near to each other."""
    yield from map(collision, _clearances(space, samples, held))


def obstacles_hit(space: SpatialScene, samples: Samples, *, held: bool) -> frozenset[str]:
    """Names of the scene's obstacles that a motion comes too near to; see `motion_verdict`."""
    things = (pair.thing for pair in _clearances(space, samples, held))
    return frozenset(thing.name for thing in things if thing is not None and thing.bar)


def _clearances(space: SpatialScene, samples: Samples, held: bool) -> list[Clearance]:
    """Pairs of bodies too near to each other.

    The core takes off half the way between two instants, so what few instants do not clear, all
    samples decide.
    """
    if len(samples.q) < 2 or (space.manipulator.capsules is None and not space.scene.bodies_around):
        return []
    pairs = list[Clearance]()
    for step in (PLACES, 1):
        rows = np.unique(np.append(np.arange(0, len(samples.q), step), len(samples.q) - 1))
        few = samples[rows]
        bar = space.held_ends(space.spatial.pads(*few.rows)) if held else None
        pairs = space.around.clearances(space.bodies(few.q, TICK * rows, bar))
        if not pairs:
            break
    return pairs


#: Distance [m] of the open hand from the object that it comes for, if it is as far at the grasp.
OPEN = 0.01


def approach_findings(space: SpatialScene, samples: Samples, joints: Array) -> tuple[Finding, ...]:
    """Whether the arm touches the object that it comes for, its fingers open.

    samples: of all joints (N, joints), until the grasp. joints (joints,): at the grasp, where the
    object stands as the hand will hold it. The hand keeps `OPEN` from it, or its distance at the
    grasp if that is less; so does the rest of the arm.
    """
    if space.manipulator.capsules is None:
        return ()
    rows = np.vstack([samples.q, joints])
    times: Array = np.float64(TICK) * np.arange(len(rows))
    own = space.object_in_pads(rows, joints)
    track = space.open_hand.swept(times, None, own)
    gaps = {"hand": space.open_hand.min_clearance(track)}
    q = np.tile(joints, (len(rows), 1))
    placed = np.moveaxis(space.held_ends(space.spatial.pads(q, 0 * q, 0 * q)), -1, 2)
    bodies = space.bodies(rows, times)
    for capsule, name, ends, radius in zip(
        space.kinematics.arm.capsules, bodies.names, bodies.ends, bodies.radius, strict=True
    ):
        if 0 < capsule.link < space.kinematics.arm.joints:
            for part, size in zip(placed, bar_radii(space.scene.object), strict=True):
                away = segment_distance(ends[0].T, ends[1].T, *part)
                gaps[name] = np.minimum(gaps.get(name, np.inf), away - radius - size)
    found = list[Finding]()
    for body, gap in gaps.items():
        limit, k = min(OPEN, float(gap[-1])), int(gap.argmin())
        if gap[k] < limit - NEAR:
            words = Code.COLLISION, float(gap[k]), limit, float(times[k])
            found.append(Finding(*words, f"open {body}", "the object that it comes for"))
    return tuple(found)


def flight_gaps(space: SpatialScene, throw: Throw, samples: Samples, begins: float) -> Array:
    """Least distance (N,) [m] of the arm and the object that flies, at samples from `begins` [s] on
    the throw's clock until the landing; infinite for an arm without a shape.

    samples: of all joints (N, joints); after their end the arm rests.
    """
    times = np.arange(begins, throw.landing_time, TICK)
    gaps = np.full(times.size, np.inf)
    if space.manipulator.capsules is None or not times.size:
        return gaps
    com = throw.flight(times - throw.detach_time)
    bar, plane = throw.scene.object, throw.target.plane
    parts = [[plane.points(end[0], end[2]) for end in part] for part in bar_ends(bar, com)]
    q = samples.q[np.minimum(np.arange(times.size), len(samples.q) - 1)]
    bodies = space.bodies(q, times)
    for links, own in zip(bodies.ends, bodies.radius, strict=True):
        for placed, radius in zip(parts, bar_radii(bar), strict=True):
            gap = segment_distance(links[0].T, links[1].T, *placed) - own - radius
            np.minimum(gaps, gap, out=gaps)
    return gaps


def flight_findings(
    space: SpatialScene, throw: Throw, samples: Samples, begins: float
) -> tuple[Finding, ...]:
    """Whether the arm touches the object that flies; arguments as of `flight_gaps`.

    Before, `verdict` of the throw measures the distance of hand and object.
    """
    gaps = flight_gaps(space, throw, samples, begins)
    if not gaps.size or gaps.min() >= -NEAR:
        return ()
    when = begins + TICK * int(gaps.argmin())
    return (Finding(Code.COLLISION, float(gaps.min()), 0.0, when, FLYING, "arm"),)
