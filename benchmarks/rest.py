"""Section `rest`: where objects end: recorded tosses of a cube, and throws into bins.

The tosses are those of ContactNets (Pfrommer, Halm, Posa 2020; BSD licence beside the data): a cube
of 10 cm thrown by hand onto a board, from its state after the release to where it comes to rest.
"""

from __future__ import annotations

import csv
import importlib
import math
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from throwplan import Cup, Grasp, Object, Plan, Planner, Pose, Region, Rest, Scene, load_scene
from throwplan.models import Array
from throwplan.planner.rest import ContactModel, entry_states, load_mujoco, roll_to_rest
from throwplan.planner.samples import ReleaseSampler
from throwplan.planner.show import Row, Table, shown
from throwplan.planner.uncertainty import Entries, count_rests
from throwplan.planner.verdict import lands_well

from .page import Effort, ReportSection

#: The recorded tosses: 570 rows.
TOSSES = Path(__file__).parent / "data" / "cube-tosses.csv"
#: Half the cube's edge [m], its mass [kg] and its moment of inertia [kg m^2], from the same source.
HALF, MASS, INERTIA = 0.0524, 0.37, 8.1e-4
#: Contacts that are tried on the tosses: restitution and friction.
CONTACTS = [(e, mu) for e in (0.0, 0.125, 0.25) for mu in (0.10, 0.18, 0.30)]
#: Time step [s] of these simulations.
STEP = 5e-4
#: Seed of the bins.
SEED = 32
#: Number of bin scenes: quick, full.
BINS = (2, 30)
#: Most scenes that are drawn for these; the others are out of reach.
MOST = 200
#: Feasible releases in the search for one that stays, and states that are tried for them.
RELEASES, TRIED = 10_000, 45_000
#: Share of the throws that are to stay.
ENOUGH = 0.9


def make(effort: Effort) -> ReportSection:
    """Tosses, then bins."""
    tosses = toss_rows(effort.of(60, 570))
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
        [_toss_figure(tosses), *_bin_figures(bins)],
        [
            Table("rest-tosses", "Recorded tosses of a cube: where it ends", tosses),
            Table("rest-bins", "Throws into bins: of 64 throws, those that stay", bins),
        ],
    )


# Recorded tosses.


def toss_rows(count: int) -> list[Row]:
    """The distance between simulated and recorded ends, by the contact, on two halves."""
    with TOSSES.open(encoding="utf-8") as file:
        names = next(csv.reader(file))
    data = dict(zip(names, np.loadtxt(TOSSES, delimiter=",", skiprows=1)[:count].T, strict=True))
    end = np.array([data["end_x"], data["end_y"]])
    rows = list[Row]()
    for contact in CONTACTS:
        off = 1e3 * np.hypot(*(_ends(data, *contact) - end))
        first, second = np.median(off[::2]), np.median(off[1::2])
        rows.append(
            {
                "restitution": contact[0],
                "friction": contact[1],
                "odd tosses, median [mm]": float(first),
                "even tosses, median [mm]": float(second),
                "90 % of all [mm]": float(np.quantile(off, 0.9)),
            }
        )
    fall = data["v_z"] + np.sqrt(data["v_z"] ** 2 + 2 * 9.81 * np.maximum(data["z"] - HALF, 0.0))
    stays = [data[f"{axis}"] + data[f"v_{axis}"] * fall / 9.81 for axis in "xy"]
    off = 1e3 * np.hypot(*(np.array(stays) - end))
    rows.append(
        {
            "restitution": None,
            "friction": None,
            "odd tosses, median [mm]": float(np.median(off[::2])),
            "even tosses, median [mm]": float(np.median(off[1::2])),
            "90 % of all [mm]": float(np.quantile(off, 0.9)),
        }
    )
    return rows


def _ends(data: dict[str, Array], restitution: float, friction: float) -> Array:
    """Simulated x, y (2, N) [m] at the end of each toss."""
    mujoco, rollout = load_mujoco(), importlib.import_module("mujoco.rollout")
    cube = Object(mass=MASS, inertia=INERTIA, length=2 * HALF, width=2 * HALF, com=HALF)
    scene = load_scene("hand-box").replace(
        object=cube, grasp=Grasp(), target=Pose(0.6, 0.3), rest=Rest(within=1.0, floor=0.0)
    )
    model = ContactModel.of(scene, STEP, restitution, friction).model
    names = ["x", "y", "z", "q_w", "q_x", "q_y", "q_z", "v_x", "v_y", "v_z", "w_x", "w_y", "w_z"]
    states = np.column_stack([0.0 * data["x"], *(data[name] for name in names)])
    last = np.round(data["duration"] / STEP).astype(int) - 1
    threads = [mujoco.MjData(model) for _ in range(2)]
    with rollout.Rollout(nthread=2) as pool:
        path, _ = pool.rollout(model, threads, states, nstep=int(last.max()) + 1)
    return np.asarray(path[np.arange(len(states)), last, 1:3].T)


def _toss_figure(rows: list[Row]) -> str:
    *tried, stays = rows
    best = min(tried, key=lambda row: float(str(row["odd tosses, median [mm]"])))
    return (
        "Recorded tosses of a cube, 570 (60 in a quick run): with the contact that fits the odd "
        "ones best (restitution "
        f"{shown(best['restitution'])}, friction {shown(best['friction'])}) the even ones end "
        f"{shown(best['even tosses, median [mm]'])} mm in the median from where the cube came to "
        f"rest, 90 % of all within {shown(best['90 % of all [mm]'])} mm. A cube that stops where "
        f"it lands would be {shown(stays['even tosses, median [mm]'])} mm off."
    )


# Bins.


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
