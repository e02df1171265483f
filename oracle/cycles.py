"""All limits on a saved cycle: one motion of all joints from rest to rest, and its throws."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from throwplan.problems.scene_files import scene_from_table

from . import shapes
from .clearance import LANDS, Flight, Solid, may_overlap, solids_of
from .files import columns_of
from .judge import Judged, Oracle, joint_limits
from .motion import TICK, Array, Curve, Frame, Plane, Samples, frames_of, joint_torque, quintics

#: Largest landing error (position [m], angle [rad]) beyond the scene's tolerance.
LANDING = 2e-4, math.radians(0.05)
#: Largest difference [s] of a landing's time from the planner's.
TIMES = 1e-3
#: Allowed violation [m] of a distance.
NEAR = 1e-6
#: Allowed violation [m] of the base column, which the planner measures at nine points of an axis.
COLUMN_NEAR = 1e-3
#: Clearance [m] of an object that waits at its pick.
WAITING = 0.01
#: Distance [samples] of the instants at which distances are measured.
EVERY = 2
#: Allowed excess over the grip, which the planner takes at the samples and between two.
GRIP_EXCESS = 2e-3
#: Number of points along an axis at which it is compared with the base column.
ALONG = 41


@dataclass(frozen=True)
class Carried:
    """The object in the pads' frame: com (3,), inertia about it (3, 3), capsules (ends (2, 3),
    radius), and points (K, 3, with radii (K,)) among which its lowest one is."""

    com: Array
    inertia: Array
    capsules: list[tuple[Array, float]]
    points: Array
    radii: Array

    @classmethod
    def of(cls, scene: Any) -> Carried:
        """As the hand holds it: its axis at the grasp angle in the throw's plane."""
        arm, thing, grasp = scene.arm, scene.object, scene.grasp
        posture = np.array(arm.posture)[None]
        pads = frames_of(arm, posture, 0 * posture, 0 * posture)[-1]
        # Angles in the plane turn about -y of the base.
        normal = np.array([0.0, -np.sign(pads.axes[0, 1, 1]), 0.0])
        approach, c, s = np.array([0.0, 0.0, 1.0]), math.cos(grasp.angle), math.sin(grasp.angle)
        along = c * approach + s * np.cross(normal, approach)
        across = np.cross(normal, along)

        def place(a: float, b: float) -> Array:
            return np.asarray((a - grasp.offset) * along + b * across)

        half = thing.width / 2
        capsules = [
            (np.array([place(*part.begin), place(*part.end)]), part.radius)
            for part in thing.outline
        ]
        points, radii = [end for ends, _ in capsules for end in ends], [r for _, r in capsules]
        if not capsules:
            ends = np.array([place(0.0, 0.0), place(thing.length, 0.0)])
            capsules = [(ends, half * math.sqrt(2))]
            signs = itertools.product(ends, (-half, half), (-half, half))
            points = [end + a * across + b * normal for end, a, b in signs]
        own = thing.mass * thing.width**2 / 6
        own = min(own, 2 * thing.inertia)
        inertia = thing.inertia * np.eye(3) + (own - thing.inertia) * np.outer(along, along)
        sizes = np.repeat(radii, 2) if thing.outline else np.zeros(len(points))
        return cls(place(thing.com, 0.0), inertia, capsules, np.array(points), sizes)

    def placed(self, pads: Frame) -> Iterator[tuple[tuple[Array, Array], float]]:
        """Both ends (K, 3) of each capsule in the base frame, and its radius."""
        for (begin, end), radius in self.capsules:
            yield (pads.point(begin)[0], pads.point(end)[0]), radius


def broken_limits(folder: Path) -> list[str]:
    """What a saved cycle breaks."""
    judge, closed = _read(folder)
    found = *judge.joints(), *judge.itself(), *judge.parts(), *judge.waiting()
    return [*found, *judge.gripper(closed)]


def gap_to_waiting(folder: Path, number: int, q: Array) -> float:
    """Least distance [m] of the arm with joints q (K, joints), and of the object of a saved cycle's
    step in its hand, from the objects of later steps at their picks; infinite without these."""
    judge, _ = _read(folder)
    frames, arm = frames_of(judge.arm, q, 0 * q, 0 * q), judge.arm
    parts = [
        (*(frames[c.link].point(end)[0] for end in (c.begin, c.end)), c.radius)
        for c in arm.capsules
        if c.link > 1
    ]
    own = Carried.of(judge.scenes[number]).placed(frames[-1])
    parts += [(*ends, radius) for ends, radius in own]
    others = [each for k in range(number + 1, len(judge.steps)) for each in judge.at_pick(k)]
    gaps = (
        shapes.between_segments(begin, end, *ends).min() - size - radius
        for (begin, end, size), (ends, radius) in itertools.product(parts, others)
    )
    return min(gaps, default=math.inf)


def _read(folder: Path) -> tuple[_CycleJudge, Array]:
    """The judge of a saved cycle, and where the gripper is closed."""
    cycle = json.loads((folder / "cycle.json").read_text(encoding="utf-8"))
    columns, arm = columns_of(folder / "motion.csv"), cycle["arm"]
    steps = cycle["steps"]
    scenes = [scene_from_table({**step["definition"], "arm": arm}) for step in steps]
    joints = range(1, scenes[0].arm.joints + 1)
    kinds = (np.column_stack([columns[f"{k}{j}"] for j in joints]) for k in ("q", "dq", "ddq"))
    return _CycleJudge(steps, scenes, Samples(columns["t"], *kinds)), columns["gripper"]


class _CycleJudge:
    """The motion of a cycle, and the steps of its cycle.json with their scenes."""

    def __init__(self, steps: list[Any], scenes: list[Any], samples: Samples) -> None:
        self.steps, self.scenes, self.samples = steps, scenes, samples
        self.arm = scenes[0].arm
        t, q, dq, ddq = samples.times, samples.q, samples.dq, samples.ddq
        self.frames = frames_of(self.arm, q, dq, ddq)
        self.between = quintics(t, q, dq, ddq)
        #: Ends (2, K, 3) and radius of the links' capsules at all samples, and their links.
        self.links = [
            (np.array([self.frames[c.link].point(e)[0] for e in (c.begin, c.end)]), c.radius)
            for c in self.arm.capsules
        ]
        self.numbers = [c.link for c in self.arm.capsules]
        #: By the pick, both ends (K, 3) and radius of the capsules of an object that flies.
        self.flown: dict[str, list[tuple[list[Array], float]]] = {}

    def joints(self) -> Iterator[str]:
        """Limits of the joints, and rest at both ends."""
        s, limits = self.samples, self.arm.limits
        which = list(range(self.arm.joints))
        found = joint_limits(s, limits, which)
        yield from (name for name, each in found.items() if each.broken.any())
        if np.abs([s.dq[0], s.dq[-1], s.ddq[0], s.ddq[-1]]).max() > 1e-9:
            yield "not from rest to rest"
        # The samples are one motion: quintics between them do not exceed the velocity either.
        rates = self.between.derivative()(s.times[:-1] + TICK / 2)
        if (np.abs(rates) > np.array(limits.velocity) * (1 + 1e-6)).any():
            yield "joint velocity between samples"

    def itself(self) -> Iterator[str]:
        """Distances of the links from each other."""
        pairs = itertools.combinations(enumerate(self.links), 2)
        for (i, (a, r_a)), (j, (b, r_b)) in pairs:
            one, other = self.numbers[i], self.numbers[j]
            depth = may_overlap(self.arm, i, j)
            if math.isfinite(depth) and {one, other} not in ({0}, {0, 1}):
                ends = (end[::EVERY] for end in (*a, *b))
                away = shapes.between_segments(*ends).min() - r_a - r_b + depth
                if away < -NEAR:
                    yield f"links {one} and {other}: {away:.4f}"

    def at_pick(self, k: int) -> list[tuple[tuple[Array, Array], float]]:
        """The capsules of a step's object where the hand takes it, as of `Carried.placed`."""
        held = self.steps[k]["samples"][1]
        pads = _rows(self.frames[-1], slice(held, held + 1))
        return list(Carried.of(self.scenes[k]).placed(pads))

    def waiting(self) -> Iterator[str]:
        """Distances from the objects at their picks: of the arm until it has thrown the one before,
        and of that and all earlier ones as they are carried and fly; after `parts`."""
        for k, step in enumerate(self.steps):
            own = self.at_pick(k)
            for (begin, end), radius in own if k else ():
                until = slice(0, math.ceil(self.steps[k - 1]["detach_time"] / TICK) + 1, EVERY)
                for (ends, size), number in zip(self.links, self.numbers, strict=True):
                    away = shapes.between_segments(*ends[:, until], begin, end).min()
                    away -= size + radius
                    if number > 1 and away < WAITING - NEAR:
                        yield f"link {number}, {step['pick']} at its pick: {away:.4f}"
            for (other, earlier), mine in itertools.product(
                zip(self.steps[:k], self.scenes, strict=False), own
            ):
                rows = slice(other["samples"][1], math.floor(other["opening_time"] / TICK) + 1)
                pads = _rows(_rows(self.frames[-1], rows), slice(None, None, EVERY))
                flown = self.flown[other["pick"]]
                for how, axes in ("is carried", Carried.of(earlier).placed(pads)), ("flies", flown):
                    for axis, radius in axes:
                        away = shapes.between_segments(*axis, *mine[0]).min(initial=math.inf)
                        away -= radius + mine[1]
                        if away < WAITING - NEAR:
                            words = f"{other['pick']} as it {how}, {step['pick']} at its pick"
                            yield f"{words}: {away:.4f}"

    def gripper(self, closed: Array) -> Iterator[str]:
        """Its commands in motion.csv."""
        for step in self.steps:
            opens = math.ceil(step["command_time"] / TICK - 1e-6)
            if not (closed[step["samples"][0] : opens].all() and closed[opens] == 0.0):
                yield f"{step['pick']}: the gripper's commands"

    def parts(self) -> Iterator[str]:
        """Each way to a pick, each carry, and each throw."""
        last = len(self.samples.q) - 1
        ends = [0, *(step["samples"][3] for step in self.steps)]
        for k, (step, scene) in enumerate(zip(self.steps, self.scenes, strict=True)):
            held = slice(step["samples"][1], math.floor(step["opening_time"] / TICK) + 1)
            empty = slice(ends[k], held.start + 1)
            words = [*self._carry(scene, held), *self._empty(scene, empty)]
            if k == len(self.steps) - 1:
                after = math.ceil(step["detach_time"] / TICK)
                words += self._empty(scene, slice(after, last + 1))
            words += [*self._obstacles(scene, slice(ends[k], last + 1)), *self._throw(scene, step)]
            yield from (f"{step['pick']}: {each}" for each in words)

    def _empty(self, scene: Any, rows: slice) -> Iterator[str]:
        yield from self._loads(scene, rows, np.zeros((rows.stop - rows.start, 6)))
        yield from self._floor(scene, rows)

    def _floor(self, scene: Any, rows: slice) -> Iterator[str]:
        if scene.workspace is None or scene.workspace.floor is None:
            return
        lowest = min(
            ends[:, rows, 2].min() - radius
            for (ends, radius), number in zip(self.links, self.numbers, strict=True)
            if number > 1
        )
        if lowest < scene.workspace.floor - NEAR:
            yield f"arm, floor: {lowest:.4f}"

    def _obstacles(self, scene: Any, rows: slice) -> Iterator[str]:
        """Distances of the arm."""
        for solid in _solids(scene):
            for (ends, radius), number in zip(self.links, self.numbers, strict=True):
                away = solid.distance(*ends[:, rows][:, ::EVERY]).min() - radius
                if number > 1 and away < solid.clearance - NEAR:
                    yield f"link {number}, {solid.name}: {away:.4f}"

    def _carry(self, scene: Any, rows: slice) -> Iterator[str]:
        """Limits while the hand holds the object."""
        thing, pads = Carried.of(scene), _rows(self.frames[-1], rows)
        yield from self._loads(scene, rows, _load(scene, thing, pads))
        yield from self._floor(scene, rows)
        yield from self._grip(scene, thing, rows)
        few = _rows(pads, slice(None, None, EVERY))
        space = scene.workspace
        if space is not None and space.floor is not None:
            lowest = [few.point(p)[0][:, 2].min() for p in thing.points] - thing.radii
            if lowest.min() < space.floor - NEAR:
                yield f"held object, floor: {lowest.min():.4f}"
        half = scene.object.width / 2
        for (begin, end), radius in thing.placed(few):
            if space is not None and space.column_radius is not None:
                share = np.linspace(0.0, 1.0, ALONG)[:, None, None]
                at = begin + share * (end - begin)
                aside = np.hypot(at[..., 0], at[..., 1]) - space.column_radius
                away = np.maximum(aside, at[..., 2] - space.column_height).min()
                away -= radius if scene.object.outline else half
                if away < -COLUMN_NEAR:
                    yield f"held object, base column: {away:.4f}"
            for solid in _solids(scene):
                away = solid.distance(begin, end).min() - radius
                if away < solid.clearance - NEAR:
                    yield f"held object, {solid.name}: {away:.4f}"
            for (ends, own), number in zip(self.links, self.numbers, strict=True):
                if number < self.arm.joints:
                    link = ends[:, rows][:, ::EVERY]
                    away = shapes.between_segments(begin, end, *link).min() - own - radius
                    if away < -NEAR:
                        yield f"held object, link {number}: {away:.4f}"

    def _grip(self, scene: Any, thing: Carried, rows: slice) -> Iterator[str]:
        """Whether the pads hold the object's wrench in space.

        By the law of docs/how-it-works.md: of the pads' force F, tilting takes the share t and the
        force across l; v = 1 - l is left for friction, on a patch smaller by v / (v - t).
        """
        times = TICK * (np.arange(rows.start, rows.stop - 1) + 0.5)
        pads = frames_of(self.arm, *Curve(self.between).at(times))[-1]
        force, torque = np.split(_load(scene, thing, pads), 2, axis=1)
        contact, gripper = scene.contact, scene.gripper
        full = contact.faces * (gripper.forces[0] if gripper.force is None else gripper.force)
        normal = pads.axes[:, :, 1]
        across, twist = (force * normal).sum(axis=1), (torque * normal).sum(axis=1)
        slide = np.linalg.norm(force - across[:, None] * normal, axis=1)
        tilt = np.linalg.norm(torque - twist[:, None] * normal, axis=1)
        tilt /= contact.patch_radius * full
        left = 1.0 + GRIP_EXCESS - np.abs(across) / full
        with np.errstate(divide="ignore"):
            twist = twist / (contact.torsion * contact.patch_radius) * left / (left - tilt)
        used = np.hypot(slide, twist) / (contact.friction * full)
        lost = (tilt >= left) | (used > left)
        if lost.any():
            k = int((used - left).argmax())
            yield f"grip at {times[k]:.4f} s: {used[k]:.4f} of {left[k]:.4f}"

    def _loads(self, scene: Any, rows: slice, load: Array) -> Iterator[str]:
        """Tool speed and torques; load (K, 6): force and torque at the pads."""
        arm, frames = self.arm, [_rows(frame, rows) for frame in self.frames]
        *_, hand, pads = frames
        speed = np.maximum(np.linalg.norm(hand.v, axis=1), np.linalg.norm(pads.v, axis=1))
        own = scene.robot.tool_speed
        most = arm.limits.tool_speed if own is None else own
        if most is not None and speed.max() > most * (1 + 1e-9):
            yield f"tool speed {speed.max():.4f}"
        if not arm.links:
            return
        torques = np.empty((len(load), arm.joints))
        for j, joint in enumerate(frames[1 : arm.joints + 1]):
            moment = load[:, 3:] + np.cross(pads.origin - joint.origin, load[:, :3])
            torques[:, j] = joint_torque(arm, frames, j, scene.gravity)
            torques[:, j] += (joint.axes[:, :, 2] * moment).sum(axis=1)
        limits, section = np.array(arm.limits.torque), scene.torque
        throwing = np.array(scene.robot.throwing_joints or arm.throwing_joints) - 1
        margin, most_rate = arm.limits.torque_margin, arm.limits.torque_rate
        if section is not None:
            limits[throwing] = limits[throwing] if section.limits is None else section.limits
            margin = margin if section.margin is None else section.margin
            most_rate = most_rate if section.rate is None else section.rate
        margin = 0.1 if margin is None else margin
        for j, use in enumerate((np.abs(torques) / limits).max(axis=0), start=1):
            if use > 1 - margin + 1e-9:
                yield f"torque of joint {j} {use:.4f}"
        if most_rate is not None and len(torques) > 1:
            rate = np.abs(np.diff(torques[:, throwing], axis=0)).max() / TICK
            if rate > most_rate * (1 + 1e-6):
                yield f"torque rate {rate:.1f}"

    def _throw(self, scene: Any, step: Any) -> Iterator[str]:
        """The throw from `join` to `free`, by the oracle; its flight beside the arm."""
        first, last = step["samples"][2], step["samples"][3]
        rows, s = slice(first, last + 1), self.samples
        part = Samples(s.times[rows] - s.times[first], s.q[rows], s.dq[rows], s.ddq[rows])
        oracle = Oracle(scene, part, step["opening_time"] - TICK * first)
        judged = oracle.judge(planned=True)
        for name, each in judged.found.items():
            if each.broken[0] and not (name in ("position", "angle") or each.doubtful[0]):
                yield f"throw, {name}: {each.value[0]:.5f} of {each.limit[0]:.5f}"
        x, theta, _ = judged.landing[0]
        dx, dtheta = scene.target.miss(x, theta)
        most = scene.tolerance.position + LANDING[0], scene.tolerance.angle + LANDING[1]
        if abs(dx) > most[0] or abs(dtheta) > most[1]:
            yield f"lands {1e3 * dx:.2f} mm, {math.degrees(dtheta):.2f} deg off"
        lands = TICK * first + judged.lands[0]
        if abs(lands - step["landing_time"]) > TIMES:
            yield f"lands at {lands:.4f} s"
        yield from self._flight(scene, oracle, judged, step)

    def _flight(self, scene: Any, oracle: Oracle, judged: Judged, step: Any) -> Iterator[str]:
        """Distance of the flying object from the arm, whose motion goes on."""
        free, duration = step["samples"][3], float(judged.landing[0, 2])
        flight = Flight(judged.detach[0], step["detach_time"], duration, scene.gravity)
        times = TICK * np.arange(free, int((flight.begins + duration) / TICK))
        planned = oracle.columns({}, 1)
        bar = oracle.bar(oracle.held(planned), {k: float(v[0]) for k, v in planned.items()})
        axes = bar.axes(flight.at(times - flight.begins), oracle.plane)
        # At its landing it may be as near to a waiting object as it lands.
        early = times < flight.begins + duration - LANDS
        self.flown[step["pick"]] = [([end[early] for end in axis], r) for axis, r in axes]
        rows = np.minimum(np.arange(free, free + len(times)), len(self.samples.q) - 1)
        for (begin, end), radius in axes:
            for (ends, own), number in zip(self.links, self.numbers, strict=True):
                away = shapes.between_segments(begin, end, *ends[:, rows]) - own - radius
                if away.min(initial=math.inf) < -NEAR:
                    yield f"flying object, link {number}: {away.min():.4f}"


def _solids(scene: Any) -> list[Solid]:
    """The obstacles and the bin of a throw, whose plane goes through its target."""
    target, lateral = scene.target, scene.arm.lateral
    turn = math.atan2(target.y, target.x) if target.y else 0.0
    turn -= math.asin(lateral / math.hypot(target.x, target.y)) if lateral else 0.0
    return solids_of(scene, Plane(turn, lateral))


def _rows(frame: Frame, rows: slice) -> Frame:
    parts = (frame.axes, frame.origin, frame.omega, frame.alpha, frame.v, frame.a)
    return Frame(*(part[rows] for part in parts))


def _load(scene: Any, thing: Carried, pads: Frame) -> Array:
    """Force and torque at the pads (K, 6), by Newton and Euler."""
    place, _, a = pads.point(thing.com)
    force = scene.object.mass * (a + np.array([0.0, 0.0, scene.gravity]))
    torque = pads.moment(thing.inertia) + np.cross(place - pads.origin, force)
    return np.hstack([force, torque])
