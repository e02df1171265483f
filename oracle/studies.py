"""Verdicts on many random cases, compared with the oracle and with published meshes."""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import throwplan as tp
from scipy.spatial import ConvexHull, cKDTree
from throwplan.problems import Obstacle

from .files import oracle_of, read_oracle, read_rows
from .meshes import Array, link_points
from .motion import TICK
from .scenes import random_scenes

#: A built-in scene for each arm.
SCENES = {
    "panda": "pose",
    "fr3": "fr3",
    "iiwa14": "iiwa14",
    "xarm7": "xarm7",
    "ur5e": "ur5e",
    "gen3": "gen3",
}
#: Smallest and largest size [m] of obstacles.
SIZES = 0.004, 0.020


def sweep_counts(count: int, samples: int) -> Iterator[dict[str, Any]]:
    """Successes of sweeps of solved random scenes, by the sweep and by the oracle, and the rows in
    which they differ although the oracle is sure."""
    for name, scene in islice(random_scenes(), count):
        plan = tp.plan(scene)
        if not plan.solved:
            continue
        with tempfile.TemporaryDirectory() as folder:
            plan.save(Path(folder) / "plan")
            tp.sweep(plan, samples=samples).save(Path(folder) / "plan" / "sweep")
            rows, found = read_rows(Path(folder) / "plan")
            judged = read_oracle(Path(folder) / "plan").judge(rows)
        success = found["success"] > 0
        yield {
            "scene": name,
            "sweep": float(success.mean()),
            "oracle": float(judged.success.mean()),
            "differ": int(((success != judged.success) & judged.sure).sum()),
        }


def corner_contacts(arm: str, count: int) -> Iterator[tuple[str, float]]:
    """Plans beside small obstacles at corners of moving links and hand: status, and the largest
    penetration [m] of a published mesh at any tick, 0 without one."""
    scene, points = tp.load_scene(SCENES[arm]), link_points(arm)
    oracle, rng = oracle_of(tp.plan(scene)), np.random.default_rng(zlib.crc32(arm.encode()))
    links = [link for link in points if link > oracle.motion.throwing[0] + 1]
    corners = {link: points[link][ConvexHull(points[link]).vertices] for link in links}
    for number in range(count):
        link = links[number % len(links)]
        corner = corners[link][rng.integers(len(corners[link]))]
        frame = oracle.motion.frames(np.array([rng.uniform(0.0, oracle.hand.end)]))[link]
        kind, size = ("sphere", "box")[number % 2], float(rng.uniform(*SIZES))
        extent = (size / 2,) if kind == "sphere" else (size,) * 3
        place = tuple(map(float, frame.point(corner)[0][0]))
        obstacle = Obstacle("peg", kind, extent, place, clearance=0.0)
        try:
            plan = tp.Planner(scene.replace(obstacle=(obstacle,))).plan(patience=20.0)
        except tp.InputError:
            yield "refused", 0.0
            continue
        yield plan.status, _depth(oracle_of(plan), points, obstacle) if plan.solved else 0.0


def _depth(oracle: Any, points: dict[int, Array], obstacle: Obstacle) -> float:
    """Penetration [m] of moving links' meshes into an obstacle (an upright box or a sphere)."""
    frames = oracle.motion.frames(np.arange(0.0, oracle.hand.end, TICK))
    centre, deepest = np.array(obstacle.position), 0.0
    box = obstacle.kind == "box"
    half = obstacle.size[0] / 2 if box else obstacle.size[0]
    far = half * np.sqrt(3.0) if box else half
    for link, cloud in points.items():
        if link <= oracle.motion.throwing[0]:
            continue
        frame, tree = frames[link], cKDTree(cloud)
        local = np.einsum("kji,kj->ki", frame.axes, centre - frame.origin)
        for k in np.flatnonzero(tree.query(local)[0] < far):
            near = cloud[tree.query_ball_point(local[k], far)]
            off = (near - local[k]) @ frame.axes[k].T
            away = np.abs(off).max(axis=1) if box else np.linalg.norm(off, axis=1)
            deepest = max(deepest, half - float(away.min()))
    return deepest
