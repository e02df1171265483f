"""The section "parts": what a scene leaves out is not there, and that saves time."""

from __future__ import annotations

import pytest
from throwplan.planner.report.import_count import imports_of
from throwplan.planner.report.parts import (
    ARM,
    GUARDS,
    Measured,
    Posed,
    _ladder_parts,
    ladder,
    measured,
    with_everything,
)
from throwplan.problems.load import load_scene

#: (variables, constraints) of `hand-box` with one thing more at a time, without the last line,
#: which takes a quarter of a minute to build.
SIZES = [(155, 177), (187, 209), (187, 210), (187, 213), (191, 233), (191, 285), (275, 393)]


@pytest.fixture(scope="module")
def rungs() -> list[Posed]:
    return list(ladder(load_scene("hand-box")))


@pytest.fixture(scope="module")
def climbed(rungs: list[Posed]) -> list[Measured]:
    return [measured(posed, 2) for posed in rungs[:8]]


def test_each_thing_has_its_size_and_is_solved(climbed: list[Measured]) -> None:
    assert [(one.variables, one.constraints) for one in climbed[:7]] == SIZES
    assert (climbed[7].variables, climbed[7].constraints) == (283, 1223)
    assert all(one.solved for one in climbed)


def test_nothing_is_carried_that_is_not_used(climbed: list[Measured]) -> None:
    operations = [one.operations for one in climbed]
    assert operations == sorted(operations)
    parameters = [one.parameters for one in climbed]
    assert parameters[1:] == sorted(parameters[1:])
    assert operations[7] > 10 * operations[0]


def test_the_line_with_a_panda_is_the_one_with_an_arm(rungs: list[Posed]) -> None:
    assert rungs[ARM].scene.robot is not None and not rungs[ARM].guards
    assert rungs[ARM - 1].scene.robot is None


def test_leaving_out_saves_time(climbed: list[Measured]) -> None:
    """Even without the four other openings, which alone take longer than all the rest."""
    assert climbed[7].solve > 5 * climbed[0].solve
    assert climbed[7].functions > 2 * climbed[0].functions


def test_the_words_say_when_the_goal_is_missed(rungs: list[Posed], climbed: list[Measured]) -> None:
    two = [rungs[0], rungs[7]]
    assert "is reached" in str(_ladder_parts(two, [climbed[0], climbed[7]])[0])
    assert "is not reached" in str(_ladder_parts(two, [climbed[0], climbed[0]])[0])


@pytest.mark.parametrize("name", ["hand-box", "cup"])
def test_everything_has_every_section(name: str) -> None:
    posed = with_everything(load_scene(name))
    scene = posed.scene
    sections = (scene.robot, scene.cup, scene.landing, scene.workspace, scene.uncertainty)
    assert all(section is not None for section in sections)
    assert scene.target is not None and scene.target.theta is not None
    assert posed.guards == GUARDS and posed.robust
    assert scene.robust is not None and scene.robust.method == "scenarios"


def test_imports_of_a_fresh_process() -> None:
    hand, arm = (imports_of(load_scene(name)) for name in ("hand-box", "cup"))
    assert hand.status == arm.status == "solved"
    assert set(hand.heavy) == {"numpy", "casadi"}
    assert set(arm.heavy) == {"numpy", "casadi", "ruckig"}
    assert hand.modules < arm.modules
