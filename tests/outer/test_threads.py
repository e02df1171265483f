"""Fails if threads or tasks with one planner plan otherwise than one thread does.

In a process of its own, as a fault there ends the process.
"""

from __future__ import annotations

import asyncio
import dataclasses
import os
import subprocess
import sys
import threading

import numpy as np
import pytest
import throwplan as tp

#: Targets about the scene's own: x, z [m], theta [rad].
OFFSETS = np.random.default_rng(5).uniform((-0.06, -0.04, -0.2), (0.06, 0.04, 0.2), (8, 3))


def targets(own: tp.Pose) -> list[tp.Pose]:
    """Eight targets about the scene's own."""
    return [
        dataclasses.replace(own, x=own.x + dx, z=own.z + dz, theta=own.theta and own.theta + turn)
        for dx, dz, turn in OFFSETS.tolist()
    ]


def landings(planner: tp.Planner, first: tp.Plan, target: tp.Pose) -> tuple[object, ...]:
    """What is promised of plans to a target: the status of one from nothing, and, for it has one
    throw to move, how the one from a plan nearby lands to the last digit."""
    plan, near = planner.plan(target), dataclasses.replace(first.target, x=first.target.x + 0.002)
    assert not plan.solved or not tp.Plan.verdict.func(dataclasses.replace(plan)).broken
    off, most = plan.error_sent(), plan.scene.tolerance
    assert not plan.solved or (off[0] <= most.position and off[1] <= most.angle), off
    moved = planner.plan(near, warm=first)
    again = dataclasses.replace(moved.throw.deciding).landing.pose
    return plan.status, moved.solver, moved.throw.deciding.landing.pose, again


def run(planner: tp.Planner, first: tp.Plan, places: list[tp.Pose], expected: list[object]) -> None:
    """Two threads, then eight tasks, with one planner: their plans are those of one thread."""
    found = dict[int, object]()

    def work(numbers: range) -> None:
        for i in numbers:
            found[i] = landings(planner, first, places[i])

    async def tasks() -> None:
        await asyncio.gather(*(asyncio.to_thread(work, range(i, i + 1)) for i in range(8)))

    workers = [threading.Thread(target=work, args=(range(i, 8, 2),)) for i in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert [found.pop(i) for i in range(8)] == expected
    asyncio.run(tasks())
    assert [found[i] for i in range(8)] == expected


@pytest.mark.slow
def test_threads_and_tasks_plan_as_one_does_each_time(tmp_path) -> None:
    """No time limit below that of a hang."""
    words = [sys.executable, "-X", "faulthandler", __file__]
    own = {"THROWPLAN_CACHE": str(tmp_path)}
    ended = subprocess.run(
        words, env=os.environ | own, capture_output=True, text=True, timeout=1800, check=False
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "done\n", "")


def main() -> None:
    """Two runs with a new planner each."""
    scene = tp.load_scene("pose").replace(cost=tp.Cost(quiet=0.0))
    planner = tp.Planner(scene, library=False)
    first = planner.plan()
    places = targets(first.target)
    expected = [landings(planner, first, target) for target in places]
    for _ in range(2):
        run(tp.Planner(scene, library=False), first, places, expected)
    print("done")


if __name__ == "__main__":
    main()
