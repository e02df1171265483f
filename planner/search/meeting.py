"""Targets that move, and times of arrival: where the object is thrown to, and how long it waits.

A throw to where the target will be is a throw to a target at rest. When it lands depends on where
that is, so place and time are found in turn; near a throw its time changes little with the place.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np

from ...models import Path
from ...problems import Pose, Scene
from ..check import TICK, Samples, Throw
from ..result import Plan, PlannedThrow
from .attempt import violations
from .release_table import Releases, distances

#: Times [s] at which a target that moves may be met, and how near [m] a sampled throw must land
#: where it is then; of these some are tried, more than `SPREAD` [s] apart.
TIMES, REACHED, TRIED, SPREAD = np.arange(0.3, 8.0, 0.1), 0.05, 4, 0.15
#: No sampled throw lands so near [m]: it is not tried to meet the target there.
FAR = 0.12
#: Sampled throws that land after this share of a time leave time enough; throws that are planned
#: may land so many times sooner.
ENOUGH, SOONER = 0.9, 2.0
#: Throws take no longer than this [s] unless they must: for later times the arm waits.
LONG = 1.0
#: Throws at most, each aimed at where the target is when the one before lands.
MEETINGS = 12
#: Times [samples] that differ by less are the same.
SAME = 1e-3
#: The longest change [s] of the time at which it is tried to meet it.
STEP = 0.5
#: How far [m] the target may be from where the throw was aimed when it lands.
NEAR = 2e-5


def met(
    scene: Scene,
    target: Pose,
    releases: Callable[[], Releases],
    thrown: Callable[[Pose, Plan | None], Plan],
) -> Plan:
    """The plan whose object lands where the target then is, in its time.

    thrown(pose, warm): the plan for a target at rest; releases: sampled throws. Where the object
    would land too early the arm waits at rest, in whole samples. Where the target is out of reach
    when a throw by itself would land, other times are tried: first those that sampled throws leave
    most time for.
    """
    if target.at_rest:
        return thrown(target, None)
    if not target.speed:
        return _met_from(target, thrown, target.window[0])
    near = functools.partial(_sampled, scene, target, releases)
    plan = _met_from(target, thrown, target.window[0], lambda time: near(time)[0] > FAR)
    if plan.solved:
        return plan
    earliest, latest = target.window
    known = [(near(time), time) for time in TIMES[(earliest <= TIMES) & (latest >= TIMES)].tolist()]
    ways = {time: soonest / time for (away, soonest), time in known if away <= FAR}
    tried = list[float]()
    # The first at which there is time enough, then those at which there is most.
    for time in sorted(ways, key=lambda time: max(ways[time], ENOUGH)):
        if len(tried) == TRIED or any(abs(time - other) < SPREAD for other in tried):
            continue
        tried.append(time)
        found = _met_from(target.changed(arrival=time) if time < LONG else target, thrown, time)
        if found.solved:
            return dataclasses.replace(found, target=found.target.changed(arrival=target.arrival))
    if near(0.0)[0] <= REACHED and min(ways.values(), default=math.inf) > SOONER:
        words = f"out of reach: it leaves the reach at {target.speed:g} m/s before a throw lands"
        plan = dataclasses.replace(plan, status="out_of_reach", message=words)
        plan = dataclasses.replace(plan, binding=("target velocity", *plan.binding))
    return plan


def _sampled(
    scene: Scene, target: Pose, releases: Callable[[], Releases], time: float
) -> tuple[float, float]:
    """How near [m] sampled throws land to where the target is at `time` [s], and when [s] the
    soonest of those that land near it do; inf for none."""
    at, table = target.at(time), releases()
    away = distances(table, scene, at.plane_x, at.z, at.theta)
    flown = table.landings(at.z, scene.gravity)[2]
    lands = table.run_up + scene.gripper.profile().opening + flown
    return float(away.min(initial=np.inf)), float(lands[away <= FAR].min(initial=np.inf))


def _met_from(
    target: Pose,
    thrown: Callable[[Pose, Plan | None], Plan],
    earliest: float,
    beyond: Callable[[float], bool] = lambda time: False,
) -> Plan:
    """The same with a landing not before `earliest` [s]; beyond: a time not to be tried, after the
    first."""
    time, last, wait = earliest, None, 0
    before: tuple[float, float] | None = None
    for number in range(MEETINGS):
        if number and beyond(time):
            break
        plan = thrown(target.at(time), last)
        if not plan.solved or plan.throw is None:
            return dataclasses.replace(plan, target=target)
        lands = plan.throw.landing_time
        # Kept from then on, or it would go up and down by a sample.
        if not -SAME <= (lands - earliest) / TICK + wait <= 2.0:
            wait = max(0, math.ceil((earliest - lands) / TICK))
        lands += wait * TICK
        if abs(target.speed * (lands - time)) <= NEAR:
            return _plan_of(plan, target, wait)
        late, last, change = lands - time, plan, lands - time
        if before is not None and abs(late - before[1]) > 1e-9:
            # Where the line through two throws' times meets the target's.
            change = late * (time - before[0]) / (before[1] - late)
        before, time = (time, late), max(time + min(max(change, -STEP), STEP), 0.0)
    words = "no throw found: the time of its landing does not settle while the target moves"
    if number < MEETINGS - 1:
        words = f"no throw found: it is out of reach at {time:.2f} s, when a throw would land"
    return dataclasses.replace(plan, target=target, status="not_converged", message=words)


def _plan_of(plan: Plan, target: Pose, wait: int) -> Plan:
    """The plan for the target itself, of the throw to where it is met."""
    assert plan.throw is not None
    # Full turns may have been chosen.
    target = target.changed(theta=plan.target.theta)
    throw = _waiting(plan.throw, wait) if wait else plan.throw
    goal = target.at(throw.landing_time)
    final = dataclasses.replace(throw.final, scene=plan.scene.aimed_at(goal))
    throw = dataclasses.replace(throw, final=final)
    plan = dataclasses.replace(plan, target=target, throw=throw, scene=final.scene)
    broken = violations(throw, goal)
    if broken:
        words = "; ".join(violation.words for violation in broken)
        return dataclasses.replace(plan, status="not_converged", message=f"no throw found: {words}")
    return plan


def _waiting(throw: PlannedThrow, wait: int) -> PlannedThrow:
    """The same throw after `wait` samples at rest."""
    final, seconds = throw.final, wait * TICK
    planned, samples = _later(throw.planned, seconds), final.samples
    if len(samples.q):
        still = np.repeat(samples.q[:1], wait, axis=0)
        zero = np.zeros_like(still)
        samples = Samples(
            *(
                np.vstack([first, rows])
                for first, rows in zip(
                    (still, zero, zero), (samples.q, samples.dq, samples.ddq), strict=True
                )
            )
        )
    opened = final.opening_time + seconds
    final = Throw.sent(final.scene, final.mover, planned, samples, opened)
    lands = throw.planned_landing
    return dataclasses.replace(
        throw, planned=planned, final=final, nlp=None, solution=None, landing_of_nlp=lands
    )


def _later(path: Path, seconds: float) -> Path:
    """A path after so long at rest at its first point."""
    start = path.at(np.zeros(1)).pose.T
    rest = Path.cubics(np.array([0.0, seconds]), start, *(np.zeros_like(start),) * 3)
    moved = dataclasses.replace(path, breaks=path.breaks + seconds, kinks=path.kinks + seconds)
    joined = Path.joined([rest, moved])
    return dataclasses.replace(joined, kinks=np.append(seconds, moved.kinks))
