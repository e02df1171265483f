"""Section `rest`: where objects end that are thrown into bins."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import numpy as np
from throwplan import Cup, Object, Plan, Planner, Region, Rest, Scene, load_scene
from throwplan.pictures import Row, Table
from throwplan.planner.rest import entry_states, roll_to_rest
from throwplan.planner.search import ReleaseSampler
from throwplan.planner.uncertainty import Entries, count_rests
from throwplan.planner.verdict import lands_well

from .page import Effort, ReportSection

#: Seed of the bins.
SEED = 32
#: Number of bin scenes: quick, full.
BINS = (2, 30)
#: Most scenes that are drawn for these; no throw is found to the others.
MOST = 200
#: Feasible releases in the search for one that stays, and states that are tried for them.
RELEASES, TRIED = 10_000, 45_000
#: Share of the throws that are to stay.
ENOUGH = 0.9


def make(effort: Effort) -> ReportSection:
    """Plans into random bins, with `[rest]` and without it."""
    wanted = effort.of(*BINS)
    step, bins = effort.counter(wanted), list[Row]()
    for row in _bin_rows():
        bins.append(row)
        step()
        if len(bins) == wanted:
            break
    return ReportSection(
        "rest",
        "Where the object ends",
        _bin_figures(bins),
        [Table("rest-bins", "Throws into bins: of 64 throws, those that stay", bins)],
    )


def _bin_figures(rows: list[Row]) -> list[str]:
    """Shares over all bins, and times."""
    table = Table("", "", rows)

    def share(column: str, some: Table = table) -> str:
        values = [float(str(value)) for value in some.column(column)]
        return f"{100 * sum(values) / (64 * max(len(values), 1)):.1f} %"

    good = table.where(**{"a release stays": True})
    enough = sum(int(str(row["plan"])) >= ENOUGH * 64 for row in good)
    seconds = sorted(float(str(value)) for value in table.column("plan [s]"))
    return [
        f"{len(rows)} bins: of the plain throws {share('plain')} stay, of the plans with `[rest]` "
        f"{share('plan')}, by contacts of another kind {share('plan, other contacts')}; in samples "
        "that chose neither.",
        f"In {len(good)} of the bins one of {RELEASES:,} sampled releases that go in as a plan "
        f"must stays in {100 * ENOUGH:g} % of its trials; in {enough} of them the plan does.",
        f"A plan with `[rest]` takes {seconds[len(seconds) // 2]:.1f} s in the median, at most "
        f"{seconds[-1]:.1f} s.",
    ]


def bin_scene(number: int) -> Scene:
    """A Panda that throws a bar into a bin on the floor or on a table, as a user would write it.

    The object may land anywhere near the middle, at any angle within 35 degrees of upright.
    """
    rng = np.random.default_rng((SEED, number))
    length, width, mass = rng.uniform(0.08, 0.35), rng.uniform(0.015, 0.04), rng.uniform(0.05, 0.3)
    radius, depth = rng.uniform(0.06, 0.13), rng.uniform(0.08, 0.25)
    rim = depth + 0.005 + (rng.uniform(0.1, 0.3) if rng.random() < 0.4 else 0.0)
    x, insertion = rng.uniform(0.75, 1.3), min(0.05, 0.6 * depth)
    room, turn = 0.5 * radius, math.radians(35.0)
    return load_scene("cup").replace(
        name=f"bin {number}",
        object=Object(
            mass=mass,
            inertia=mass * (length**2 + width**2) / 12,
            length=length,
            width=width,
            com=length / 2,
        ),
        cup=Cup(x=x, rim=rim, radius=radius, depth=depth, clearance=0.005, insertion=insertion),
        target=Region(
            (x - room, x + room),
            rim - insertion + length / 2,
            (-math.pi / 2 - turn, -math.pi / 2 + turn),
        ),
        rest=Rest(in_="cup"),
    )


def _bin_rows() -> Iterator[Row]:
    """A row for each bin that a plan reaches."""
    for number in range(MOST):
        scene = bin_scene(number)
        planner = Planner(scene, library=False)
        plain = Planner(scene.replace(rest=None), library=False).plan()
        if not plain.solved:
            continue
        assert scene.cup is not None
        start, used = time.perf_counter(), time.process_time()
        plan = planner.plan()
        seconds, used = time.perf_counter() - start, time.process_time() - used
        yield {
            "bin": number,
            "bar [m]": scene.object.length,
            "radius [m]": scene.cup.radius,
            "depth [m]": scene.cup.depth,
            "plain": _count(plain, scene.rest),
            "plan": _count(plan, scene.rest),
            "plan, other contacts": _by_oracle(plan),
            "a release stays": _best_release(planner) >= ENOUGH,
            "plan [s]": seconds,
            "processor [s]": used,
        }


def _count(plan: Plan, rest: Rest | None) -> int:
    """Throws of 64 that stay."""
    assert plan.throw is not None
    throw = plan.throw.deciding
    count = count_rests(throw.in_scene(throw.scene.replace(rest=rest)))
    assert count is not None
    return count.rests


def _by_oracle(plan: Plan) -> int:
    """The same throws by contacts of another kind."""
    from oracle.rest import rests_in_cup

    assert plan.throw is not None
    throw = plan.throw.deciding
    found = Entries.sampled(throw)
    ends = rests_in_cup(throw.scene, found.states, found.restitution, found.friction)
    return int(ends.sum())


def _best_release(planner: Planner) -> float:
    """The largest share of trials that stay, of sampled releases that go into the cup as a plan
    must: they land in the target, and clear wall and rim on their way in."""
    scene, sampler = planner.scene, ReleaseSampler(planner.scene, planner.manipulator)
    table, target = sampler.draw(TRIED, SEED), scene.aim
    table = table.picked(np.arange(min(RELEASES, len(table.q))))
    assert scene.rest is not None
    x, theta, flown = table.landings(target.z, scene.flight)
    dx, turn = target.miss(x, theta)
    # As if each landed in the middle, so that the cup is where it is.
    landing = np.column_stack([np.full(len(x), target.plane_x), theta, flown])
    enters = lands_well(scene, table.detach, landing)
    good = np.isfinite(flown) & (dx == 0.0) & (turn == 0.0) & table.clear & enters
    chosen = np.flatnonzero(good)
    if not chosen.size:
        return 0.0
    rng, trials = np.random.default_rng(SEED), 16
    detach = np.repeat(table.detach[chosen], trials, axis=0)
    _, states = entry_states(scene, detach)
    low, high = np.array([scene.rest.restitution, scene.rest.friction]).T
    contact = rng.uniform(low, high, (len(detach), 2))
    ends = roll_to_rest(scene, states, *contact.T).where_wanted(scene)
    return float(ends.reshape(-1, trials).mean(axis=1).max())
