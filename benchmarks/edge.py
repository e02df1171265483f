"""Section `edge`: is it true what plans say of targets in reach, at its edge, beyond and far off?

Every target is planned without a library and with one. A target is in reach if any search throws to
it: either planner, or for some targets `_Endless`, which no evidence ends. The nearest pose that a
plan names is planned again, by the same planner and by one that knows no other throw.
"""

from __future__ import annotations

import collections
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from throwplan import Obstacle, Planner, Pose, ReachMap, Scene, load_scene, reach_map
from throwplan.planner.planner import SAMPLES
from throwplan.planner.samples import Releases, ReleaseSampler
from throwplan.planner.search import (
    FROM_NOTHING,
    Clock,
    History,
    Search,
    SearchContext,
    Task,
    find_throws,
)
from throwplan.planner.show import BLACK, BLUE, GREEN, RED, Row, Table

from .measure import quantiles
from .page import Effort, Picture, ReportSection, panels
from .processes import shared
from .reach import SAMPLED, THROWS, over_map

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Scenes: quick, full; the first of the full ones is drawn.
SCENES = ("hand-flip",), ("pose", "cup", "box", "flip", "fr3", "hand-flip")
#: Targets of a scene over its map: quick, full.
IN_MAP = (6, 167)
#: Those beyond it: how many, quick and full, so many bins from the nearest with a landing.
BEYOND = {"beyond": ((4, 84), (2, 4)), "far beyond": ((2, 30), (14, 40))}
#: Of the targets of a scene that neither planner throws to, those of each kind that are searched on
#: for; the processor time [s] of such a search: quick, full.
SEARCHED, SEARCH_TIME = (1, 8), (10.0, 30.0)
#: Longest time [s] of a plan to a pose that was named as nearest.
NAMED_TIME = 5.0
#: A landing is too far if its pose error is above this multiple of the best known.
TOO_FAR = 1.1
#: Targets of a line across the edge, and the distance [m] between two: quick, full.
LINE, STEP = (9, 61), 0.005
#: Coarse steps [m] to the edge, and the longest way [m] to it.
COARSE, LONGEST = 0.05, 3.0
#: Columns of a table.
FALSE, AGAIN, OTHER, FAR = "false", "named: again", "named: by another", "named: too far"


@dataclass(frozen=True)
class _Answer:
    """What a planner says of a target.

    nearest: the pose that it names; again: whether it throws to that; seconds: processor time.
    """

    status: str
    nearest: Pose | None
    again: bool
    seconds: float


@dataclass(frozen=True)
class _Truth:
    """What further searches find: whether a throw, the least pose error [m] of a landing, whether
    they looked for one; and whether another planner throws to the poses that were named."""

    solved: bool
    least: float
    searched: bool
    others: tuple[bool | None, ...]


class _Endless(Search):
    """A search that ends with a throw, or without time or a further start.

    It begins from sampled releases of its own: those of a planner would fail where the plan did.
    """

    def is_settled(self, history: History) -> bool:
        """Never: no evidence is enough."""
        return False

    def is_complete(self, history: History) -> bool:
        """With one throw, though the task asks for more starts than that needs."""
        return bool(history.found)


def make(effort: Effort) -> ReportSection:
    """Plans to targets over the maps and beyond, what other searches find, and lines."""
    names, lines = effort.of(*SCENES), _lines()[: effort.of(1, len(_lines()))]
    step, rows, pictured = effort.counter(len(names) + len(lines)), list[Row](), list[Row]()
    for name in names:
        made, drawn = _asked(name, effort)
        rows, pictured = rows + made, pictured or drawn
        step()
    crossed = list[Row]()
    for row in shared(_crossed, lines, [effort.of(*LINE)] * len(lines), quick=effort.quick):
        crossed.append(row)
        step()
    table = Table("edge-targets", f"Targets of `{names[0]}`, and what was said", pictured)
    words = f"Scene {names[0]}: targets over the map and beyond, and the nearest poses named"
    return ReportSection(
        "edge",
        "In reach or not",
        _figures(rows, crossed, effort.of(*SEARCH_TIME)),
        [
            Table("edge", "Targets over the maps and beyond them", rows),
            Table("edge-lines", "Lines of targets across the edge", crossed),
            table,
        ],
        [Picture("edge", words, _draw_targets(table))],
    )


def _asked(name: str, effort: Effort) -> tuple[list[Row], list[Row]]:
    """Counts and times of both planners on a scene; what the one without a library says."""
    scene, count = load_scene(name), effort.of(*IN_MAP)
    found = reach_map(scene, samples=effort.of(*SAMPLED))
    targets, parts = over_map(found, count), {"over the map": slice(0, count)}
    for words, (counts, ring) in BEYOND.items():
        begin = len(targets)
        targets += beyond_map(found, effort.of(*counts), ring)
        parts[words] = slice(begin, len(targets))
    prepared = Planner(scene)
    throws = prepared.prepare(effort.of(*THROWS))
    planners = {"none": Planner(scene, library=False), f"{throws} throws": prepared}
    answers = {
        library: [_answer(planner, target) for target in targets]
        for library, planner in planners.items()
    }
    pairs = list(zip(*answers.values(), strict=True))
    seconds = [
        effort.of(*SEARCH_TIME) * is_searched
        for part in parts.values()
        for is_searched in _looked_for(pairs[part], effort.of(*SEARCHED))
    ]
    jobs = [name] * len(targets), targets, pairs, seconds
    truths, rows = list(shared(_truth, *jobs, quick=effort.quick)), list[Row]()
    for words, part in parts.items():
        for number, (library, said) in enumerate(answers.items()):
            row: Row = {"scene": name, "targets": words, "library": library}
            rows.append(row | _row(scene, targets[part], said[part], truths[part], number))
    near = zip(targets, answers["none"], truths, strict=True)
    return rows, [_drawn(*one) for one in islice(near, parts["beyond"].stop)]


def beyond_map(found: ReachMap, count: int, ring: tuple[int, int]) -> list[Pose]:
    """Targets at random places of `count` random bins, ring[0] to ring[1] bins from the nearest
    with a landing."""
    from scipy.ndimage import binary_dilation

    rng, target, most = np.random.default_rng(0), found.scene.aim, ring[1]
    edges = [found.x_edges] if found.theta_edges is None else [found.x_edges, found.theta_edges]
    widths = [float(some[1] - some[0]) for some in edges]
    landings = found.landings.reshape([len(some) - 1 for some in edges])
    hit, square = np.pad(landings > 0, most), np.ones([3] * len(edges))
    near, far = (binary_dilation(hit, square, iterations=k) for k in (ring[0] - 1, most))
    bins = np.argwhere(far & ~near)
    targets = []
    for chosen in bins[rng.choice(len(bins), count, replace=len(bins) < count)]:
        places = [
            some[0] + width * (k - most + rng.uniform())
            for some, width, k in zip(edges, widths, chosen, strict=True)
        ]
        targets.append(target.in_plane(*map(float, places), *[None] * (2 - len(places))))
    return targets


def _answer(planner: Planner, target: Pose) -> _Answer:
    """A planner's answer, and whether it throws to the nearest pose that it names."""
    start = time.process_time()
    plan = planner.plan(target)
    seconds, named = time.process_time() - start, plan.nearest
    if plan.status != "out_of_reach" or named is None:
        return _Answer(plan.status, named, again=False, seconds=seconds)
    return _Answer(plan.status, named, planner.plan(named).solved, seconds)


def _looked_for(pairs: Sequence[tuple[_Answer, ...]], most: int) -> list[bool]:
    """For each target whether it is searched on for: the first that no planner throws to."""
    lost = np.array([all(one.status != "solved" for one in answers) for answers in pairs])
    found: list[bool] = (lost & (np.cumsum(lost) <= most)).tolist()
    return found


def _truth(name: str, target: Pose, answers: tuple[_Answer, ...], seconds: float) -> _Truth:
    """What further searches find of a target.

    seconds [s]: of the one that no evidence ends, 0 for none.
    """
    lever, solved = load_scene(name).object.half_length, any(a.status == "solved" for a in answers)
    known = [target.distance(a.nearest, lever) for a in answers if a.nearest is not None]
    if seconds:
        history = _search(_Endless, name, target, seconds, starts=5, seed=1)
        solved = bool(history.found)
        known += [edge.missed for edge in history.edges]
    others = [
        bool(_search(Search, name, a.nearest, NAMED_TIME).found)
        if a.status == "out_of_reach" and a.nearest is not None
        else None
        for a in answers
    ]
    least = 0.0 if solved else min(known, default=math.inf)
    return _Truth(solved, least, seconds > 0.0, tuple(others))


def _search(
    kind: type[Search], name: str, target: Pose, seconds: float, starts: int = 1, seed: int = 0
) -> History:
    """The search of a planner that has planned nothing else; starts: that it may try, as of a plan
    for so many throws; seed: of its sampled releases, 0 for a planner's."""
    planner = _planner_of(name)
    context = SearchContext(planner.problems, lambda: _releases_of(name, seed), keep=False)
    scene, clock = planner.scene.aimed_at(target), Clock.lasting(seconds)
    task = Task(scene, target, clock=clock, wanted=starts)
    return find_throws(kind(context, task), FROM_NOTHING, History())


@lru_cache(maxsize=1)
def _planner_of(name: str) -> Planner:
    """A process's planner of a scene, for its NLPs."""
    return Planner(name, library=False)


@lru_cache(maxsize=2)
def _releases_of(name: str, seed: int) -> Releases:
    """As many sampled releases as a planner's."""
    planner = _planner_of(name)
    sampler = ReleaseSampler(planner.scene, planner.manipulator)
    return sampler.draw(SAMPLES, seed) if seed else planner.releases()


def _row(
    scene: Scene,
    targets: Sequence[Pose],
    said: Sequence[_Answer],
    truths: Sequence[_Truth],
    number: int,
) -> Row:
    """Counts and times of a planner's answers; number: of it among the planners."""
    counts = collections.Counter(answer.status for answer in said)
    of = list(zip(targets, said, truths, strict=True))
    gone = [(t, a, truth) for t, a, truth in of if a.status == "out_of_reach"]
    named = [(t, a.nearest, a, truth) for t, a, truth in gone if a.nearest is not None]
    others = [truth.others[number] for *_, truth in named]
    lever = scene.object.half_length
    far = [
        t.distance(pose, lever) > TOO_FAR * truth.least + scene.tolerance.position
        for t, pose, _, truth in named
        if truth.searched and not truth.solved
    ]
    seconds = [answer.seconds for answer in said]
    ends = quantiles([a.seconds for _, a, _ in gone], 50)
    middle, most, longest = quantiles(seconds, 50, 90, 99)
    return {
        "solved": counts["solved"],
        "out of reach": counts["out_of_reach"],
        "no answer": counts["not_converged"],
        FALSE: sum(truth.solved for *_, truth in gone),
        "searched on for": sum(truth.searched for *_, truth in gone),
        "named": len(named),
        AGAIN: sum(a.again for _, _, a, _ in named),
        OTHER: sum(map(bool, others)),
        FAR: sum(far),
        "median [s]": middle,
        "90 % [s]": most,
        "99 % [s]": longest,
        "over 1 s": sum(value > 1.0 for value in seconds),
        "out of reach, median [s]": ends[0],
    }


def _figures(rows: Sequence[Row], crossed: Sequence[Row], seconds: float) -> list[str]:
    """The results as sentences; seconds: of each search that no evidence ends."""
    # One along which all targets that are tried are solved crosses no edge.
    crossed = [row for row in crossed if int(str(row["solved"])) < int(str(row["targets"]))]
    lines = [row for row in crossed if not row["unsolved between"]]
    return [
        *(_words(rows, library, seconds) for library in (False, True)),
        f"Lines of targets {1e3 * STEP:.0f} mm apart across the edge: on {len(lines)} of "
        f"{len(crossed)} every target between two solved ones is solved.",
    ]


def _words(rows: Sequence[Row], library: bool, seconds: float) -> str:
    def total(key: str, targets: str = "") -> int:
        return sum(
            int(str(row[key]))
            for row in rows
            if (row["library"] != "none") == library and targets in ("", row["targets"])
        )

    counts = []
    for targets in ("over the map", *BEYOND):
        solved, lost, left = (total(k, targets) for k in ("solved", "out of reach", "no answer"))
        counts.append(
            f"of {solved + lost + left} targets {targets} {solved} are solved, {lost} called out "
            f"of reach and {left} undecided"
        )
    return (
        f"{'With' if library else 'Without'} a library: {'; '.join(counts)}. "
        f"{total(FALSE)} of {total('out of reach')} answers "
        f'"out of reach" are false ({total("searched on for")} of them searched on for, '
        f"{seconds:.0f} s each; {total(FAR)} of these named a pose over a tenth too far). "
        f"Of {total('named')} poses named the same planner throws to {total(AGAIN)}, a new one to "
        f"{total(OTHER)}. {total('over 1 s')} plans take over 1 s of processor time."
    )


# Lines across the edge.


def _lines() -> list[tuple[str, str]]:
    """Scenes and directions."""
    ways = {"hand-box": ("x", "-x"), "box": ("x", "-x"), BEHIND: ("x", "theta", "-theta")}
    every = ("x", "-x", "theta", "-theta")
    return [(name, way) for name in CROSSED for way in ways.get(name, every)]


def _wider_cup() -> Scene:
    scene = load_scene("cup")
    assert scene.cup is not None
    return scene.replace(cup=replace(scene.cup, radius=0.09))


def _behind_wall() -> Scene:
    """A wall between the arm and targets behind it."""
    wall = Obstacle("wall", "box", (0.06, 0.5, 0.3), (0.75, 0.0, 0.15))
    return load_scene("pose").replace(obstacle=(wall,))


#: Towards the arm the targets of this scene are inside its wall.
BEHIND = "pose, behind a wall"
#: Scenes of the lines.
CROSSED: dict[str, Callable[[], Scene]] = {
    "hand-box": lambda: load_scene("hand-box"),
    "cup": lambda: load_scene("cup"),
    "a wider cup": _wider_cup,
    BEHIND: _behind_wall,
    "fr3": lambda: load_scene("fr3"),
    "box": lambda: load_scene("box"),
}


def _crossed(line: tuple[str, str], count: int) -> Row:
    """A line from the scene's own target across the edge: half of it before, half beyond."""
    name, way = line
    planner = Planner(CROSSED[name](), library=False)
    own, lever = planner.scene.aim, planner.scene.object.half_length
    sign = -1.0 if way.startswith("-") else 1.0
    turns = way.endswith("theta")

    def at(away: float) -> Pose:
        return own.shifted(0.0, sign * away / lever) if turns else own.shifted(sign * away, 0.0)

    places = np.arange(COARSE, LONGEST, COARSE).tolist()
    edge = next((a for a in places if not planner.plan(at(a)).solved), LONGEST)
    start, seconds = edge - STEP * (count // 2), list[float]()
    solved = list[bool]()
    for k in range(count):
        began = time.process_time()
        solved.append(planner.plan(at(start + STEP * k)).solved)
        seconds.append(time.process_time() - began)
    inside = np.flatnonzero(solved)
    between = solved[inside[0] : inside[-1] + 1] if len(inside) else []
    return {
        "scene": name,
        "along": way,
        "edge [m]": edge,
        "targets": count,
        "solved": sum(solved),
        "unsolved between": len(between) - sum(between),
        "mean [s]": float(np.mean(seconds)),
    }


# The picture.


def _drawn(target: Pose, answer: _Answer, truth: _Truth) -> Row:
    row: Row = {}
    for which, pose in (("", target), ("nearest ", answer.nearest)):
        theta = None if pose is None or pose.theta is None else math.degrees(pose.theta)
        row[f"{which}x [m]"] = None if pose is None else pose.plane_x
        row[f"{which}theta [deg]"] = theta
    return row | {"status": answer.status, "in reach": truth.solved}


def _draw_targets(rows: Table) -> Figure:
    """Targets in x and theta by status, none far off, and the nearest landings that plans name."""
    figure, ((axis,),) = panels(9.0, 5.0)
    some = rows.rows
    named = [row for row in some if row["nearest x [m]"] is not None]
    for row in named:
        x, theta = (
            [row[f"{k}{name}"] for k in ("", "nearest ")] for name in ("x [m]", "theta [deg]")
        )
        axis.plot(x, theta, color="#dddddd", lw=0.7, zorder=1)
    groups = (
        ("thrown to", [r for r in some if r["status"] == "solved"], "", BLUE, "."),
        ("called out of reach", [r for r in some if r["status"] == "out_of_reach"], "", RED, "x"),
        ("nearest pose named", named, "nearest ", GREEN, "+"),
        ("no answer", [r for r in some if r["status"] == "not_converged"], "", BLACK, "s"),
    )
    for words, group, which, colour, marker in groups:
        if group:
            x = [row[f"{which}x [m]"] for row in group]
            theta = [row[f"{which}theta [deg]"] for row in group]
            axis.plot(x, theta, marker, color=colour, ms=5, label=f"{words} ({len(group)})")
    axis.set(xlabel="x [m]", ylabel="θ [deg]")
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False)
    return figure
