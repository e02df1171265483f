"""Section `swings`: targets that move while the arm swings: time of an update, landing errors."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np
from throwplan import Plan, Planner, Pose, load_scene, reach_map
from throwplan.pictures import Row, Table, shown
from throwplan.planner.throw import TICK
from throwplan.robots import follow

from .measure import quantiles
from .page import Effort, ReportSection
from .reach import SAMPLED, over_map

#: Updates per second.
RATE = 400
#: Largest speed [m/s] of the target.
SPEED = 0.1
#: Horizon [s] of the session: delay until an update takes effect.
HORIZON = 0.02
#: Scenes whose swings are followed.
SCENES = ("pose", "cup", "fr3")
#: Number of targets of each scene: quick, full.
TARGETS = (3, 50)


def make(effort: Effort) -> ReportSection:
    """Throws to targets all over the maps of some scenes; the targets move during the swing."""
    step, rows = effort.counter(len(SCENES)), list[Row]()
    for name in SCENES:
        found = reach_map(load_scene(name), samples=effort.of(*SAMPLED))
        rows.append(following(name, over_map(found, effort.of(*TARGETS))))
        step()
    words = "; ".join(
        f"`{row['scene']}` {row['on target']} of {row['swings']} land within the tolerance, "
        f"{row['stopped']} are stopped, {shown(row['update, median [ms]'])} ms an update, "
        f"{shown(row['update, 99 % [ms]'])} ms at 99 %"
        for row in rows
    )
    return ReportSection(
        "swings",
        "Targets that move while the arm swings",
        [
            f"In the first half of the swing the target begins to move, at up to {SPEED:g} m/s; "
            f"{RATE} updates a second, {1e3 * HORIZON:.0f} ms ahead: {words}."
        ],
        [Table("swings", "Swings whose targets move meanwhile", rows)],
    )


def following(name: str, targets: Sequence[Pose]) -> Row:
    """Throws to targets that begin to move during the swing, as long as it lasts."""
    planner, random = Planner(name), np.random.default_rng(0)
    scene, times, kept = load_scene(name), list[float](), list[float]()
    missed = list[tuple[float, float]]()
    on_target = stopped = swings = 0
    for target in targets:
        plan = planner.plan(target)
        if plan.throw is None or not plan.solved or plan.throw.deciding.command_time < 2 * HORIZON:
            continue
        swings += 1
        start_time = random.uniform(0.0, plan.throw.deciding.command_time / 2)
        speed = random.uniform(-SPEED, SPEED)
        off, ended = _followed(planner, plan, start_time, speed, times)
        if ended:
            stopped += 1
            continue
        lands = plan.throw.landing_time
        kept.append(abs(speed) * max(lands - start_time, 0.0))
        missed.append(off)
        tolerance = scene.tolerance
        on_target += abs(off[0]) <= tolerance.position and abs(off[1]) <= tolerance.angle
    return {
        "scene": name,
        "swings": swings,
        "on target": on_target,
        "stopped": stopped,
        "error, 95 % [mm]": 1e3 * quantiles([abs(dx) for dx, _ in missed], 95)[0],
        "error, 95 % [deg]": math.degrees(quantiles([abs(turn) for _, turn in missed], 95)[0]),
        "not followed, 95 % [mm]": 1e3 * quantiles(kept, 95)[0],
        "update, median [ms]": quantiles(times, 50)[0],
        "update, 99 % [ms]": quantiles(times, 99)[0],
    }


def _followed(
    planner: Planner, plan: Plan, start_time: float, speed: float, times: list[float]
) -> tuple[tuple[float, float], bool]:
    """Landing error (dx [m], dtheta [rad]) of a swing, and whether it was stopped.

    times: the updates' durations [ms] are added.
    """
    session, target, status, tick = follow(planner, plan, HORIZON), plan.target, "", 0
    while status not in ("committed", "stopped"):
        t, sent = TICK * tick, session.throw.samples
        moving = t >= start_time
        there = _at(target, start_time, speed, t)
        seen = there.changed(velocity=(speed,)) if moving else there
        begin = time.perf_counter()
        update = session.update(t, sent.q[tick], sent.dq[tick], seen)
        times.append(1e3 * (time.perf_counter() - begin))
        status, tick = update.status, tick + round(1 / RATE / TICK)
    throw = session.throw
    return throw.miss(_at(target, start_time, speed, throw.landing_time)), status == "stopped"


def _at(target: Pose, start_time: float, speed: float, t: float) -> Pose:
    """The target's pose at time t [s]."""
    return target.shifted(speed * max(t - start_time, 0.0), 0.0)
