"""How many reachable targets obstacles cost: the table of docs/performance.md.

.venv/bin/python examples/clutter_study.py [scenes] [results.csv]

Random targets that a bare `pose` throws to, each with two random obstacles about the way to it. A
planner that only checks looks for four throws that know nothing of the obstacles, and takes one
that is clear of them. Each scene is of its own seed; those in the file are not done again.
"""

import dataclasses
import math
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from throwplan import InputError, Plan, Planner, Pose, Scene, load_scene
from throwplan.planner.clearance import contacts
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


def scene_of(number: int, bare: Scene) -> Scene:
    """A target, and two obstacles about the way to it."""
    rng = np.random.default_rng(number)
    azimuth, away = rng.uniform(-1, 1), rng.uniform(0.5, 1.4)
    x, y = float(away * math.cos(azimuth)), float(away * math.sin(azimuth))
    target = Pose(x, 0.1, float(rng.uniform(-2, 2)), y=y)
    obstacle = tuple(clutter(rng, azimuth) for _ in range(2))
    return bare.replace(obstacle=obstacle).aimed_at(target)


def answer(bare: Planner, scene: Scene) -> tuple[str, float, Plan | None]:
    """What became of one target, the planner's time [s], and its plan."""
    target = scene.target
    plan = bare.plan(target)
    if not plan.solved or plan.throw is None:
        return "out of reach", 0.0, None
    begin = time.process_time()
    try:
        planned = Planner(scene).plan(target)
    except InputError:
        return "target held", 0.0, None
    seconds = time.process_time() - begin

    def clear(one: Plan) -> bool:
        return not contacts(dataclasses.replace(one.throw.deciding, scene=scene))

    checked = clear(plan)
    if not checked:
        checked = any(map(clear, bare.plan(target, alternatives=3, patience=2.0).alternatives))
    found = "planned" if planned.solved else "not planned"
    return f"{found}, {'found' if checked else 'not found'} by checks only", seconds, planned


def main(scenes: str = "500", results: str = "clutter.csv") -> None:
    """Does what the file does not have, then prints counts and times."""
    bare, path = Planner(load_scene("pose")), Path(results)
    rows = [line.split(";") for line in path.read_text().splitlines()] if path.exists() else []
    done = {int(number) for number, *_ in rows}
    for number in sorted(set(range(int(scenes))) - done):
        word, seconds, _ = answer(bare, scene_of(number, bare.scene))
        rows.append([str(number), word, f"{seconds:.2f}"])
        with path.open("a") as file:
            print(*rows[-1], sep=";", file=file)
    times = [float(seconds) for _, _, seconds in rows if float(seconds)]
    print(dict(Counter(word for _, word, _ in rows)))
    print(f"median {np.median(times):.2f} s of processor time")


if __name__ == "__main__":
    main(*sys.argv[1:])
