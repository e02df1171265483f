"""The same throw in other units of mass and of length."""

from __future__ import annotations

import collections
import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...problems import Scene, load_scene
from ..check import PlannedMotion, limit_surface_throw, make_mover, throw
from ..plan import Planner
from ..result import Plan
from .page import Effort, Table


def in_other_units(scene: Scene, mass: float, length: float = 1.0) -> Scene:
    """The same throw where a mass reads `mass` times as much and a length `length` times.

    Times stay. Lengths only of a free hand's scene: an arm has its own.
    """
    force = scene.gripper.force
    assert force is not None
    thing, contact, tolerance = scene.object, scene.contact, scene.tolerance
    changed = scene.replace(
        object=dataclasses.replace(
            thing,
            mass=mass * thing.mass,
            inertia=mass * length**2 * thing.inertia,
            length=length * thing.length,
            com=length * thing.com,
            width=length * thing.width,
        ),
        grasp=dataclasses.replace(scene.grasp, offset=length * scene.grasp.offset),
        contact=dataclasses.replace(contact, patch_radius=length * contact.patch_radius),
        gripper=dataclasses.replace(scene.gripper, force=mass * length * force),
        tolerance=dataclasses.replace(tolerance, position=length * tolerance.position),
        gravity=length * scene.gravity,
    )
    hand, target = scene.hand, scene.target
    if length == 1.0 or hand is None or target is None:
        return changed
    start = None if hand.start is None else (length * hand.start[0], length * hand.start[1])
    return changed.replace(
        target=dataclasses.replace(target, x=length * target.x, z=length * target.z),
        hand=dataclasses.replace(
            hand,
            x=(length * hand.x[0], length * hand.x[1]),
            z=(length * hand.z[0], length * hand.z[1]),
            speed=length * hand.speed,
            acceleration=length * hand.acceleration,
            start=start,
        ),
    )


def unit_rows(name: str, effort: Effort) -> list[list[Any]]:
    """A scene in other units of mass, a free hand's also in other units of length."""
    scene = load_scene(name)
    plan = Planner(scene, compiling="no").plan()
    rows = []
    lengths = () if scene.hand is None else ((1.0, 0.1), (1.0, 10.0))
    for mass, length in ((1e-3, 1.0), (1e3, 1.0), *lengths):
        changed = in_other_units(scene, mass, length)
        moved = [
            abs(new.landing.x / length - old.landing.x)
            for new, old in _both_models(plan, changed, length)
        ]
        other = Planner(changed, compiling="no").plan()
        landed = math.nan
        if plan.throw is not None and other.throw is not None:
            landed = abs(other.throw.final.landing.x / length - plan.throw.final.landing.x)
        iterations = f"{plan.iterations} → {other.iterations}"
        rows.append([name, mass, length, *moved, other.status, landed, iterations])
    return rows


def _both_models(plan: Plan, changed: Scene, length: float) -> Iterator[tuple[Any, Any]]:
    """The plan's motion thrown by both models in the new units and in the old."""
    thrown = plan.throw
    assert thrown is not None and changed.target is not None
    motion = thrown.planned if thrown.sent is None else thrown.samples
    mover, scaled = make_mover(changed), motion
    if length != 1.0 and isinstance(motion, PlannedMotion):
        by = np.where(np.arange(mover.size) < 2, length, 1.0)
        q, dq, ddq, jerk = (by * v for v in (motion.q, motion.dq, motion.ddq, motion.jerk))
        scaled = PlannedMotion(motion.times, q, dq, ddq, jerk)
    for model in (throw, limit_surface_throw):
        new = model(changed, mover, scaled, thrown.opening_time, changed.target.z)
        old = model(plan.scene, plan.mover, motion, thrown.opening_time, plan.target.z)
        yield new, old


def unit_parts(rows: list[list[Any]]) -> list[Any]:
    """What other units move."""
    same = max(max(row[3], row[4]) for row in rows)
    mass = [row[6] for row in rows if row[2] == 1.0]
    length = [row[6] for row in rows if row[2] != 1.0]
    states = collections.Counter(row[5] for row in rows)
    words = (
        "The same throws in other units: numbers for mass (mass, inertia, grip force) and length "
        "(all geometry, gravity, speeds, accelerations; free hands only) multiplied. A given "
        f"motion's landing by the two exact models moves by {same:.1e} m at most. Planned anew "
        f"({', '.join(f'{n} {s}' for s, n in states.items())}), the landing moves by "
        f"{np.nanmax(mass):.1e} m at most with mass"
    )
    if length:
        words += (
            f", and by {np.nanmax(length):.1e} m with length: the planner's weights and "
            "correction are in metres, so it takes another throw inside the same tolerance"
        )
    columns = ["scene", "mass ×", "length ×", "sliding pivot moves [m]", "limit surface moves [m]"]
    columns += ["planned anew", "landing moves [m]", "iterations"]
    return [words + ".", Table("stability_units", "Other units, same throw", columns, rows)]
