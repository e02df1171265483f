"""Section: the planner's error against its run time, over meshes, integrators and solvers."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene, load_scene
from .page import Cell, Effort, Picture, Section, Table
from .planner_points import MARGINS, beats, best_of, points, scaled
from .planner_runs import Measured, Variant, measured, usual_planner
from .reach_study import reachable_targets

Array = npt.NDArray[np.float64]

#: Seed of the targets; scenes with their targets: quick, full.
SEED, TARGETS = 2, {"cup": (2, 14), "hand-flip": (3, 14)}
#: Runs of each first solve, of which the fastest counts: quick, full.
REPEATS = (1, 2)
#: Each setting by itself, the others as they usually are: quick, full.
CARRY = ((6,), (3, 4, 5, 6, 8, 10, 15))
OPENING = ((4, 8, 16), (4, 6, 8, 12, 16, 24, 32))
GRADING = ((), (1.0, 1.25, 1.5, 2.0, 3.0))
EPSILON = ((0.1, 0.01), (0.3, 0.1, 0.03, 0.02, 0.015, 0.01, 0.003, 0.001))
#: Intervals of the opening, with Runge-Kutta steps in each.
STEPS = (((8, 2),), ((4, 1), (8, 1), (16, 1), (4, 2), (8, 2), (16, 4)))


def variants(effort: Effort) -> list[Variant]:
    """All that is measured, the usual settings first."""
    which = int(not effort.quick)
    found = [Variant(), Variant(solver="ipopt")]
    found += [Variant((("carry", n),)) for n in CARRY[which]]
    found += [Variant((("opening", n),)) for n in OPENING[which]]
    found += [Variant((("grading", n),)) for n in GRADING[which]]
    found += [Variant((("epsilon", n),)) for n in EPSILON[which]]
    for opening, substeps in STEPS[which]:
        mesh = (("integrator", "rk4"), ("opening", opening), ("substeps", substeps))
        found.append(Variant(mesh))
    if not effort.quick:
        found += [Variant(compiling="wait"), Variant(solver="ipopt", compiling="wait")]
        found.append(Variant((("opening", 16),), compiling="wait"))
    usual = dataclasses.asdict(load_scene("cup").mesh)
    changed = [v for v in found if not v.mesh or any(usual[k] != value for k, value in v.mesh)]
    return list(dict.fromkeys(changed))


def make(effort: Effort) -> Section:
    """The section."""
    section = Section("planner", "The planner: error against run time")
    section.add(
        "Every target is solved once from the nearest sampled release; `exact` is where the "
        "non-smooth sliding pivot lands that planned motion, `sent` where it lands what Ruckig "
        "makes of it, both before any correction: the error of smoothing, mesh and sending. "
        "`final` is what is left after the planner's own corrections, with the time of the "
        "whole plan. Errors are the scaled ones (position and half the bar's length times the "
        "angle). Solving times are the processor's. All opening intervals are multiple "
        "shooting; `gauss` is two-point collocation inside each, its accelerations unknowns of "
        "the NLP. The effort is the NLP's cost, squared accelerations and jerks over the throw: "
        "with fewer intervals to carry the object it is higher. Random targets in reach, "
        f"seed {SEED}. ★: no other row of the same kind (compiled or not) is better in solving "
        f"time, exact error or effort (by more than {_shares(MARGINS)} %) and not worse by as "
        "much in any, all as medians of the ratios to the default's for the same targets, whose "
        "solve is timed just before the other's.",
        f"The default is FATROP, then IPOPT where that fails, with `{_mesh(load_scene('cup'))}` "
        "(section `[mesh]` of a scene). Other rows differ from it by what is named.",
        "Before correction the errors of a coarse mesh and of ε can cancel in part, so that a "
        "finer row may be the worse one; more intervals tend to the error of ε alone. What a "
        "plan ends with is `final`: choose by plans solved, their time and that.",
    )
    asked = variants(effort)
    total, scenes = len(TARGETS) * len(asked), []
    for number, (name, sizes) in enumerate(TARGETS.items()):
        scene = load_scene(name)
        targets = list(itertools.islice(reachable_targets(scene, SEED), effort.of(*sizes)))
        usual, found = usual_planner(scene), list[Measured]()
        for k, variant in enumerate(asked):
            effort.tell(number * len(asked) + k, total)
            found.append(measured(scene, targets, variant, usual, effort.of(*REPEATS)))
        figures, best = points(found), [False] * len(found)
        for kind in ("no", "wait"):
            # Compiled ones are compared among themselves.
            alike = [k for k, variant in enumerate(asked) if variant.compiling == kind]
            for k, star in zip(alike, best_of(figures[alike]), strict=True):
                best[k] = star
        again = measured(scene, targets, asked[0], usual, effort.of(*REPEATS))
        section.add(_table(name, targets, asked, found, figures, best))
        section.add(f"{_words(asked, found, figures, best)} {_chance(found[0], again)}")
        section.add(_picture(name, asked, figures, best))
        scenes.append(found)
    table, words, choice = _together(asked, scenes)
    section.add(table, words)
    section.short.append(_short(asked, dict(zip(TARGETS, scenes, strict=True)), choice))
    return section


def _mesh(scene: Scene) -> str:
    """The settings of the NLP, as a scene file has them."""
    mesh = scene.mesh
    words = f"carry = {mesh.carry}, opening = {mesh.opening}, grading = {mesh.grading:g}"
    return f'{words}, integrator = "{mesh.integrator}", epsilon = {mesh.epsilon:g}'


def _chance(one: Measured, again: Measured) -> str:
    """How much a row differs from itself, measured at the end once more."""
    plan = abs(float(np.median(again.plan) / np.median(one.plan)) - 1)
    words = f"Measured once more at the end, its plan differs by {100 * plan:.0f} %"
    if again.beside is not None:
        solve = abs(float(np.median(again.solve / again.beside)) - 1)
        words += f", its solve from the one just before it by {100 * solve:.0f} %"
    return f"{words}."


def _short(asked: list[Variant], scenes: dict[str, list[Measured]], choice: str) -> str:
    """What to plan with."""
    words = []
    for name, found in scenes.items():
        known = {(v.words, v.solver, v.compiling): one for v, one in zip(asked, found, strict=True)}
        mine, other = known["as it is", "fatrop", "no"], known["as it is", "ipopt", "no"]
        fast = known.get(("as it is", "fatrop", "wait"))
        times = f"{1e3 * float(np.median(mine.plan)):.0f} ms a plan"
        if fast is not None:
            times += f", {1e3 * float(np.median(fast.plan)):.0f} ms compiled"
        slower = float(
            np.median(other.solve / (mine.solve if other.beside is None else other.beside))
        )
        worst = 1e3 * float(scaled(mine.final).max(initial=0.0))
        words.append(
            f"`{name}` {times}, {mine.plans} of {len(mine.plan)} solved, {worst:.2g} mm left at "
            f"most; IPOPT's solve takes {slower:.1f} times as long"
        )
    usual = _mesh(load_scene("cup"))
    return f"To plan, the default, FATROP with `{usual}`: {'; '.join(words)}. {choice}"


def _together(asked: list[Variant], scenes: list[list[Measured]]) -> tuple[Table, str, str]:
    """All scenes at once: a setting is the same for all of them; and what to choose from."""
    figures = np.exp(np.mean([np.log(points(found)) for found in scenes], axis=0))
    seconds, errors, costs = figures.T
    usual = [k for k, v in enumerate(asked) if v.compiling == "no" and np.isfinite(seconds[k])]
    best = {k for k, star in zip(usual, best_of(figures[usual]), strict=True) if star}
    rows: list[list[Cell]] = [
        [
            ("★ " if k in best else "") + asked[k].words,
            asked[k].solver,
            float(errors[k]),
            float(errors[k] / errors[0]),
            float(seconds[k]),
            float(seconds[k] / seconds[0]),
            _more(costs[k]),
        ]
        for k in usual
    ]
    caption = (
        f"All {len(scenes)} scenes together (geometric means), not compiled, settings that solve "
        "nine of ten targets at once in each"
    )
    columns = (
        *("setting", "solver", "exact [mm]", "over the default's", "solve [ms]", "over its"),
        "effort, % above its",
    )
    where = "is on it"
    if 0 not in best:
        better = [
            f"{asked[k].words} ({errors[k] / errors[0]:.2f} of its error, "
            f"{seconds[k] / seconds[0]:.2f} of its time, {100 * (costs[k] - 1):+.2f} % effort)"
            for k in usual
            if beats(figures[k], figures[0])
        ]
        where = f"is not: better is {'; '.join(better)}"
    stars = ", ".join(asked[k].words.replace("as it is", "the default") for k in usual if k in best)
    choice = f"On the Pareto set of all scenes together: {stars}; the default {where}."
    words = choice
    left = [
        f"{variant.words} ({' and '.join(str(found[k].solved) for found in scenes)})"
        for k, variant in enumerate(asked)
        if variant.compiling == "no" and not np.isfinite(seconds[k])
    ]
    if left:
        words += (
            f" Left out, with their first solves of {len(scenes[0][0].solve)} targets each: "
            f"{'; '.join(left)}."
        )
    return Table("planner-together", caption, columns, rows), words, choice


def _table(
    name: str,
    targets: list[Pose],
    asked: list[Variant],
    found: list[Measured],
    figures: Array,
    best: list[bool],
) -> Table:
    rows: list[list[Cell]] = []
    for variant, one, (_, _, cost), star in zip(asked, found, figures, best, strict=True):
        errors = [scaled(e) for e in (one.exact, one.sent, one.final)]
        rows.append(
            [
                ("★ " if star else "") + variant.words,
                variant.solver,
                "yes" if variant.compiling == "wait" else "no",
                one.solved,
                *(_share(errors[0], q) for q in (50, 95)),
                *(_share(errors[1], q) for q in (50, 95)),
                1e3 * float(np.median(one.solve)),
                float(np.median(one.iterations)),
                _more(cost),
                one.plans,
                _share(errors[2], 100),
                1e3 * float(np.median(one.plan)),
                "; ".join(filter(None, (one.trouble, one.lost))) or None,
            ]
        )
    columns = (
        *("setting", "solver", "compiled", "first solves", "exact, median [mm]"),
        *("exact, 95 % [mm]", "sent, median [mm]", "sent, 95 % [mm]", "solve [ms]"),
        *("iterations", "effort, % above the default's", "plans solved", "final, worst [mm]"),
        *("plan [ms]", "trouble"),
    )
    caption = f"Scene {name}: {len(targets)} targets, one setting changed at a time"
    return Table(f"planner-{name}", caption, columns, rows)


def _share(errors: Array, share: float) -> Cell:
    known = errors[np.isfinite(errors)]
    return 1e3 * float(np.percentile(known, share)) if known.size else None


def _more(cost: float) -> Cell:
    """By how much [%] an effort, as a share of the default's, is higher."""
    return round(100 * (cost - 1), 2) + 0.0 if math.isfinite(cost) else None


def _shares(margins: Sequence[float]) -> str:
    """Shares as percentages in a row."""
    return ", ".join(f"{100 * share:.3g}" for share in margins)


def _words(asked: list[Variant], found: list[Measured], figures: Array, best: list[bool]) -> str:
    """Where the usual settings stand."""
    exact = scaled(found[0].exact)
    better = [
        variant.words
        for variant, point in zip(asked, figures, strict=True)
        if variant.compiling == "no" and beats(point, figures[0])
    ]
    where = "is on the Pareto set"
    if not best[0]:
        solves = bool(np.isfinite(figures[0]).all())
        where = f"is beaten by {'; '.join(better)}" if solves else "fails too often"
    return (
        f"The default {where}: {1e3 * float(np.nanmedian(exact)):.2g} mm before correction at "
        f"{figures[0, 0]:.1f} ms a solve, {found[0].plans} of {len(found[0].plan)} plans solved "
        f"with at most {1e3 * float(scaled(found[0].final).max(initial=0.0)):.2g} mm left."
    )


def _picture(name: str, asked: list[Variant], figures: Array, best: list[bool]) -> Picture:
    def draw(path: Path) -> None:
        from .planner_picture import draw_settings

        kinds = [_kind(variant) for variant in asked]
        labels = [variant.words for variant in asked]
        draw_settings(path, figures[:, :2], kinds, labels, best)

    caption = (
        f"Scene {name}: error before correction against solving time, medians; the Pareto set has "
        "the effort as a third figure"
    )
    return Picture(f"planner-{name}", caption, draw)


def _kind(variant: Variant) -> str:
    """The family a variant is drawn in."""
    if variant.compiling == "wait":
        return "compiled"
    if variant.solver == "ipopt":
        return "IPOPT"
    return variant.mesh[0][0] if variant.mesh else "default"
