"""How many reachable targets obstacles cost: the table of docs/performance.md.

.venv/bin/python examples/clutter_study.py [scenes] [seed]

Random targets that a bare `pose` throws to, each with two random obstacles about the way to it. A
planner that only checks looks for four throws that know nothing of the obstacles, and takes one
that is clear of them.
"""

import dataclasses
import math
import sys
import time
from collections import Counter

import numpy as np
from throwplan import InputError, Planner, Pose, Scene, load_scene
from throwplan.planner.check import contacts
from throwplan.problems import Obstacle


def clutter(rng: np.random.Generator, azimuth: float) -> Obstacle:
    """A box, sphere or upright or lying capsule between the base and 1.2 m."""
    kind = str(rng.choice(["box", "sphere", "capsule"]))
    size = {
        "box": rng.uniform(0.1, 0.4, 3),
        "sphere": rng.uniform(0.05, 0.2, 1),
        "capsule": rng.uniform([0.03, 0.2], [0.08, 0.8]),
    }[kind]
    away, angle = rng.uniform(0.45, 1.2), azimuth + rng.uniform(-0.5, 0.5)
    place = (away * math.cos(angle), away * math.sin(angle), rng.uniform(0.0, 0.9))
    turned = float(rng.uniform(-3, 3)), float(rng.choice([0.0, math.pi / 2]))
    return Obstacle("clutter", kind, tuple(map(float, size)), tuple(map(float, place)), *turned)


def answer(bare: Planner, scene: Scene, target: Pose) -> tuple[str, float]:
    """What became of one target, and the planner's time [s]."""
    plan = bare.plan(target)
    if not plan.solved or plan.throw is None:
        return "out of reach", 0.0
    begin = time.process_time()
    try:
        planned = Planner(scene).plan(target)
    except InputError:
        return "target held", 0.0
    seconds = time.process_time() - begin

    def clear(one: object) -> bool:
        return not contacts(dataclasses.replace(one.throw.final, scene=scene.aimed_at(target)))

    checked = clear(plan)
    if not checked:
        checked = any(map(clear, bare.plan(target, alternatives=3, patience=4.0).alternatives))
    found = "planned" if planned.solved else "not planned"
    return f"{found}, {'found' if checked else 'not found'} by checks only", seconds


def main(scenes: int = 500, seed: int = 0) -> None:
    """Prints counts and times."""
    rng, bare = np.random.default_rng(seed), Planner(load_scene("pose"))
    counts, times = Counter(), []
    while sum(counts.values()) - counts["out of reach"] - counts["target held"] < scenes:
        azimuth, away = rng.uniform(-1, 1), rng.uniform(0.5, 1.4)
        x, y = float(away * math.cos(azimuth)), float(away * math.sin(azimuth))
        target = Pose(x, 0.1, float(rng.uniform(-2, 2)), y=y)
        obstacle = tuple(clutter(rng, azimuth) for _ in range(2))
        word, seconds = answer(bare, bare.scene.replace(obstacle=obstacle), target)
        counts[word] += 1
        times.append(seconds)
        print(word, f"{seconds:.2f} s", flush=True)
    print(dict(counts), f"median {np.median([t for t in times if t]):.2f} s of processor time")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
