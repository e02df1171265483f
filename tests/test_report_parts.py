"""The section "parts": what a scene leaves out is not there, and that saves time."""

from __future__ import annotations

import itertools
import math

import pytest
from throwplan.planner.report.import_count import imports_of
from throwplan.planner.report.part_ladder import ARM, GUARDS, HAND, ladder, with_everything
from throwplan.planner.report.part_sizes import Measured, Posed, measured
from throwplan.planner.report.parts import _forced_words, _goal_parts
from throwplan.problems import load_scene


@pytest.fixture(scope="module")
def rungs() -> list[Posed]:
    return list(ladder(load_scene("hand-box")))


@pytest.fixture(scope="module")
def climbed(rungs: list[Posed]) -> list[Measured]:
    """Without the last line, which takes a quarter of a minute to build."""
    return [measured(posed, 2) for posed in rungs[:8]]


def test_each_thing_adds_its_own_and_is_solved(rungs: list[Posed], climbed: list[Measured]) -> None:
    """(variables, constraints): a pivot has an angle and a rate at each node of the opening."""
    assert all(one.solved for one in climbed)
    sizes = [(one.variables, one.constraints) for one in climbed]
    added = [(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(sizes)]
    mesh = rungs[0].scene.mesh
    pivot, angle, landing, cup, workspace = added[:HAND]
    assert pivot[0] == pivot[1] and 2 * mesh.opening <= pivot[0] <= 4 * mesh.opening
    assert angle == (0, 1)
    assert landing == (0, 3)
    # A time and its equation for the rim and each depth in the cup, and the walls.
    assert cup[0] == 4 + 1 and cup[1] > 4 + 1
    # Floor and column for the bar's ends at every node.
    assert workspace[0] == 0 and workspace[1] >= 2 * mesh.carry


def test_nothing_is_carried_that_is_not_used(climbed: list[Measured]) -> None:
    operations = [one.operations for one in climbed]
    assert operations == sorted(operations)
    parameters = [one.parameters for one in climbed]
    assert parameters[1:] == sorted(parameters[1:])
    assert operations[7] > 10 * operations[0]


def test_the_lines_compared_are_what_they_are_called(rungs: list[Posed]) -> None:
    hand, arm = rungs[HAND].scene, rungs[ARM].scene
    assert hand.robot is None and hand.workspace is not None and hand.cup is not None
    assert arm.robot is not None and not rungs[ARM].guards
    assert rungs[-1].robust and rungs[-1].guards == GUARDS


def test_leaving_out_saves_time(climbed: list[Measured]) -> None:
    """Even without the four other openings, which alone take longer than all the rest."""
    own, whole = climbed[7].over(climbed[0])
    assert isinstance(own, float) and own > 4
    assert isinstance(whole, float) and whole > own
    assert climbed[7].functions > 2 * climbed[0].functions


def of(solve: float, whole: float, cause: str = "") -> Measured:
    return Measured(9, 9, 9, 9, 0.1, 9, 0.1, solve, whole, cause)


@pytest.mark.parametrize(
    ("last", "reached"),
    [
        (of(5.1, 9.0), True),
        (of(4.9, 9.0), False),
        (of(9.0, 4.9), False),
        (of(9.0, 9.0, "slip"), False),
        (of(math.nan, math.nan, "slip"), False),
    ],
)
def test_the_words_say_whether_the_goal_is_reached(last: Measured, reached: bool) -> None:
    words, table = _goal_parts(dict.fromkeys(range(8), of(1.0, 1.0)) | {8: last})
    assert ("is reached" in str(words)) == reached and ("is not reached" in str(words)) != reached
    row = table.rows[-1]  # type: ignore[union-attr]
    assert row[-1] == ("solved" if not last.cause else "not solved: slip")
    assert (row[-2] is None) == bool(last.cause)


def test_what_fails_with_everything_keeps_its_row_and_is_named() -> None:
    rows = [["box", "everything", 2.0, 30.0, "solved"], ["flip", "everything", None, None, "no"]]
    words = _forced_words(rows)
    assert "Not solved with everything: flip." in words and "2.0 to 2 times" in words


def test_a_scene_out_of_reach_says_why() -> None:
    scene = load_scene("hand-box")
    assert scene.target is not None
    found = measured(Posed("far", scene.replace(target=scene.target.in_plane(9.0, None))), 1)
    assert not found.solved and found.status.startswith("not solved: ")
    assert found.variables > 0 and found.over(found) == [None, None]


@pytest.mark.parametrize("name", ["hand-box", "cup"])
def test_everything_has_every_section(name: str) -> None:
    posed = with_everything(load_scene(name))
    scene = posed.scene
    sections = (scene.robot, scene.cup, scene.landing, scene.workspace, scene.uncertainty)
    assert all(section is not None for section in sections)
    assert scene.target is not None and scene.target.theta is not None
    assert posed.steps[-1] == (GUARDS, "scenarios")
    assert scene.robust is not None and scene.robust.method == "scenarios"


def test_imports_of_a_fresh_process() -> None:
    hand, arm = (imports_of(load_scene(name)) for name in ("hand-box", "cup"))
    assert hand.status == arm.status == "solved"
    assert set(hand.heavy) == {"numpy", "casadi"}
    assert set(arm.heavy) == {"numpy", "casadi", "ruckig"}
    assert hand.modules < arm.modules
