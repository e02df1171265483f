"""Targets that move, and times of arrival: the place of interception, and the wait before a throw.

A throw to the target's future place is a throw to a target at rest. Its landing time depends on
that place, so place and time are found in turn; the time changes little with the place.
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
from .search import Releases, arrival
from .throw import TICK, Samples, Throw
from .verdict import verdict_on

#: Times [s] at which interceptions are tried.
TIMES = np.arange(0.3, 8.0, 0.1)
#: Plans a throw to a target at rest, from a plan for a target nearby.
PlanAt = Callable[[Pose, Plan | None], Plan]


@dataclasses.dataclass(frozen=True)
class InterceptionSettings:
    """Settings of the search for place and time of an interception.

    max_distance [m]: pose error of the nearest sampled landing above which no further throw is
    planned. max_times: most times that are tried, at least `spacing` [s] apart. late_enough: a time
    is late enough if the fastest sampled throw takes at most this share of it. usual_time [s]: a
    throw takes longer only if it must; for later times the arm waits. max_throws: most throws
    planned for one time, each aimed at the target's place when the one before lands. equal_ticks
    [samples]: times that differ by less are equal. slack [s]: after the earliest arrival, in the
    first half of its window, for pads that open early. max_change [s]: of the time from one throw
    to the next. max_miss [m]: largest way of the target between its time and the landing.
    """

    max_distance: float = 0.12
    max_times: int = 4
    spacing: float = 0.15
    late_enough: float = 0.9
    usual_time: float = 1.0
    max_throws: int = 12
    equal_ticks: float = 1e-3
    slack: float = 0.05
    max_change: float = 0.5
    max_miss: float = 2e-5


SETTINGS = InterceptionSettings()


def intercept(
    scene: Scene, target: Pose, releases: Callable[[], Releases], plan_at: PlanAt
) -> Plan:
    """The plan whose object meets the target within its times of arrival.

    plan_at(pose, warm): the plan for a target at rest; releases: sampled throws. If the object
    would land too early, the arm waits at rest for whole samples. If none is found where the target
    is when the first throw would land, other times are tried: first those that leave sampled throws
    most time.
    """
    if target.is_fixed:
        return plan_at(target, None)
    earliest, latest = target.window
    if target.arrival is not None:
        earliest = min(earliest + SETTINGS.slack, (earliest + latest) / 2)
    if not target.speed:
        return _intercept_from(target, plan_at, earliest)

    @functools.cache
    def sampled(time: float) -> tuple[float, float]:
        return arrival(releases(), scene, target.at(time), SETTINGS.max_distance)

    def is_beyond(time: float) -> bool:
        return sampled(time)[0] > SETTINGS.max_distance

    plan = _intercept_from(target, plan_at, earliest, is_beyond)
    if plan.solved or earliest == latest:
        return plan
    times = TIMES[(target.window[0] <= TIMES) & (latest >= TIMES)].tolist()
    shares = {time: sampled(time)[1] / time for time in times if not is_beyond(time)}
    for time in _spread(shares):
        aim = target.changed(arrival=time) if time < SETTINGS.usual_time else target
        found = _intercept_from(aim, plan_at, time)
        if found.solved and found.throw is not None:
            return _met(found, found.throw, found.target.changed(arrival=target.arrival))
    # What is proven of one place of the target is not proven of others.
    return dataclasses.replace(plan, bound=None)


def _spread(shares: dict[float, float]) -> Iterator[float]:
    """Times [s] to try: the first that is late enough, then in the order of their shares.

    shares: of each time [s], the share that the fastest sampled throw takes.
    """
    tried: list[float] = []
    for time in sorted(shares, key=lambda time: max(shares[time], SETTINGS.late_enough)):
        if all(abs(time - other) >= SETTINGS.spacing for other in tried):
            tried.append(time)
            yield time
        if len(tried) == SETTINGS.max_times:
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
    until = (TICK, target.window[1]) if target.window[1] < math.inf else None
    # One time, or a window of hardly more, may be missed by a sample on either side; a wider window
    # must contain the landing.
    exact, equal = target.window[1] < earliest + 2 * TICK, SETTINGS.equal_ticks
    least, most = (equal - 1.0, 1.0 - equal) if exact else (-equal, 2.0)
    for number in range(SETTINGS.max_throws):
        if number and is_beyond(time):
            words = f"no throw found: it is too far at {time:.2f} s, when a throw would land"
            break
        # A throw that lands too early is solved, too: the arm waits.
        plan = plan_at(target.at(time).changed(arrival=until), last)
        if not plan.solved or plan.throw is None:
            return dataclasses.replace(plan, target=target)
        lands = plan.throw.landing_time
        # A wait is kept, else it would change by a sample each time.
        if not least <= (lands - earliest) / TICK + wait <= most:
            short = (earliest - lands) / TICK
            wait = max(0, round(short) if exact else math.ceil(short))
        lands += wait * TICK
        if abs(target.speed * (lands - time)) <= SETTINGS.max_miss:
            return _plan_of(plan, plan.throw, target, wait)
        late, last, change = lands - time, plan, lands - time
        if before is not None and abs(late - before[1]) > 1e-9:
            # A secant step to the time at which throw and target meet.
            change = late * (time - before[0]) / (before[1] - late)
        change = min(max(change, -SETTINGS.max_change), SETTINGS.max_change)
        before, time = (time, late), max(time + change, 0.0)
    return dataclasses.replace(
        plan, target=target, status="not_found", message=words, throw=None, alternatives=()
    )


def _plan_of(plan: Plan, throw: PlannedThrow, target: Pose, wait: int) -> Plan:
    """The plan for the moving target, of a throw to the place of interception."""
    # The plan may have chosen full turns.
    target = target.changed(theta=plan.target.theta)
    return _met(plan, _waiting(throw, wait) if wait else throw, target)


def _met(plan: Plan, throw: PlannedThrow, target: Pose) -> Plan:
    """The plan with this throw, judged at the target's place when it lands."""
    goal = target.at(throw.landing_time)
    final = dataclasses.replace(throw.deciding, scene=plan.scene.aimed_at(goal))
    judged = verdict_on(final, goal)
    return dataclasses.replace(
        plan,
        scene=final.scene,
        target=target,
        status="solved" if judged.ok else "not_found",
        message=plan.message if judged.ok else f"no throw found: {judged.words}",
        throw=dataclasses.replace(throw, deciding=final) if judged.ok else None,
    )


def _waiting(throw: PlannedThrow, wait: int) -> PlannedThrow:
    """The throw after `wait` samples at rest."""
    final, seconds = throw.deciding, wait * TICK
    planned, samples = _delayed(throw.planned, seconds), final.samples
    if len(samples.q):
        rows = np.pad(samples.rows, ((0, 0), (wait, 0), (0, 0)))
        rows[0, :wait] = samples.q[0]
        samples = Samples(*rows)
    opened = final.opening_time + seconds
    final = Throw.sent(final.scene, final.manipulator, samples, opened)
    lands = throw.planned_landing
    return dataclasses.replace(
        throw, planned=planned, deciding=final, layout=None, solution=None, landing_of_nlp=lands
    )


def _delayed(path: Trajectory, seconds: float) -> Trajectory:
    """A path after `seconds` at rest at its first point."""
    start = path.at(np.zeros(1)).pose.T
    rest = Trajectory.cubics(np.array([0.0, seconds]), start, *(np.zeros_like(start),) * 3)
    moved = dataclasses.replace(path, breaks=path.breaks + seconds, kinks=path.kinks + seconds)
    joined = Trajectory.joined([rest, moved])
    return dataclasses.replace(joined, kinks=np.append(seconds, moved.kinks))
