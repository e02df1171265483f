"""Several throws to a target, targets from random exact throws, a better model's landing."""

from __future__ import annotations

import dataclasses
import itertools
import math
import time

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.check.violations import Violation
from throwplan.planner.report.reach_study import outcomes, reachable_targets
from throwplan.planner.search.correction import Search
from throwplan.problems import Choice


@pytest.mark.parametrize("name", ["pose", "cup", "box", "hand-flip"])
def test_random_targets_in_reach_are_all_thrown_to(name: str) -> None:
    """Made by exact throws of random motions; the planner's table has no part in them."""
    scene = tp.load_scene(name)
    targets = list(itertools.islice(reachable_targets(scene, seed=42), 8))
    for outcome in outcomes(tp.Planner(scene), targets):
        assert outcome.plan.solved, (outcome.target, outcome.plan.message)
        position, angle = outcome.error
        assert position <= scene.tolerance.position and angle <= scene.tolerance.angle


def test_alternatives_differ_and_all_land() -> None:
    plan = tp.Planner(tp.load_scene("pose")).plan(alternatives=1)
    throws = [plan, *plan.alternatives]
    assert len(throws) == 2 and all(other.solved for other in throws)
    costs = [other.throw.solution.cost for other in throws]
    assert costs == sorted(costs)
    states = [other.throw.planned.at(np.array([other.throw.opening_time])) for other in throws]
    for one, other in itertools.combinations(states, 2):
        assert max(np.abs(a - b).max() for a, b in zip(one[:2], other[:2], strict=True)) > 0.05
    assert len(plan.to_dict()["alternatives"]) == 1


def test_choice_by_robustness_takes_the_throw_that_delays_move_least() -> None:
    scene = tp.load_scene("pose")
    plans = {
        by: tp.plan(scene.replace(choice=Choice(by=by, among=4))) for by in ("effort", "robustness")
    }
    assert all(plan.solved for plan in plans.values())
    spread = {
        by: np.quantile(tp.sweep(plan, samples=128).errors["scaled"], 0.95)
        for by, plan in plans.items()
    }
    assert spread["robustness"] < 0.9 * spread["effort"]


def test_choice_by_time_takes_the_shortest() -> None:
    scene = tp.load_scene("pose")
    plans = {by: tp.plan(scene.replace(choice=Choice(by=by, among=3))) for by in ("effort", "time")}
    assert all(plan.solved for plan in plans.values())
    assert plans["time"].throw.landing_time <= plans["effort"].throw.landing_time + 1e-9
    assert plans["effort"].throw.solution.cost <= plans["time"].throw.solution.cost + 1e-9


@pytest.mark.parametrize("name", ["pose", "hand-flip"])
def test_landing_is_true_for_the_model_that_the_tolerance_names(name: str) -> None:
    scene = tp.load_scene(name)
    truer = dataclasses.replace(scene.tolerance, model="ls-step")
    plan = tp.plan(scene.replace(tolerance=truer))
    assert plan.solved
    dx, dtheta = plan.throw.limit_surface.miss(plan.target)
    assert abs(dx) < 1e-4 and abs(dtheta) < math.radians(0.02)


def test_warm_plans_follow_a_moving_target() -> None:
    planner = tp.Planner(tp.load_scene("pose"))
    plan = planner.plan()
    iterations = plan.iterations
    for k in range(1, 6):
        target = plan.target.in_plane(plan.target.plane_x - 0.003, plan.target.theta + 0.006)
        plan = planner.plan(target, warm=plan)
        assert plan.solved and plan.attempts <= 3, k
        assert plan.iterations < iterations


def test_throws_over_the_robot_itself_are_found() -> None:
    """Backwards, past column and palm: rows of the flight come in when the check asks."""
    plan = tp.Planner(tp.load_scene("box")).plan(tp.Pose(x=-0.386, z=0.1), patience=90.0)
    assert plan.solved
    assert plan.throw.nlp.structure.passing > 0


def test_a_bar_that_only_grazes_the_hand_is_not_held_against_the_column() -> None:
    plan = tp.Planner(tp.load_scene("pose")).plan(tp.Pose(x=0.729, z=0.1, theta=0.632))
    assert plan.solved
    assert plan.throw.nlp.structure.palm > 0 and plan.throw.nlp.structure.passing == 0


def test_what_the_next_problem_has_after_a_throw_that_breaks_something() -> None:
    scene, thrown = tp.load_scene("cup"), object()

    def after(*found: Violation, guards: frozenset[str] = frozenset()) -> Search:
        search = Search(scene, guards=guards)
        search.take_note(thrown, list(found))
        return search

    floor = Violation("floor", "carry", "held", 0.008, True)
    column = Violation("base column", "carry", "held", 0.006, True)
    # Corners cut between nodes: as much room as the deepest asks, and 2 mm; no more rows.
    found = after(floor, column)
    assert found.room.held == pytest.approx(0.010) and not found.guards
    # Through the column, or the arm, which has no rows at first: these come in.
    for other in (
        dataclasses.replace(column, depth=0.12),
        dataclasses.replace(floor, between=False),
    ):
        found = after(other)
        assert found.room.held == 0.0 and found.guards == {"carry"}
        again = after(other, guards=frozenset({"carry"}))
        assert again.room.held == pytest.approx(min(other.depth + 0.002, 0.05))
    palm, passing = Violation("palm", "flight"), Violation("base column", "passing")
    assert after(palm, passing).guards == {"flight", "passing"}
    assert "return" in after(palm, passing, guards=frozenset({"flight", "passing"})).guards
    assert after(passing, guards=frozenset({"passing"})).guards == {"passing"}


def test_what_is_carried_is_looked_at_closer_when_the_check_asks() -> None:
    """The arm itself was below the floor at the start."""
    scene = tp.load_scene("pose")
    plan = tp.Planner(scene).plan(scene.target.in_plane(0.9, 6.0), patience=90.0)
    assert plan.solved and plan.attempts > 2
    assert plan.throw.nlp.structure.instants > 2 and plan.throw.nlp.structure.arm
    assert "floor" in " ".join(plan.throw.nlp.row_names)
    again = tp.Planner(scene)
    moved = again.plan(plan.target, warm=plan, patience=90.0)
    assert moved.solved, "a plan of another planner is no warm start, but no error either"


@pytest.mark.parametrize(("x", "theta"), [(-0.2211, -1.6348), (-0.4001, -1.48)])
def test_a_corner_cut_between_two_nodes_takes_more_room_and_no_more_rows(
    x: float, theta: float
) -> None:
    scene = tp.load_scene("cup")
    plan = tp.Planner(scene).plan(scene.target.in_plane(x, theta), patience=90.0)
    assert plan.solved and plan.solver == "fatrop"
    assert plan.throw.room.held > 0.0 and plan.throw.nlp.structure.instants == 2


@pytest.mark.parametrize(("x", "degrees"), [(0.51, 336.0), (2.15, -59.0), (-1.27, 360.0)])
def test_poses_that_no_cup_takes_are_out_of_reach(x: float, degrees: float) -> None:
    """The cup comes along with the target; lying flat the bar enters none."""
    scene = tp.load_scene("cup")
    plan = tp.Planner(scene).plan(scene.target.in_plane(x, math.radians(degrees)))
    assert plan.status == "out_of_reach"
    assert "cup clearance" in plan.binding or "cup depth" in plan.binding
    assert plan.nearest is not None and abs(plan.nearest.theta - plan.target.theta) > 0.2


def test_a_bar_that_falls_back_onto_the_hand_is_thrown_past_it() -> None:
    """With its middle, late, where the NLP looks only once the check has seen it."""
    plan = tp.Planner(tp.load_scene("pose")).plan(tp.Pose(x=-0.9514, z=0.1, theta=-0.872))
    assert plan.solved
    assert plan.throw.nlp.structure.later > 0


def test_fatrop_is_not_given_a_start_that_it_never_returns_from() -> None:
    """Nearly no torsional friction: one factorisation was repeated for ever."""
    scene = tp.load_scene("box")
    slippery = scene.replace(contact=dataclasses.replace(scene.contact, torsion=1e-3))
    start = time.perf_counter()
    plan = tp.Planner(slippery, compiling="no").plan(tp.Pose(x=0.6931999, z=0.1))
    assert time.perf_counter() - start < 60.0
    assert plan.status in ("solved", "not_converged", "out_of_reach")
    assert plan.solver == "ipopt"


def test_no_attempt_is_begun_after_the_patience_is_over() -> None:
    """An honest answer, and that more time may help; a solved target needs none of it."""
    scene = tp.load_scene("cup")
    planner = tp.Planner(scene, compiling="no")
    planner.plan()
    plan = planner.plan(patience=1e-6)
    assert plan.status == "not_converged" and "patience" in plan.message
    assert plan.attempts == 0
    with pytest.raises(tp.InputError, match="patience = 0: must be above 0"):
        planner.plan(patience=0)
