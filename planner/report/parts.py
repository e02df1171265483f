"""Section "parts": what the NLP of each scene consists of, and what leaving things out saves."""

from __future__ import annotations

from ...problems import Scene, load_scene, scene_names
from ..compile import Compile
from .import_count import imports_of
from .page import Cell, Effort, Part, Picture, Section, Table
from .part_ladder import ARM, HAND, ladder, with_everything
from .part_sizes import COLUMNS, Measured, Posed, measured
from .parts_picture import draw

#: The goal: this many times faster than with everything.
GOAL = 5.0
#: Of `Measured.over`, and the words that follow.
RATIOS = ("own, over alone", "all, over alone", "status")


def make(effort: Effort) -> Section:
    """What scenes leave out."""
    section = Section("parts", "What a scene leaves out")
    names = [name for name in scene_names() if load_scene(name).motion is None]
    chosen = ["hand-box", "cup"] if effort.quick else names
    rungs = list(ladder(load_scene("hand-box")))
    # A quick look takes only the lines that are compared.
    kept = (0, HAND, ARM, len(rungs) - 1) if effort.quick else range(len(rungs))
    # Compiling the last lines takes minutes.
    compiled = [] if effort.quick else [rungs[0], rungs[ARM]]
    # A quick look leaves out what takes a quarter of a minute to build for each scene.
    whole = [] if effort.quick else chosen
    total = len(kept) + len(compiled) + 2 * len(chosen) + len(whole)
    steps = iter(range(1, total + 1))

    def next_of(posed: Posed, compiling: Compile = "no") -> Measured:
        # Everything takes longer: fewer runs of it.
        repeats = effort.of(1, 3) if posed.robust else effort.of(3, 5)
        found = measured(posed, repeats, compiling)
        effort.tell(next(steps), total)
        return found

    climbed = {i: next_of(rungs[i]) for i in kept}
    robot = _robot_words(climbed)
    section.add(*_goal_parts(climbed), robot, *_ladder_parts(rungs, climbed))
    section.short.append(robot)
    if compiled:
        machine = [next_of(posed, "wait") for posed in compiled]
        section.add(_compiled_table(compiled, machine, [climbed[0], climbed[ARM]]))
    rows: list[list[Cell]] = []
    imported: list[list[Cell]] = []
    for name in chosen:
        own = next_of(Posed(name, load_scene(name)))
        rows.append([name, "as it is", *own.row(), *own.over(own), own.status])
        if name in whole:
            forced = next_of(with_everything(load_scene(name)))
            rows.append([name, "everything", *forced.row(), *forced.over(own), forced.status])
        imported.append([name, *_imports(load_scene(name))])
        effort.tell(next(steps), total)
    section.add(*_scene_parts(rows, imported))
    return section


def _imports(scene: Scene) -> list[Cell]:
    """A fresh process that plans the scene."""
    found = imports_of(scene)
    return [found.modules, ", ".join(found.heavy), found.seconds, found.status]


def _goal_parts(climbed: dict[int, Measured]) -> list[Part]:
    """The goal, and the pairs that are compared: lines of the ladder by their number."""
    first, last = climbed[0], climbed[max(climbed)]
    ratios = [ratio for ratio in last.over(first) if isinstance(ratio, float)]
    reached = bool(ratios) and min(ratios) >= GOAL
    words = (
        f"Goal: a scene without robot, θ, cup or uncertainty solves at least {GOAL:g} times "
        "faster than the one forced to carry everything. It is "
        f"{'reached' if reached else 'not reached'}. The scene is `hand-box`, a free hand that "
        "holds the bar at its CoM and throws it to a position; it is compared with the same "
        "throw carrying more. Own: the solver's time for that NLP with its corrections, "
        "beginning with the throw of the NLP before. All: with the NLPs that lead to it, as "
        "the planner does it. One's own solve may be faster than that of less, when it begins "
        "nearer its solution. What is added never binds, except the pivot, the Panda and the "
        "openings: then the throw is another one. Nothing is compiled."
    )
    pairs = (
        ("alone", first),
        ("(a) free hand with pivot, θ, landing bounds, cup, floor, column", climbed[HAND]),
        ("(b) (a) with the Panda for the hand", climbed[ARM]),
        ("(c) everything: (b), all guards, four other openings", last),
    )
    rows: list[list[Cell]] = []
    for name, one in pairs:
        sizes, times = (one.variables, one.constraints), (1e3 * one.solve, 1e3 * one.whole)
        rows.append([name, *sizes, *times, *one.over(first), one.status])
    columns = ("`hand-box`", "variables", "constraints", "own solve [ms]", "all solves [ms]")
    caption = "What leaving out saves: times to solve over the one alone"
    return [words, Table("parts_goal", caption, (*columns, *RATIOS), rows)]


def _robot_words(climbed: dict[int, Measured]) -> str:
    """What a scene without a robot may expect."""
    bare, hand, arm, last = (climbed[i] for i in (0, HAND, ARM, max(climbed)))
    return (
        f"Without a robot: the same throw with a Panda for the free hand takes "
        f"{arm.whole / hand.whole:.2g} times as long to solve ({1e3 * arm.whole:.0f} and "
        f"{1e3 * hand.whole:.0f} ms); the bare throw to a position takes "
        f"{1e3 * bare.whole:.1f} ms, "
        f"{last.whole / bare.whole:.0f} times less than with all guards and four other openings, "
        "which a usual plan does not carry. Nothing is compiled."
    )


def _ladder_parts(rungs: list[Posed], climbed: dict[int, Measured]) -> list[Part]:
    """The same throw, one thing more at a time."""
    rows: list[list[Cell]] = []
    names = [rungs[i].words for i in climbed]
    found = list(climbed.values())
    for name, one in zip(names, found, strict=True):
        rows.append([name, *one.row(), *one.over(found[0]), one.status])
    words = (
        "One thing more at a time. Operations and functions are those that one iteration calls. "
        "θ is the angle at which the throw lands anyway; guards are rows that a plan gets only "
        "when a check asks for them."
    )
    picture = Picture(
        "parts_ladder",
        "Operations of one iteration's functions, and time to solve, one thing more at a time",
        lambda path: draw(names, found, path),
    )
    columns = ("hand-box", *COLUMNS, *RATIOS)
    return [words, Table("parts_ladder", "One thing more at a time", columns, rows), picture]


def _compiled_table(posed: list[Posed], found: list[Measured], plain: list[Measured]) -> Table:
    """Some lines again, as machine code, beside the same not compiled."""
    rows: list[list[Cell]] = []
    for one, compiled, other in zip(posed, found, plain, strict=True):
        times = [1e3 * t for t in (other.whole, compiled.whole, compiled.build)]
        rows.append([one.words, *times, other.whole / compiled.whole])
    ratios = [some[-1].whole / some[0].whole for some in (plain, found)]
    rows.append(["last over first", *ratios, None, None])
    columns = ("hand-box", "solve [ms]", "solve, compiled [ms]", "build with compiling [ms]")
    caption = "Two of these lines with compiled functions (what is in the cache is used)"
    return Table("parts_compiled", caption, (*columns, "compiled ×"), rows)


def _scene_parts(rows: list[list[Cell]], imported: list[list[Cell]]) -> list[Part]:
    """Every scene beside itself with everything, and what planning it imports."""
    counts = sorted(int(row[1] or 0) for row in imported)
    words = f"A fresh process that plans imports {counts[0]} to {counts[-1]} modules."
    forced = [row for row in rows if row[1] == "everything"]
    if forced:
        words = f"{_forced_words(forced)} {words}"
    columns = ("scene", "NLP", *COLUMNS, *RATIOS)
    more = ("scene", "modules", "heavy ones", "process [s]", "status")
    return [
        words,
        Table("parts_scenes", "Sizes and times, nothing compiled", columns, rows),
        Table("parts_imports", "Imports of a fresh process that plans", more, imported),
    ]


def _forced_words(forced: list[list[Cell]]) -> str:
    """How much longer scenes with everything take, in words."""
    words = (
        "Every built-in scene beside the same throw with everything: what it has keeps its "
        "values, what it lacks is added as above, a free hand becomes a Panda."
    )
    solved = [row for row in forced if row[-2] is not None]
    if solved:
        own, whole = ([float(row[i] or 0.0) for row in solved] for i in (-3, -2))
        words += (
            f" Everything takes {min(own):.1f} to {max(own):.0f} times as long to solve, "
            f"{min(whole):.1f} to {max(whole):.0f} times with the NLPs that lead to it."
        )
    failed = [str(row[0]) for row in forced if row[-2] is None]
    if failed:
        words += f" Not solved with everything: {', '.join(failed)}."
    return words
