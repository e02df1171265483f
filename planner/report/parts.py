"""Section "parts": what the NLP of each scene consists of, and what leaving things out saves."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...problems.distribution import Distribution
from ...problems.load import load_scene, scene_names
from ...problems.robust import Robust
from ...problems.scene import Cup, Landing, Scene, Uncertainty, Workspace
from ..compiled import Compile
from ..context import Guard
from ..correction import Search, attempt
from ..derivatives import nlp_functions
from ..guess import guess_from
from ..hardening import hardened
from ..nlp import ThrowNlp
from ..numbers import opening_nodes, parameter_values
from ..plan import Plan, PlannedThrow
from ..planner import Planner
from ..refit import refit
from ..window import window_of
from .import_count import imports_of
from .page import Cell, Effort, Picture, Section, Table

GUARDS: frozenset[Guard] = frozenset({"carry", "flight"})
#: Starting points tried.
STARTS = 6
#: Sections at values that never bind: they cost their rows and variables and change nothing.
WIDE_LANDING = Landing(speed_min=0.01, speed_max=100.0, rate_max=1e3)
WIDE_WORKSPACE = Workspace(floor=-10.0, column_radius=0.01, column_height=0.01)
DELAY = Uncertainty(delay=Distribution(uniform=0.010))
#: The ladder's line with a Panda, before guards.
ARM = 6
#: The goal: this many times faster than with everything.
GOAL = 5.0


@dataclass(frozen=True)
class Posed:
    """A scene, and which rows beyond its sections are forced into its NLP."""

    words: str
    scene: Scene
    guards: frozenset[Guard] = frozenset()
    robust: bool = False


@dataclass(frozen=True)
class Measured:
    """Sizes and times [s] of one posed scene.

    operations: of the functions that the solver calls, all once; functions: their time;
    solve, plan: median of the warm runs; build: before the first. solved: as the check says.
    """

    variables: int
    constraints: int
    parameters: int
    operations: int
    functions: float
    iterations: int
    build: float
    solve: float
    plan: float
    solved: bool

    def row(self) -> list[Cell]:
        """Its figures in a table, times in ms."""
        sizes: list[Cell] = [self.variables, self.constraints, self.parameters, self.operations]
        times = [1e3 * t for t in (self.functions, self.build, self.solve, self.plan)]
        return [*sizes, self.iterations, *times, "solved" if self.solved else "not solved"]


COLUMNS = ("variables", "constraints", "parameters", "operations", "iterations")
TIMES = ("functions [ms]", "build [ms]", "solve [ms]", "plan [ms]", "status")


def operations(nlp: ThrowNlp) -> int:
    """Elementary operations of cost, constraints and their derivatives, all stages once."""
    found = 0
    for link in nlp.links:
        parts = link.functions
        for function in (parts.value, parts.jacobian, parts.cost_gradient, parts.hessian):
            found += int(function.n_instructions())
    return found


def measured(posed: Posed, repeats: int, compiling: Compile = "no") -> Measured:
    """Plans a posed scene once, then `repeats` times more with all that is built."""
    planner = Planner(posed.scene, compiling=compiling)
    planner.releases()
    thrown, first, _ = _thrown(planner, posed)
    runs = [_thrown(planner, posed)[1:] for _ in range(repeats)]
    search = Search(posed.scene, guards=posed.guards)
    target = posed.scene.target
    assert target is not None
    nlp = planner.bench.nlp(target, search) if thrown is None else thrown.nlp
    solve = float(np.median([again.times["solve"] for again, _ in runs]))
    plan = float(np.median([seconds for _, seconds in runs]))
    return Measured(
        *nlp.size,
        nlp.problem["p"].numel(),
        operations(nlp),
        _function_time(planner, nlp, thrown),
        first.iterations,
        first.times["build"],
        solve,
        plan,
        thrown is not None,
    )


def _thrown(planner: Planner, posed: Posed) -> tuple[PlannedThrow | None, Search, float]:
    """The planner's own way to a throw: first without guards, then with, then robust."""
    start = time.perf_counter()
    scene, mover, bench = posed.scene, planner.mover, planner.bench
    target = scene.target
    assert target is not None
    search = Search(scene)
    releases = planner.releases()
    flights = releases.landings(target.z, scene.gravity)[2]
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    found: PlannedThrow | None = None
    for index, goal, _ in planner.starts(target, STARTS):
        search.guards = frozenset()
        nlp = bench.nlp(goal, search)
        guess = guess_from(nlp, scene, mover, releases, index, float(flights[index]))
        found = attempt(bench.problem(goal, "fatrop", search), mover, goal, guess, search)
        source = found or search.broken
        if posed.guards and source is not None:
            search.guards = posed.guards
            guess = refit(bench.nlp(goal, search), source, nodes, 0.0, np.zeros(0))
            found = attempt(bench.problem(goal, "fatrop", search), mover, goal, guess, search)
        if found is not None:
            break
    if found is not None and posed.robust:
        plan = Plan(scene, mover, target, "solved", "", found)
        better = hardened(bench, [plan], "scenarios", ("fatrop", "ipopt"), search)
        found = None if better is None else better[1].thrown
    return found, search, time.perf_counter() - start


def _function_time(planner: Planner, nlp: ThrowNlp, thrown: PlannedThrow | None) -> float:
    """Time [s] of all functions that an iteration of FATROP calls, at the solution."""
    if thrown is None or thrown.scene.target is None:
        return math.nan
    scene = thrown.scene
    window = window_of(scene) if nlp.structure.robust else None
    goal = thrown.scene.target
    values = parameter_values(scene, planner.mover, goal, window)
    p, x, lam = nlp.parameters.vector(values), thrown.solution.x, thrown.solution.lam_g
    found = nlp_functions(nlp, "fatrop")
    times = []
    for _ in range(10):
        start = time.perf_counter()
        for name in ("nlp_f", "nlp_g", "nlp_grad_f", "nlp_jac_g"):
            found[name](x, p)
        found["nlp_hess_l"](x, p, 1.0, lam)
        times.append(time.perf_counter() - start)
    return float(np.median(times))


# The same throw with more and more in it.


def with_angle(scene: Scene) -> Scene:
    """The scene asked for the angle at which it lands anyway."""
    assert scene.target is not None
    if scene.target.theta is not None:
        return scene
    plan = Planner(scene, compiling="no").plan()
    if plan.throw is None:
        return scene
    theta = plan.throw.final.landing.theta
    return scene.replace(target=dataclasses.replace(scene.target, theta=theta))


def with_cup(scene: Scene) -> Scene:
    """A cup so far below and so wide that the bar falls in anyhow."""
    target = scene.target
    assert target is not None
    if scene.cup is not None:
        return scene
    rim = target.z - 0.1 - scene.object.length
    return scene.replace(cup=Cup(x=target.plane_x, rim=rim, radius=50.0, depth=0.1))


def with_workspace(scene: Scene) -> Scene:
    """A floor, a base column and, for an arm, a palm that are never touched."""
    if scene.workspace is not None:
        return scene
    palm = None if scene.robot is None else 0.0
    return scene.replace(workspace=dataclasses.replace(WIDE_WORKSPACE, palm_clearance=palm))


def with_arm(scene: Scene) -> Scene:
    """A Panda in place of a free hand: its own angle at landing, the bar held at its end.

    What stuck out behind the grasp would be in the Panda's hand.
    """
    if scene.robot is not None or scene.target is None:
        return scene
    arm = load_scene("box")
    target = dataclasses.replace(scene.target, theta=None)
    grasp = dataclasses.replace(scene.grasp, offset=0.0)
    bare = scene.replace(hand=None, robot=arm.robot, arm=arm.arm, grasp=grasp)
    return bare.replace(target=target, cup=None, workspace=None)


def with_uncertainty(scene: Scene) -> Scene:
    """An opening up to 10 ms early or late, and a plan against that."""
    uncertainty = scene.uncertainty or DELAY
    return scene.replace(uncertainty=uncertainty, robust=Robust("scenarios"))


def with_everything(scene: Scene) -> Posed:
    """The same throw with everything that an NLP can have; a free hand becomes a Panda."""
    changes: tuple[Callable[[Scene], Scene], ...]
    changes = (with_arm, with_angle, with_cup, with_workspace, with_uncertainty)
    scene = scene.replace(landing=scene.landing or WIDE_LANDING)
    for change in changes:
        scene = change(scene)
    return Posed("everything", scene, GUARDS, robust=True)


def ladder(scene: Scene) -> Iterator[Posed]:
    """A position-only throw of a free hand, and one thing more at a time."""
    yield Posed("as it is", scene)
    beside = dataclasses.replace(scene.grasp, offset=0.8 * scene.object.com)
    scene = scene.replace(grasp=beside)
    yield Posed("+ held beside the CoM: it pivots", scene)
    scene = with_angle(scene)
    yield Posed("+ θ asked for", scene)
    scene = scene.replace(landing=WIDE_LANDING)
    yield Posed("+ landing bounds", scene)
    scene = with_cup(scene)
    yield Posed("+ cup", scene)
    scene = with_workspace(scene)
    yield Posed("+ floor and column", scene)
    scene = with_workspace(with_cup(with_angle(with_arm(scene))))
    yield Posed("+ Panda for the hand, held at the end", scene)
    yield Posed("+ all guards", scene, GUARDS)
    yield Posed("+ four other openings", with_uncertainty(scene), GUARDS, robust=True)


# The section.


def make(effort: Effort) -> Section:
    """What scenes leave out."""
    section = Section("parts", "What a scene leaves out")
    names = [name for name in scene_names() if load_scene(name).motion is None]
    chosen = ["hand-box", "cup"] if effort.quick else names
    rungs = list(ladder(load_scene("hand-box")))
    # Compiling the last lines takes minutes.
    compiled = [] if effort.quick else [rungs[0], rungs[ARM]]
    # A quick look leaves out what takes a quarter of a minute to build for each scene.
    whole = [] if effort.quick else chosen
    fresh = [] if effort.quick else ["hand-box", "cup"]
    total = len(rungs) + len(compiled) + 2 * len(chosen) + len(whole) + len(fresh)
    steps = iter(range(1, total + 1))

    def next_of(posed: Posed, compiling: Compile = "no") -> Measured:
        # Everything takes longer: fewer runs of it.
        repeats = effort.of(1, 3) if posed.robust else effort.of(3, 9)
        found = measured(posed, repeats, compiling)
        effort.tell(next(steps), total)
        return found

    climbed = [next_of(posed) for posed in rungs]
    section.add(*_ladder_parts(rungs, climbed))
    if compiled:
        machine = [next_of(posed, "wait") for posed in compiled]
        section.add(_compiled_table(compiled, machine, [climbed[0], climbed[ARM]]))
    rows: list[list[Cell]] = []
    imported: list[list[Cell]] = []
    savings: dict[str, float] = {}
    for name in chosen:
        own = next_of(Posed(name, load_scene(name)))
        rows.append([name, "as it is", *own.row(), None])
        if name in whole:
            everything = next_of(with_everything(load_scene(name)))
            savings[name] = everything.solve / own.solve
            rows.append([name, "everything", *everything.row(), savings[name]])
        imported.append([name, "as it is", *_imports(load_scene(name))])
        effort.tell(next(steps), total)
        if name in fresh:
            imported.append(
                [name, "everything", *_imports(with_everything(load_scene(name)).scene)]
            )
            effort.tell(next(steps), total)
    section.add(*_scene_parts(rows, imported, savings))
    return section


def _imports(scene: Scene) -> list[Cell]:
    """A fresh process that plans the scene."""
    found = imports_of(scene)
    return [found.modules, ", ".join(found.heavy), found.seconds, found.status]


def _ladder_parts(rungs: list[Posed], found: list[Measured]) -> list[str | Table | Picture]:
    first, last = found[0], found[-1]
    rows: list[list[Cell]] = []
    for posed, one in zip(rungs, found, strict=True):
        rows.append([posed.words, *one.row(), one.solve / first.solve])
    saving = last.solve / first.solve
    by_hand = [one for posed, one in zip(rungs, found, strict=True) if posed.scene.robot is None]
    alone = by_hand[-1].solve / first.solve
    verdict = "reached" if saving >= GOAL and first.solved and last.solved else "not reached"
    words = (
        "`hand-box`, a throw of a free hand to a position, held at the CoM: no robot, no θ, no "
        "cup, no uncertainty. One thing more is put in at a time; cup, floor, column and landing "
        "bounds are so wide that they never bind, θ is the one at which the throw lands anyway, "
        "guards are the rows that a plan gets only when a check asks for them, and the last line "
        "throws four other openings too. As in the planner, a throw without guards comes first and "
        "starts the one with them, and that one the robust one; all of it counts. As "
        f"it is it solves in {1e3 * first.solve:.1f} ms, with everything in "
        f"{1e3 * last.solve:.0f} ms: {saving:.0f} times as long; the goal, {GOAL:g} times, is "
        f"{verdict}. All that the free hand itself can carry makes {alone:.1f} times; the Panda, "
        "whose throw is another one, the guards and the openings make the rest. The functions of "
        f"one iteration alone take "
        f"{last.functions / first.functions:.0f} times as long. Nothing is compiled here; solve "
        "is the solver's time with all corrections, plan is guess, solve, smoothing and check."
    )
    columns = ("hand-box", *COLUMNS, *TIMES, "solve ×")
    caption = "One thing more at a time"
    picture = Picture(
        "parts_ladder",
        "Operations of one iteration's functions and time to solve, one thing more at a time",
        lambda path: _draw(rungs, found, path),
    )
    return [words, Table("parts_ladder", caption, columns, rows), picture]


def _compiled_table(posed: list[Posed], found: list[Measured], plain: list[Measured]) -> Table:
    """Some lines again, as machine code, beside the same not compiled."""
    rows: list[list[Cell]] = []
    for one, compiled, other in zip(posed, found, plain, strict=True):
        times = [1e3 * t for t in (other.solve, compiled.solve, compiled.build)]
        rows.append([one.words, *times, other.solve / compiled.solve])
    ratios = [some[-1].solve / some[0].solve for some in (plain, found)]
    rows.append(["last over first", *ratios, None, None])
    columns = ("hand-box", "solve [ms]", "solve, compiled [ms]", "build with compiling [ms]")
    caption = "Two of these lines with compiled functions (what is in the cache is used)"
    return Table("parts_compiled", caption, (*columns, "compiled ×"), rows)


def _scene_parts(
    rows: list[list[Cell]], imported: list[list[Cell]], savings: dict[str, float]
) -> list[str | Table]:
    counts = sorted(int(row[2] or 0) for row in imported)
    words = f"A fresh process that plans imports {counts[0]} to {counts[-1]} modules."
    if savings:
        least, most = min(savings, key=savings.__getitem__), max(savings, key=savings.__getitem__)
        words = (
            "Every built-in scene beside the same throw with everything: what it has keeps its "
            "values, what it lacks is added as above, guards and four other openings too; a "
            "free hand becomes a Panda that lands at its own angle. Everything takes between "
            f"{savings[least]:.1f} (`{least}`) and {savings[most]:.0f} times (`{most}`) as long "
            f"to solve. {words}"
        )
    columns = ("scene", "NLP", *COLUMNS, *TIMES, "solve ×")
    more = ("scene", "planned", "modules", "heavy ones", "process [s]", "status")
    return [
        words,
        Table("parts_scenes", "Sizes and times, nothing compiled", columns, rows),
        Table("parts_imports", "Imports of a fresh process that plans", more, imported),
    ]


def _draw(rungs: list[Posed], found: list[Measured], path: Path) -> None:
    """Two bar charts side by side."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from ..sweep_pictures import BLUE, GREEN

    figure, axes = plt.subplots(1, 2, figsize=(11, 4), sharey=True, constrained_layout=True)
    kinds: tuple[tuple[str, str, list[float], str], ...] = (
        (
            "operations of one iteration's functions",
            BLUE,
            [float(m.operations) for m in found],
            "{:.0f}",
        ),
        ("solve [ms], nothing compiled", GREEN, [1e3 * m.solve for m in found], "{:.1f}"),
    )
    for axis, (label, colour, values, form) in zip(axes, kinds, strict=True):
        bars = axis.barh([posed.words for posed in rungs], values, color=colour)
        axis.bar_label(bars, [form.format(v) for v in values], padding=3, fontsize=8)
        axis.set(xscale="log", xlabel=label, xlim=(min(values) / 2, 4 * max(values)))
        axis.grid(axis="x", alpha=0.3)
    axes[0].invert_yaxis()
    figure.savefig(path, dpi=120)
    plt.close(figure)
