"""How many targets are thrown to, how fast and how well; and what is out of reach.

    python examples/reach.py [--scenes pose,cup,...] [--targets N] [--outside N]
                             [--compile no|wait] [--rivals N] [--seed N]

Targets in reach come from random exact throws (`planner.reach_study`), not from the
planner's table; targets out of reach are more than 10 cm or 20 deg from every landing of
200,000 sampled releases. Rivals: other ways to solve the same NLP, on the same targets.
"""

from __future__ import annotations

import argparse
import collections
import itertools
import math
import time

import numpy as np
import throwplan as tp
from throwplan.planner.correction import Search
from throwplan.planner.guess import guess_from
from throwplan.planner.mover import make_mover
from throwplan.planner.numbers import bounds, parameter_values
from throwplan.planner.reach_study import Outcome, outcomes, reachable_targets
from throwplan.planner.releases import ReleaseSampler

SCENES = "pose,cup,box,flip,hand-box,hand-flip"
#: Sampled releases that say what is in reach, in draws of this many states.
DRAWS, DRAW = 10, 20_000
#: Targets out of reach are looked for this far beyond the landings: x [m], theta [rad].
ROUND = np.array([1.0, 2.0])


def percentiles(values: list[float]) -> str:
    """Median and 99th percentile."""
    return "{:7.1f} {:7.1f}".format(*np.percentile(values, [50, 99]))


def table(name: str, results: list[Outcome]) -> None:
    """One line of figures."""
    states = collections.Counter(result.plan.status for result in results)
    solved = [result for result in results if result.plan.solved]
    errors = np.array([result.error for result in solved]).reshape(-1, 2)
    worst = errors.max(axis=0) if len(errors) else np.array([math.nan, math.nan])
    print(
        f"  {name:10} {len(solved):5d} of {len(results):5d}  "
        f"plan {percentiles([1e3 * r.seconds for r in results])} ms, "
        f"solve {percentiles([1e3 * r.plan.time['solve'] for r in results])} ms, "
        f"worst error {1e3 * worst[0]:.3f} mm {math.degrees(worst[1]):.3f} deg, "
        f"{dict(states)}",
        flush=True,
    )
    for result in results:
        if not result.plan.solved:
            pose = result.target
            print(f"      x {pose.plane_x:.4f} theta {pose.theta}: {result.plan.message}")


def outside(scene: tp.Scene, count: int, seed: int) -> list[tp.Pose]:
    """Targets more than 10 cm or 20 deg from every sampled landing."""
    sampler = ReleaseSampler(scene, make_mover(scene))
    assert scene.target is not None
    landings = []
    for draw in range(DRAWS):
        x, theta, _ = sampler.draw(DRAW, seed=1000 + draw).landings(scene.target.z, scene.gravity)
        landings.append(np.column_stack([x, theta])[np.isfinite(x)])
    known = np.vstack(landings)
    rng = np.random.default_rng(seed)
    low, high = known.min(axis=0), known.max(axis=0)
    found: list[tp.Pose] = []
    while len(found) < count:
        x, theta = rng.uniform(low - ROUND, high + ROUND)
        near = np.abs(known[:, 0] - x) < 0.1
        if scene.target.theta is not None:
            near &= np.abs(known[:, 1] - theta) < math.radians(20)
        if not near.any():
            found.append(scene.target.in_plane(x, None if scene.target.theta is None else theta))
    return found


def report_outside(name: str, planner: tp.Planner, targets: list[tp.Pose]) -> None:
    """What the planner says of targets out of reach."""
    results = list(outcomes(planner, targets))
    states = collections.Counter(result.plan.status for result in results)
    times = percentiles([1e3 * result.seconds for result in results])
    print(f"  {name:10} out of reach: {dict(states)}, {times} ms", flush=True)
    for result in results:
        if result.plan.status == "not_converged":
            pose = result.target
            print(f"      x {pose.plane_x:.4f} theta {pose.theta}: {result.plan.message}")


def rivals(scene: tp.Scene, targets: list[tp.Pose]) -> None:
    """First solves of the same NLP by other means, without corrections."""
    from single_shooting import SingleShooting

    planner = tp.Planner(scene, compiling="no")
    bench, mover = planner.bench, planner.mover
    search = Search(scene)
    releases = planner.releases()
    still = int(np.argmin(np.abs(releases.dq).sum(axis=1)))
    shooting = SingleShooting(scene)
    ways = ("IPOPT, crude", "IPOPT, table", "FATROP, table", "SLSQP, table")
    found: dict[str, list[tuple[bool, float]]] = {way: [] for way in ways}
    for target in targets:
        aimed = scene.aimed_at(target)
        first = planner.starts(target)[0][0]
        _, _, flights = releases.landings(target.z, scene.gravity)
        for way in ways:
            solver, start = way.split(", ")
            index = first if start == "table" else still
            flight = float(flights[index]) if math.isfinite(flights[index]) else 0.3
            if solver == "SLSQP":
                found[way].append(shooting.solve(aimed, target, releases, index, flight))
                continue
            problem = bench.problem(target, solver.lower(), search)
            guess = guess_from(problem.nlp, aimed, mover, releases, index, flight)
            numbers = problem.nlp.parameters.vector(parameter_values(aimed, mover, target))
            begin = time.perf_counter()
            result = problem.solver.solve(guess, numbers, bounds(problem.nlp, aimed, mover))
            found[way].append((result.success, time.perf_counter() - begin))
    for way, answers in found.items():
        good = sum(success for success, _ in answers)
        times = percentiles([1e3 * seconds for _, seconds in answers])
        print(f"  {scene.name:10} {way:14} {good:3d} of {len(answers)}, {times} ms", flush=True)


def main() -> None:
    """Runs what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--targets", type=int, default=100)
    parser.add_argument("--outside", type=int, default=0)
    parser.add_argument("--rivals", type=int, default=0)
    parser.add_argument("--compile", choices=("no", "wait"), default="wait")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    words = f"seed {options.seed}, compiled: {options.compile}"
    print(f"{options.targets} targets in reach a scene, {words}; median and 99 %")
    for name in options.scenes.split(","):
        scene = tp.load_scene(name)
        found = itertools.islice(reachable_targets(scene, options.seed), options.targets)
        targets = list(found)
        planner = tp.Planner(scene, compiling=options.compile)
        # Building and compiling once is not the plan's own time.
        for target in targets[:1]:
            planner.plan(target)
        table(name, list(outcomes(planner, targets)))
        if options.outside:
            far = outside(scene, options.outside, options.seed)
            report_outside(name, planner, far)
        if options.rivals:
            rivals(scene, targets[: options.rivals])


if __name__ == "__main__":
    main()
