"""Time and error of smoothing and checking a plan, beside the slow and plain way.

    .venv/bin/python examples/check_speed.py [--runs N]

For each scene: `send`, the exact throw of what counts, the limit-surface landing and the
final check, warm, median of N runs. The plain way: Ruckig over every tick; the models' own
releases with 1000 and 2000 even steps. Errors of landings are against 32,000 steps (of the
limit surface: extrapolated), those of `send` are the largest difference of positions. All
times come from one run. The last lines are the first calls, which build the functions.
"""

import argparse
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import ruckig
import throwplan as tp
from throwplan.models import HandSamples, Release, ReleaseCase, SlidingPivotRelease, SteppedRelease
from throwplan.planner.check.check import broken_limits, limit_surface_throw, throw
from throwplan.planner.check.motion import TICK, PlannedMotion
from throwplan.planner.check.mover import Mover
from throwplan.planner.check.rollout import Landing, case_of, landing, slip_while_carrying
from throwplan.planner.check.smooth import SHARE, send
from throwplan.planner.check.violations import scene_violations
from throwplan.planner.result.plan import PlannedThrow

SCENES = ("pose", "cup", "box", "flip", "hand-box", "hand-flip")


class PlainTrack:
    """The hand of a motion, by CasADi's usual call."""

    def __init__(self, mover: Mover, motion: Any, opening_time: float) -> None:
        self._mover, self._motion, self._opening_time = mover, motion, opening_time

    def at(self, times: np.ndarray) -> HandSamples:
        """The hand at `times` [s] after the opening's start."""
        outputs = self._mover.motion(*self._motion.at(self._opening_time + times))
        return HandSamples(times, *(np.array(o) for o in outputs))


def follow(mover: Mover, planned: PlannedMotion) -> np.ndarray:
    """Positions (N, n) by Ruckig from tick to tick, all the way to detach."""
    n, hard = mover.size, mover.hard
    otg, trajectory, order = ruckig.Ruckig(n), ruckig.Trajectory(n), ruckig.InputParameter(n)
    order.max_velocity = (SHARE * hard.dq).tolist()
    order.max_acceleration = (SHARE * hard.ddq).tolist()
    order.max_jerk = (SHARE * hard.jerk).tolist()
    order.minimum_duration = TICK
    ticks = math.ceil(planned.times[-1] / TICK - 1e-9)
    q, dq, ddq = (v.T.tolist() for v in planned.at(TICK * np.arange(ticks + 1)))
    state = (q[0], [0.0] * n, [0.0] * n)
    positions = [q[0]]
    for i in range(1, len(q)):
        order.current_position, order.current_velocity, order.current_acceleration = state
        order.target_position, order.target_velocity = q[i], dq[i]
        order.target_acceleration = ddq[i]
        otg.calculate(order, trajectory)
        state = trajectory.at_time(TICK)
        positions.append(state[0])
    return np.array(positions)


def median_ms(run: Callable[[], Any], runs: int) -> float:
    """Median time [ms] of `runs` calls, after one more."""
    run()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times))


def first_ms(run: Callable[[], Any]) -> float:
    """Time [ms] of a single call."""
    start = time.perf_counter()
    run()
    return 1e3 * (time.perf_counter() - start)


def error(found: Landing, exact: np.ndarray) -> str:
    """Distance of a landing from the exact x, theta, as mm and deg."""
    angle = math.degrees(abs(found.theta - exact[1]))
    return f"{1e3 * abs(found.x - exact[0]):.5f} mm {angle:.5f} deg"


def releases(scene: tp.Scene, case: ReleaseCase, height: float) -> tuple[np.ndarray, np.ndarray]:
    """x, theta of the sliding pivot's and of the limit surface's converged landing."""

    def landed(release: Release) -> np.ndarray:
        found = landing(release, height, scene.gravity)
        return np.array([found.x, found.theta])

    pivot = landed(SlidingPivotRelease(steps=32_000).release(case))
    coarse, fine = (landed(SteppedRelease(steps=n).release(case)) for n in (16_000, 32_000))
    return pivot, 2 * fine - coarse


def report(name: str, plan: tp.Plan, found: PlannedThrow, runs: int) -> None:
    """One scene's lines."""
    scene, mover, at = plan.scene, plan.mover, found.opening_time
    height, motion = plan.target.z, found.planned if found.sent is None else found.samples
    case = case_of(scene, PlainTrack(mover, motion, at))
    pivot, surface = releases(scene, case, height)
    ticks = len(found.samples.q)
    print(f"{name}: {ticks} ticks, opening at {at:.3f} s")

    mine = median_ms(lambda: send(mover, found.planned), runs)
    if mover.hard.jerk is None:
        print(f"  send                {mine:6.2f} ms")
    else:
        plain = median_ms(lambda: follow(mover, found.planned), max(runs // 10, 3))
        positions = follow(mover, found.planned)
        off = np.abs(send(mover, found.planned).q[: len(positions)] - positions).max()
        print(f"  send                {mine:6.2f} ms, {plain / mine:5.1f} x, off {off:.1e} rad")

    def plain_throw() -> Landing:
        slip_while_carrying(scene, mover, motion, at)
        return landing(SlidingPivotRelease(steps=1000).release(case), height, scene.gravity)

    def plain_surface() -> Landing:
        return landing(SteppedRelease(steps=2000).release(case), height, scene.gravity)

    mine = median_ms(lambda: throw(scene, mover, motion, at, height), runs)
    plain = median_ms(plain_throw, max(runs // 5, 3))
    thrown = throw(scene, mover, motion, at, height)
    print(
        f"  exact throw         {mine:6.2f} ms, {plain / mine:5.1f} x, "
        f"off {error(thrown.landing, pivot)} (plain {error(plain_throw(), pivot)})"
    )
    mine = median_ms(lambda: limit_surface_throw(scene, mover, motion, at, height).landing, runs)
    plain = median_ms(plain_surface, max(runs // 5, 3))
    landed = limit_surface_throw(scene, mover, motion, at, height).landing
    print(
        f"  limit surface       {mine:6.2f} ms, {plain / mine:5.1f} x, "
        f"off {error(landed, surface)} (plain {error(plain_surface(), surface)})"
    )
    end = motion.times[-1]

    def check() -> list[object]:
        broken = broken_limits(mover.hard, mover.joints, found.samples)
        return [*broken, *scene_violations(scene, mover, motion, end, at, thrown)]

    print(f"  limits, cup, room   {median_ms(check, runs):6.2f} ms")


def report_first_calls(plan: tp.Plan) -> None:
    """What the first calls of a process cost: planning has made some of it already."""
    from throwplan.planner.check import exact_release, violations

    print("first calls, with what they build:")
    for kernel in (exact_release.pivot_kernel, exact_release._surface_kernel):
        kernel.cache_clear()
        print(f"  {kernel.__name__:<18} {first_ms(kernel):6.1f} ms")
    violations.outline_kernel.cache_clear()
    mover = plan.mover
    build = first_ms(lambda: violations.outline_kernel(mover.motion, mover.kinematics))
    print(f"  {'outline_kernel':<18} {build:6.1f} ms")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    arguments = parser.parse_args()
    plans = {}
    for name in SCENES:
        plans[name] = plan = tp.plan(name)
        assert plan.throw is not None
        report(name, plan, plan.throw, arguments.runs)
    report_first_calls(plans["cup"])


if __name__ == "__main__":
    main()
