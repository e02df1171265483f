"""Targets that move, and times of arrival: where the object is thrown to, and how long it waits.

A throw to where the target will be is a throw to a target at rest. When it lands depends on where
that is, so place and time are found in turn; near a throw its time changes little with the place.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator

import numpy as np

from ..models import Trajectory
from ..problems import Pose, Scene
from .result import Plan, PlannedThrow
from .samples import Releases, arrival
from .throw import TICK, Samples, Throw
from .verdict import verdict

#: Times [s] at which interceptions are looked for.
TIMES = np.arange(0.3, 8.0, 0.1)
#: No throw is planned to where all sampled throws land farther [m, pose error] from the target than
#: this; the target is in reach where one lands nearer than the second.
FAR, REACHED = 0.12, 0.05
#: Most times at which an interception is tried, and the least [s] between two of them.
MAX_TIMES, SPREAD = 4, 0.15
#: A time is late enough if sampled throws need at most this share of it. Planned throws may be
#: faster than sampled ones by the second factor.
ENOUGH, FASTER = 0.9, 2.0
#: Throws take no longer than this [s] unless they must: for later times the arm waits.
LONG = 1.0
#: Throws planned at most, each aimed at where the target is when the one before lands.
MAX_THROWS = 12
#: Times [samples] that differ by less are equal.
EQUAL = 1e-3
#: The longest change [s] of the time of interception from one throw to the next.
MAX_CHANGE = 0.5
#: How far [m] the target may be from where the throw was aimed when it lands.
NEAR = 2e-5

#: Plans a throw to a target at rest, from a plan for a target nearby.
PlanAt = Callable[[Pose, Plan | None], Plan]


def intercept(
    scene: Scene, target: Pose, releases: Callable[[], Releases], plan_at: PlanAt
) -> Plan:
    """The plan whose object lands where the target then is, in its time.

    plan_at(pose, warm): the plan for a target at rest; releases: sampled throws. Where the object
    would land too early the arm waits at rest, in whole samples. Where the target is out of reach
    when a throw by itself would land, other times are tried: first those that sampled throws leave
    most time for.
    """
    if target.at_rest:
        return plan_at(target, None)
    earliest, latest = target.window
    if not target.speed:
        return _intercept_from(target, plan_at, earliest)

    @functools.cache
    def sampled(time: float) -> tuple[float, float]:
        return arrival(releases(), scene, target.at(time), FAR)

    plan = _intercept_from(target, plan_at, earliest, lambda time: sampled(time)[0] > FAR)
    if plan.solved:
        return plan
    times = TIMES[(earliest <= TIMES) & (latest >= TIMES)].tolist()
    shares = {time: sampled(time)[1] / time for time in times if sampled(time)[0] <= FAR}
    for time in _spread(shares):
        aim = target.changed(arrival=time) if time < LONG else target
        found = _intercept_from(aim, plan_at, time)
        if found.solved:
            return dataclasses.replace(found, target=found.target.changed(arrival=target.arrival))
    if sampled(0.0)[0] <= REACHED and min(shares.values(), default=math.inf) > FASTER:
        words = f"no throw found: it leaves the reach at {target.speed:g} m/s before a throw lands"
        names = ("target velocity", *plan.binding)
        return dataclasses.replace(plan, status="not_converged", message=words, binding=names)
    if shares and plan.status == "out_of_reach":
        # Where it is at one time; at another it may be in reach.
        words = f"no throw found at {target.speed:g} m/s: out of reach where the first throw lands"
        return dataclasses.replace(plan, status="not_converged", message=words)
    return plan


def _spread(shares: dict[float, float]) -> Iterator[float]:
    """Times [s] to try, some way apart: the first that is late enough, then those that are most.

    shares: of each time [s] that sampled throws need.
    """
    tried: list[float] = []
    for time in sorted(shares, key=lambda time: max(shares[time], ENOUGH)):
        if all(abs(time - other) >= SPREAD for other in tried):
            tried.append(time)
            yield time
        if len(tried) == MAX_TIMES:
            return


def _intercept_from(
    target: Pose,
    plan_at: PlanAt,
    earliest: float,
    is_beyond: Callable[[float], bool] = lambda time: False,
) -> Plan:
    """The plan with a landing not before `earliest` [s]; is_beyond: whether the target is out of
    reach at a time."""
    time, last, wait = earliest, None, 0
    before: tuple[float, float] | None = None
    words = "no throw found: the time of its landing does not settle while the target moves"
    for number in range(MAX_THROWS):
        if number and is_beyond(time):
            words = f"no throw found: it is out of reach at {time:.2f} s, when a throw would land"
            break
        plan = plan_at(target.at(time), last)
        if not plan.solved or plan.throw is None:
            return dataclasses.replace(plan, target=target)
        lands = plan.throw.landing_time
        # The wait is kept from then on, or it would go up and down by a sample.
        if not -EQUAL <= (lands - earliest) / TICK + wait <= 2.0:
            wait = max(0, math.ceil((earliest - lands) / TICK))
        lands += wait * TICK
        if abs(target.speed * (lands - time)) <= NEAR:
            return _plan_of(plan, plan.throw, target, wait)
        late, last, change = lands - time, plan, lands - time
        if before is not None and abs(late - before[1]) > 1e-9:
            # Where the line through two throws' times meets the target's.
            change = late * (time - before[0]) / (before[1] - late)
        before, time = (time, late), max(time + min(max(change, -MAX_CHANGE), MAX_CHANGE), 0.0)
    return dataclasses.replace(plan, target=target, status="not_converged", message=words)


def _plan_of(plan: Plan, throw: PlannedThrow, target: Pose, wait: int) -> Plan:
    """The plan for the target itself, of a throw to where it is intercepted."""
    # Full turns may have been chosen.
    target = target.changed(theta=plan.target.theta)
    throw = _waiting(throw, wait) if wait else throw
    goal = target.at(throw.landing_time)
    final = dataclasses.replace(throw.deciding, scene=plan.scene.aimed_at(goal))
    judged = verdict(final, goal)
    return dataclasses.replace(
        plan,
        scene=final.scene,
        target=target,
        status="solved" if judged.ok else "not_converged",
        message=plan.message if judged.ok else f"no throw found: {judged.words}",
        throw=dataclasses.replace(throw, deciding=final),
    )


def _waiting(throw: PlannedThrow, wait: int) -> PlannedThrow:
    """The throw after `wait` samples at rest."""
    final, seconds = throw.deciding, wait * TICK
    planned, samples = _delayed(throw.planned, seconds), final.samples
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
    final = Throw.sent(final.scene, final.manipulator, planned, samples, opened)
    lands = throw.planned_landing
    return dataclasses.replace(
        throw, planned=planned, deciding=final, nlp=None, solution=None, landing_of_nlp=lands
    )


def _delayed(path: Trajectory, seconds: float) -> Trajectory:
    """A path after `seconds` at rest at its first point."""
    start = path.at(np.zeros(1)).pose.T
    rest = Trajectory.cubics(np.array([0.0, seconds]), start, *(np.zeros_like(start),) * 3)
    moved = dataclasses.replace(path, breaks=path.breaks + seconds, kinks=path.kinks + seconds)
    joined = Trajectory.joined([rest, moved])
    return dataclasses.replace(joined, kinks=np.append(seconds, moved.kinks))
