"""Random job lists, and a judge of cycles by code of its own: plain NumPy and the oracle.

`PYTHONPATH=. .venv/bin/python tests/job_lists.py 20` plans and judges that many.
"""

from __future__ import annotations

import itertools
import json
import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from throwplan.planner.cycle import plan_cycle, save_cycle
from throwplan.problems import load_jobs, scene_from_table

from oracle import Oracle, shapes
from oracle.files import columns_of
from oracle.motion import Frame, Samples, frames_of, quintics

TICK = 1e-3
#: Landing error (position [m], angle [rad]) by the oracle, whose own error is about 0.1 mm.
LANDS = 2.2e-3, math.radians(0.55)

#: A part and a bin.
ONE = """
scene = "pose"
[[bin]]
name = "bin"
target = { x = 1.0, y = 0.3, z = 0.2, theta_deg = -90.0 }
[[pick]]
name = "part"
x = 0.45
y = 0.1
z = 0.35
"""
#: Two parts and a bin of an FR3, whose hand has the time to close.
TWO = f"""{ONE.replace("pose", "fr3")}
grasp_time = 0.5
[[pick]]
name = "other part"
x = 0.45
y = -0.1
z = 0.35
grasp_time = 0.5
"""


def random_jobs(seed: int, picks: int = 8, bins: int = 3) -> str:
    """The text of a job file: picks in front of a Panda, bins beyond its reach."""
    random = np.random.default_rng(seed)
    lines = ['scene = "pose"']
    for number in range(bins):
        away, azimuth = random.uniform(0.95, 1.2), math.radians(random.uniform(-65, 65))
        x, y = away * math.cos(azimuth), away * math.sin(azimuth)
        z, theta = random.uniform(0.1, 0.25), random.uniform(-100.0, -60.0)
        turn = f"[{theta - 8:.1f}, {theta + 8:.1f}]" if number % 2 else f"{theta:.1f}"
        lines += ["[[bin]]", f'name = "bin {number + 1}"']
        lines += [f"target = {{ x = {x:.3f}, y = {y:.3f}, z = {z:.3f}, theta_deg = {turn} }}"]
    for number in range(picks):
        away, azimuth = random.uniform(0.38, 0.6), math.radians(random.uniform(-50, 50))
        x, y, z = away * math.cos(azimuth), away * math.sin(azimuth), random.uniform(0.33, 0.42)
        lines += ["[[pick]]", f'name = "part {number + 1}"', f"x = {x:.3f}", f"y = {y:.3f}"]
        lines += [f"z = {z:.3f}", f"grasp_time = {random.uniform(0.2, 0.4):.2f}"]
        if random.random() < 0.3:
            lines += [f'bins = ["bin {random.integers(bins) + 1}"]']
    return "\n".join(lines) + "\n"


def broken_limits(folder: Path) -> list[str]:
    """What a saved cycle breaks, by code that shares nothing with the planner."""
    cycle = json.loads((folder / "cycle.json").read_text())
    columns = columns_of(folder / "motion.csv")
    steps = cycle["steps"]
    scenes = [scene_from_table({**step["definition"], "arm": cycle["arm"]}) for step in steps]
    arm = scenes[0].arm
    joints = range(1, arm.joints + 1)
    q, dq, ddq = (
        np.column_stack([columns[f"{kind}{j}"] for j in joints]) for kind in ("q", "dq", "ddq")
    )
    found = _joint_limits(arm, q, dq, ddq)
    frames = frames_of(arm, q, dq, ddq)
    ends = [0, *(step["samples"][3] for step in steps)]
    for k, (step, scene) in enumerate(zip(steps, scenes, strict=True)):
        held = slice(step["samples"][1], math.floor(step["opening_time"] / TICK) + 1)
        empty = np.arange(len(q))
        empty = (empty >= ends[k]) & (empty < held.start)
        if k == len(steps) - 1:
            empty |= np.arange(len(q)) > step["detach_time"] / TICK
        found += [f"{step['pick']}: {words}" for words in _held(scene, frames, held)]
        found += _arm(scene, frames, empty, np.zeros((len(q), 6)))
        found += [f"{step['pick']}: {w}" for w in _thrown(scene, step, q, dq, ddq, columns["t"])]
    found += _itself(scenes[0], frames)
    gripper = columns["gripper"]
    for step in steps:
        opens = math.ceil(step["command_time"] / TICK - 1e-6)
        if not (gripper[step["samples"][0] : opens].all() and gripper[opens] == 0.0):
            found.append(f"{step['pick']}: the gripper's commands")
    return found


def _joint_limits(arm: Any, q: Any, dq: Any, ddq: Any) -> list[str]:
    of, found = arm.limits, []
    rate, turn, jerk = (np.diff(v, axis=0) / TICK for v in (q, dq, ddq))
    if (q < np.array(of.position_min)).any() or (q > np.array(of.position_max)).any():
        found.append("joint position")
    for name, values, limit in (
        ("velocity", np.vstack([dq, rate]), of.velocity),
        ("acceleration", np.vstack([ddq, turn]), of.acceleration),
        ("jerk", jerk, of.jerk),
    ):
        if (np.abs(values) > np.array(limit) * (1 + 1e-9)).any():
            found.append(f"joint {name}")
    if np.abs([dq[0], dq[-1], ddq[0], ddq[-1]]).max() > 1e-9:
        found.append("not from rest to rest")
    # The samples are one motion: quintics between them do not exceed the velocity either.
    t = TICK * np.arange(len(q))
    between = quintics(t, q, dq, ddq).derivative()(t[:-1] + TICK / 2)
    if (np.abs(between) > np.array(of.velocity) * (1 + 1e-6)).any():
        found.append("joint velocity between samples")
    return found


def _held(scene: Any, frames: list[Frame], held: slice) -> list[str]:
    """Limits while the hand holds the object."""
    pads, bar, arm = frames[-1], scene.object, scene.arm
    # The bar's direction in the pads' frame: at the grasp angle in the plane across the pads.
    at_rest = frames_of(arm, *np.zeros((3, 1, arm.joints)))[-1].axes[0]
    side = -np.sign(at_rest[1, 1])
    along = np.array([0.0, 0.0, math.cos(scene.grasp.angle)])
    along += math.sin(scene.grasp.angle) * np.cross([0.0, side, 0.0], [0.0, 0.0, 1.0])
    com = (bar.com - scene.grasp.offset) * along
    place, _, a = pads.point(com)
    force = bar.mass * (a + np.array([0.0, 0.0, scene.gravity]))
    own = bar.mass * bar.width**2 / 6
    tensor = bar.inertia * np.eye(3) + (own - bar.inertia) * np.outer(along, along)
    inertia = pads.axes @ tensor @ pads.axes.transpose(0, 2, 1)
    spin = (inertia @ pads.omega[..., None])[..., 0]
    torque = (inertia @ pads.alpha[..., None])[..., 0] + np.cross(pads.omega, spin)
    torque += np.cross(place - pads.origin, force)
    rows = np.zeros(len(force), bool)
    rows[held] = True
    found = _arm(scene, frames, rows, np.hstack([force, torque]))
    # Friction in the pads' plane, and about their normal.
    normal = pads.axes[:, :, 1]
    aside = (force * normal).sum(axis=1)[:, None] * normal
    limit = scene.contact.faces * scene.contact.friction * scene.gripper.force
    lever = scene.contact.torsion * scene.contact.patch_radius
    use = np.hypot(np.linalg.norm(force - aside, axis=1), (torque * normal).sum(axis=1) / lever)
    if (use[held] / limit).max() > 1.0:
        found.append(f"grip {(use[held] / limit).max():.4f}")
    floor = scene.workspace.floor
    for end in (-scene.grasp.offset, bar.length - scene.grasp.offset):
        if (pads.point(end * along)[0][held, 2]).min() < floor:
            found.append("held bar, floor")
    tip = pads.point((bar.length - scene.grasp.offset) * along)[0][held]
    radius, height = scene.workspace.column_radius, scene.workspace.column_height
    if ((np.hypot(tip[:, 0], tip[:, 1]) < radius) & (tip[:, 2] < height)).any():
        found.append("held bar, base column")
    return found


def _arm(scene: Any, frames: list[Frame], rows: Any, load: Any) -> list[str]:
    """Tool speed and torques; load (N, 6): force and torque at the pads."""
    arm, found = scene.arm, []
    *_, hand, pads = frames
    speed = np.maximum(np.linalg.norm(hand.v, axis=1), np.linalg.norm(pads.v, axis=1))[rows]
    if speed.max(initial=0.0) > scene.tool_speed * (1 + 1e-9):
        found.append(f"tool speed {speed.max():.4f}")
    for j in range(arm.joints):
        joint = frames[j + 1]
        axis, total = joint.axes[:, :, 2], np.zeros(len(load))
        for frame, link in zip(frames[j + 1 : -1], arm.links[j:], strict=True):
            place, _, a = frame.point(link.com)
            xx, xy, xz, yy, yz, zz = link.inertia
            inertia = frame.axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            inertia = inertia @ frame.axes.transpose(0, 2, 1)
            spin = (inertia @ frame.omega[..., None])[..., 0]
            moment = (inertia @ frame.alpha[..., None])[..., 0] + np.cross(frame.omega, spin)
            push = link.mass * (a + np.array([0.0, 0.0, scene.gravity]))
            moment += np.cross(place - joint.origin, push)
            total += (axis * moment).sum(axis=1)
        moment = load[:, 3:] + np.cross(pads.origin - joint.origin, load[:, :3])
        total += (axis * moment).sum(axis=1)
        use = np.abs(total[rows]).max(initial=0.0) / arm.limits.torque[j]
        if use > 1 + 1e-9:
            found.append(f"torque of joint {j + 1} {use:.4f}")
    return found


def _itself(scene: Any, frames: list[Frame]) -> list[str]:
    """Distances of the links from each other, the floor and obstacles, every 5 ms."""
    arm, found = scene.arm, []
    ends = [[frames[c.link].point(e)[0][::5] for e in (c.begin, c.end)] for c in arm.capsules]
    for (i, one), (j, other) in itertools.combinations(enumerate(arm.capsules), 2):
        if abs(one.link - other.link) > 2 and {one.link, other.link} != {0, 1}:
            away = shapes.between_segments(*ends[i], *ends[j]).min() - one.radius - other.radius
            if away < -1e-6:
                found.append(f"links {one.link} and {other.link}: {away:.4f}")
    lowest = min(
        min(e[:, 2].min() for e in pair) - c.radius - arm.cover
        for c, pair in zip(arm.capsules, ends, strict=True)
        if c.link > 1
    )
    if lowest < scene.workspace.floor - 1e-6:
        found.append(f"arm, floor: {lowest:.4f}")
    return found


def _thrown(scene: Any, step: Any, q: Any, dq: Any, ddq: Any, t: Any) -> list[str]:
    """Whether the object lands on its target, thrown by the oracle from `join` to detach."""
    first, last = step["samples"][2], step["samples"][3]
    rows = slice(first, last + 1)
    opening = step["opening_time"] - TICK * first
    oracle = Oracle(scene, Samples(t[rows] - t[first], q[rows], dq[rows], ddq[rows]), opening)
    judged = oracle.judge(planned=True)
    names = ("in the plane", "grip", "release", "palm")
    found = [name for name in names if name in judged.found and judged.found[name].broken[0]]
    x, theta, _ = judged.landing[0]
    dx, dtheta = scene.target.miss(x, theta)
    if abs(dx) > LANDS[0] or abs(dtheta) > LANDS[1]:
        found.append(f"lands {1e3 * dx:.2f} mm, {math.degrees(dtheta):.2f} deg off")
    lands = TICK * first + judged.lands[0]
    if abs(lands - step["landing_time"]) > 1e-3:
        found.append(f"lands at {lands:.4f} s")
    return found


def study(count: int) -> None:
    """Plan and judge random lists of 8 objects, and print a table with its medians."""
    rows = []
    for seed in range(count):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "jobs.toml").write_text(random_jobs(seed))
            begin = time.process_time()
            cycle = plan_cycle(load_jobs(folder / "jobs.toml"))
            spent = time.process_time() - begin
            if not cycle.solved:
                print(seed, cycle.message)
                continue
            save_cycle(cycle, folder)
            rows.append((cycle.duration / 8, cycle.duration / cycle.stops, spent / 8))
            print(seed, *(f"{value:.3f}" for value in rows[-1]), broken_limits(folder))
    print("median", np.median(rows, axis=0), "90 %", np.quantile(rows, 0.9, axis=0))


if __name__ == "__main__":
    study(int(sys.argv[1]))
