"""The section "stability": what it calls true is, and it finds what is not."""

from __future__ import annotations

import collections
import dataclasses
import math
import os
import time

import numpy as np
import pytest
import throwplan as tp
from throwplan.models import FlightState, time_to_height
from throwplan.planner.check.check import throw
from throwplan.planner.check.mover import make_mover
from throwplan.planner.ocp.numbers import bounds
from throwplan.planner.report import derivative_check, judge
from throwplan.planner.report.conditioning import condition, kkt_matrix
from throwplan.planner.report.derivative_check import derivative_errors, structures
from throwplan.planner.report.extreme_runs import Outcome, outcomes, run
from throwplan.planner.report.extreme_scenes import cases, some
from throwplan.planner.report.in_turn import in_turn, shared
from throwplan.planner.report.judge import grip_by_differences, judged, time_down
from throwplan.planner.report.noisy_guesses import from_noisy_guess
from throwplan.planner.report.other_units import in_other_units, unit_rows
from throwplan.planner.report.page import Effort
from throwplan.planner.report.stability import _extremes
from throwplan.planner.result.plan import PlannedThrow
from throwplan.problems import load_scene


@pytest.fixture(scope="module")
def plans() -> dict[str, tp.Plan]:
    return {name: tp.plan(name) for name in ("hand-flip", "cup")}


def thrown_of(plan: tp.Plan) -> PlannedThrow:
    assert plan.throw is not None
    return plan.throw


def test_there_are_over_300_cases_that_differ() -> None:
    found = cases()
    assert len(found) >= 300
    assert len({case.name for case in found}) == len(found)
    robots = collections.Counter(case.scene.robot is not None for case in found)
    assert robots[True] >= 60 and robots[False] >= 200
    levers = {case.lever for case in found}
    for lever in ("mass", "friction", "patch radius", "grip force", "opening", "gravity"):
        assert lever in levers
    h = np.array([case.scene.com_offset for case in found])
    assert (h == 0).sum() > 20 and h.max() >= 0.5
    assert [case.name for case in cases()] == [case.name for case in found]


def test_a_few_extreme_cases_are_finite_true_or_say_why() -> None:
    chosen = [case for case in some(40) if case.scene.robot is None][::5]
    found = [run(case) for case in chosen]
    assert all(outcome.finite and not outcome.false for outcome in found)
    assert {outcome.status for outcome in found} <= {
        "solved",
        "out_of_reach",
        "not_converged",
        "refused",
    }
    assert sum(outcome.status == "solved" for outcome in found) >= len(found) // 2
    for outcome in found:
        if outcome.status == "solved":
            assert math.isfinite(outcome.scaled) and outcome.scaled < outcome.raw
        else:
            assert outcome.cause


@pytest.mark.parametrize("name", ["hand-flip", "cup"])
def test_a_true_plan_is_found_true_by_other_means(name: str, plans) -> None:
    verdict = judged(thrown_of(plans[name]), plans[name].target)
    allowed = plans[name].scene.tolerance.position
    assert verdict.wrong == ()
    assert verdict.doubt < judge.SETTLED * allowed
    assert abs(verdict.miss - verdict.other) < verdict.doubt + 1e-5


def test_tampered_plans_are_found_false(plans) -> None:
    """A later opening, a faster joint, a weaker grip, another target: each is noticed."""
    plan = plans["cup"]
    good = thrown_of(plan)
    late = dataclasses.replace(good, opening_time=good.opening_time + 0.005)
    words = " ".join(judged(late, plan.target).wrong)
    assert "thrown again" in words and "plain steps" in words
    samples = dataclasses.replace(good.samples, dq=3 * good.samples.dq)
    fast = dataclasses.replace(good, samples=samples)
    assert any("velocity" in wrong for wrong in judged(fast, plan.target).wrong)
    weak_grip = dataclasses.replace(plan.scene.gripper, force=40.0)
    weak = dataclasses.replace(good, scene=plan.scene.replace(gripper=weak_grip))
    assert any("grip use" in wrong for wrong in judged(weak, plan.target).wrong)
    beside = dataclasses.replace(plan.target, x=plan.target.x + 0.0025)
    assert judged(good, beside).wrong


def test_the_independent_release_alone_notices(plans, monkeypatch) -> None:
    """Where the planner's own check is silent, the plain steps speak."""
    plan = plans["hand-flip"]
    good = thrown_of(plan)

    def silent(scene, mover, motion, at, height):
        return throw(scene, mover, motion, good.opening_time, height)

    monkeypatch.setattr(judge, "throw", silent)
    late = dataclasses.replace(good, opening_time=good.opening_time + 0.002)
    wrong = judged(late, plan.target).wrong
    assert wrong and all("plain steps" in words for words in wrong)


@pytest.mark.parametrize(
    ("moves", "false", "doubted", "runs"),
    [
        # Settled at once, true or not.
        ((1e-5,) * 9, False, False, 3),
        ((2e-3,) * 9, True, False, 3),
        # Far off as long as the steps are too long.
        ((8e-3, -8e-3, 1.6e-2, 1e-5, 1e-5, 1e-5), False, False, 6),
        ((8e-3, -8e-3, 1.6e-2, 2e-3, 2e-3, 2e-3), True, False, 6),
        # Never settled: no word against the plan, but none for it.
        ((8e-3, -8e-3) * 5, False, True, 3 + judge.DOUBLINGS),
    ],
)
def test_the_plain_steps_are_doubled_until_they_settle(
    plans, monkeypatch, moves, false, doubted, runs
) -> None:
    plan, left = plans["hand-flip"], list(moves)
    monkeypatch.setattr(judge, "_landed", lambda *_: (left.pop(0), 0.0))
    verdict = judged(thrown_of(plan), plan.target)
    assert bool(verdict.wrong) == false and len(moves) - len(left) == runs
    found = Outcome(dataclasses.replace(cases()[0], scene=plan.scene), "solved", verdict=verdict)
    assert found.undecided == doubted
    if doubted:
        assert "do not settle" in str(_extremes([found])[0])


def test_grip_by_differences_agrees_with_the_contact_equations(plans) -> None:
    for plan in plans.values():
        found = thrown_of(plan)
        motion = found.planned if found.sent is None else found.samples
        use = grip_by_differences(found.scene, found.mover, motion, found.opening_time)
        counted = found.exact if found.sent is None else found.sent
        assert use == pytest.approx(counted.grip_use, rel=0.02)


@pytest.mark.parametrize("gravity", [0.0, 9.81])
@pytest.mark.parametrize("v_z", [-2.0, 0.0, 3.0])
@pytest.mark.parametrize("height", [0.5, 1.2])
def test_two_formulas_for_the_time_down(gravity: float, v_z: float, height: float) -> None:
    state = FlightState(0.0, 1.0, 0.3, 1.0, v_z, 2.0)
    expected = time_to_height(state, height, gravity)
    assert time_down(state, height, gravity) == pytest.approx(expected, nan_ok=True)


def test_condition_of_known_matrices() -> None:
    assert condition(np.diag([1.0, 1e-8])) == pytest.approx((1e8, 1.0))
    nearly = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-6]])
    raw, scaled = condition(nearly)
    assert raw > 1e6 and scaled > 1e6


def test_kkt_matrix_is_symmetric_and_well_scaled(plans) -> None:
    found = thrown_of(plans["hand-flip"])
    matrix = kkt_matrix(found)
    assert matrix.shape == (sum(found.nlp.size),) * 2
    assert np.array_equal(matrix, matrix.T)
    raw, scaled = condition(matrix)
    assert 1.0 < scaled < 1e7 < raw


def test_derivatives_by_differences_and_a_wrong_one_shows(monkeypatch) -> None:
    scene = load_scene("hand-flip")
    _, nlp, numbers = next(structures(scene, False))
    limits = bounds(nlp, scene, make_mover(scene))
    first, second = derivative_errors(nlp, numbers, limits, 2, 1)
    assert 0 < first < 1e-6 and 0 < second < 1e-6
    right = derivative_check.nlp_functions

    def wrong(nlp, solver):
        found = dict(right(nlp, solver))
        true = found["nlp_jac_g"]
        found["nlp_jac_g"] = lambda x, p: (true(x, p)[0], 1.001 * true(x, p)[1])
        return found

    monkeypatch.setattr(derivative_check, "nlp_functions", wrong)
    assert derivative_errors(nlp, numbers, limits, 1, 1)[0] > 1e-4


def test_other_units_change_nothing() -> None:
    rows = unit_rows("hand-box", Effort(quick=True))
    for _, _, length, pivot, surface, status, landing, _ in rows:
        assert pivot < 1e-12 and surface < 1e-12
        # A tenth of the length makes the tolerance finer than what corrections aim at.
        if length >= 1.0:
            assert status == "solved" and landing < (1e-12 if length == 1.0 else 5e-4)


def test_half_a_change_of_units_changes_the_landing(plans) -> None:
    """The test above can fail: mass without the grip force is another throw."""
    plan = plans["hand-flip"]
    good = thrown_of(plan)
    scene = in_other_units(plan.scene, 3.0).replace(gripper=plan.scene.gripper)
    moved = throw(scene, plan.mover, good.planned, good.opening_time, plan.target.z)
    assert abs(moved.landing.x - good.exact.landing.x) > 1e-3


def test_a_noisy_guess_is_true_or_says_that_it_failed() -> None:
    assert from_noisy_guess("hand-box", 0.1, 0) == ("true", "")
    answer, why = from_noisy_guess("hand-flip", 1.0, 0)
    assert answer in ("true", "failed") and (answer == "true" or why)


def answer_or_end(job: str) -> str:
    """For the process below."""
    if job == "die":
        os._exit(3)
    if job == "sleep":
        time.sleep(60)
    return job


def test_hangs_and_crashes_are_caught_and_the_rest_goes_on() -> None:
    jobs = [(job,) for job in ("one", "die", "two", "sleep", "three")]
    found = list(in_turn(answer_or_end, jobs, 1.0))
    assert found == ["one", "crash", "two", "hang", "three"]


def test_jobs_shared_by_two_processes_keep_their_order() -> None:
    """A hang in one of them holds the other up neither in its work nor by its time."""
    jobs = ["sleep", "one", "two", "die", "three", "four", "five"]
    found = list(shared(answer_or_end, [(job,) for job in jobs], 1.0))
    assert found == ["hang", "one", "two", "crash", "three", "four", "five"]
    assert not list(shared(answer_or_end, [], 1.0))


def test_what_goes_wrong_in_the_sharing_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_process(*_: object) -> None:
        raise OSError("no process left")

    monkeypatch.setattr("throwplan.planner.report.in_turn.in_turn", no_process)
    with pytest.raises(OSError, match="no process left"):
        list(shared(answer_or_end, [("one",)], 1.0))


def test_a_case_that_takes_too_long_is_a_hang() -> None:
    (found,) = outcomes([case for case in cases() if case.base == "pose"][:1], patience=1e-3)
    assert found.status == "hang" and found.cause


def test_false_solved_is_counted_and_named(plans) -> None:
    plan = plans["hand-flip"]
    good = thrown_of(plan)
    late = dataclasses.replace(good, opening_time=good.opening_time + 0.002)
    case = cases()[0]
    bad = Outcome(case, "solved", "late", judged(late, plan.target))
    fine = Outcome(case, "solved", "", judged(good, plan.target))
    odd = Outcome(case, "solved", "", judged(good, plan.target), finite=False)
    parts = _extremes([bad, fine, odd])
    assert "2 are judged true, 1 not true" in str(parts[0]) and "not finite: 1." in str(parts[0])
    assert any("FALSE solved" in row for part in parts for row in getattr(part, "rows", []))
