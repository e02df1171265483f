"""Fails if what a script adds is left out of the NLP or the verdict, or is taken when wrong."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
import throwplan as tp
from throwplan.models import SlidingPivot

#: Height [m] that the flight of `pose` exceeds if nothing forbids it.
CEILING = 0.9


def top(throw: Any) -> float:
    """The top of a flight [m], from samples of it."""
    law, start = throw.scene.flight, throw.deciding.landing.start
    return float(law.after(start, np.linspace(0.0, 1.0, 2001)).z.max())


def planned(**options: Any) -> tp.Plan:
    return tp.Planner("hand-box", library=False, **options).plan()


def ceiling(**options: Any) -> tp.Constraint:
    return tp.Constraint(
        "ceiling", in_flight=lambda flight: flight.ocp.flight.apex(flight.start).z, **options
    )


def test_a_constraint_of_one_s_own_is_kept_and_checked(plan_of) -> None:
    assert top(plan_of("pose").throw.deciding) > CEILING + 0.1
    own = ceiling(high=CEILING, margin=0.005, check=top)
    plan = tp.Planner("pose", constraints=[own]).plan()
    assert plan.solved and top(plan.throw.deciding) <= CEILING
    path, detach = plan.path(), plan.to_dict()["release"]["detach_time"]
    assert path.poses[path.times >= detach, 1].max() <= CEILING
    assert "ceiling" not in plan.summary()
    assert tp.sweep(plan, samples=8).to_dict()["not_checked"] == ["ceiling"]


def test_a_throw_that_breaks_its_check_is_no_answer() -> None:
    """Where the expression for the NLP says something else; the check's constraint is named."""
    wrong = tp.Constraint("tall", in_flight=lambda f: f.start.x, high=9.0, check=lambda _: 10.0)
    plan = tp.Planner("hand-box", constraints=[wrong]).plan(patience=5.0)
    assert not plan.solved and "tall" in plan.summary()


def test_a_constraint_on_the_hand_is_kept_at_every_instant() -> None:
    """The hand of `hand-box` stays on one side of a plane."""
    free = tp.Planner("hand-box").plan()
    bound = float(free.path().hand[:, 0].max()) - 0.02
    inside = tp.Constraint("side", at_instant=lambda at: at.hand[0][0], high=bound, margin=1e-3)
    kept = tp.Planner("hand-box", constraints=[inside]).plan()
    times, opening = kept.path().times, kept.to_dict()["release"]["detach_time"]
    assert kept.solved and kept.path().hand[times <= opening, 0].max() <= bound


def test_options_reach_the_solver() -> None:
    """With one iteration no solve succeeds."""
    assert planned(solver_options={"tol": 1e-9}).solved
    assert not planned(solver_options={"max_iter": 1}).solved


class Damped(SlidingPivot):
    """A sliding pivot whose turning in the pads is damped"""

    def rates(self, state: Any, hand: Any, normal_force: Any) -> list[Any]:
        found = super().rates(state, hand, normal_force)
        return [*found[:5], found[5] - 5.0 * state[5]]


class Undamped(SlidingPivot):
    """The sliding pivot under another name"""


def test_a_law_of_one_s_own_throws_as_the_core_does_where_it_is_the_same() -> None:
    """By Runge-Kutta steps across the onsets of pivot and slide."""
    own, core = tp.simulate("drop", Undamped)["Undamped"], tp.simulate("drop", "sp")["sp"]
    np.testing.assert_allclose(own.release.end, core.release.end, atol=1e-4)
    assert own.to_dict()["status"] == "ok"
    damped = tp.simulate("drop", Damped)["Damped"].release
    assert abs(damped.end[5]) < 0.99 * abs(core.release.end[5])


def test_a_law_of_one_s_own_decides(tmp_path) -> None:
    """It is in the NLP and throws what is sent; batches throw as single throws do."""
    plan = tp.Planner("hand-box", release=Damped).plan()
    assert plan.solved and "solved by Damped" in plan.summary()
    answer = plan.to_dict()
    assert answer["decides"] == "own" and answer["error"]["own"]["position"] < 2e-4
    swept = tp.sweep(plan, samples=16).to_dict()
    assert swept["model"] == "Damped"
    landed = answer["landing"]["own"]
    assert swept["nominal"] == pytest.approx({k: landed[k] for k in ("x", "theta")}, abs=1e-6)
    # Without the law its files are not read.
    plan.save(tmp_path)
    with pytest.raises(tp.InputError, match="release law Damped"):
        tp.read_plan(tmp_path)


def test_a_constraint_is_kept_by_copies_and_moved_throws(tmp_path) -> None:
    """A copy fits its planner; without a check no throw is moved past the NLP."""
    own = ceiling(high=0.8143)
    planner = tp.Planner("hand-box", constraints=[own])
    plan = planner.plan()
    again = planner.plan(plan.target.changed(x=1.12), warm=copy.deepcopy(plan))
    assert again.solved and again.solver == "fatrop" and "not checked: ceiling" in plan.summary()
    assert planner.scene.fits(copy.deepcopy(plan).scene)
    plan.save(tmp_path)
    assert "not checked again: ceiling" in tp.read_plan(tmp_path).message
    with pytest.raises(tp.InputError, match="prepare"):
        planner.prepare(10)


class Short(SlidingPivot):
    def rates(self, state: Any, hand: Any, normal_force: Any) -> list[Any]:
        return [0.0]


def test_a_flight_begins_at_the_detach_of_the_sent_throw() -> None:
    """In a quiet plan too, where the NLP holds the object for longer."""
    place, time = 0.2, 0.75
    own = [
        tp.Constraint("time", in_flight=lambda f: f.time, low=time, high=time),
        tp.Constraint("place", in_flight=lambda f: f.start.x, low=place, high=place),
    ]
    plan = tp.Planner("hand-flip", constraints=own).plan()
    flown = plan.sent_throw().landing
    assert (flown.flight_time, flown.start.x) == pytest.approx((time, place), abs=1e-3)


class Loose(SlidingPivot):
    """A law under which nothing holds the object"""

    def rates(self, state: Any, hand: Any, normal_force: Any) -> list[Any]:
        return [state[3], state[4], state[5], 0.0 * state[0] + 500.0, -9.81 + 0 * state[0], 0.0]


def test_an_object_that_leaves_the_pads_too_early_is_not_trusted() -> None:
    """By a law of one's own as by the core."""
    assert tp.simulate("drop", Loose)["Loose"].to_dict()["status"] != "ok"


def constrained(expression: Any) -> tp.Plan:
    """A plan with a constraint of one's own by an expression."""
    own = tp.Constraint("a", in_flight=lambda _: expression, high=1.0)
    return planned(constraints=[own])


#: What makes or uses an extension that is none, and words of the message.
WRONG = [
    (lambda: tp.Constraint("", in_flight=top, high=1.0), "constraint name"),
    (lambda: tp.Constraint("a", high=1.0), "in_flight"),
    (ceiling, "low = -inf"),
    (lambda: ceiling(low=1.0, high=0.5), "high = 0.5"),
    (lambda: ceiling(high=math.nan), "high = nan"),
    (lambda: ceiling(high=1.0, margin=-1.0), "margin = -1"),
    (lambda: tp.Planner("hand-box", constraints=["a"]), "constraints = 'a'"),
    (lambda: planned(solver_options={"no_such": 1}), "solver_options: no_such = 1"),
    (lambda: constrained("x"), "constraint a"),
    (lambda: constrained(math.nan), "constraint a: must be a CasADi expression"),
    (lambda: planned(constraints=[ceiling(high=9.0, check=lambda _: "q")]), "its check"),
    (lambda: planned(release=Short), "six finite numbers"),
    (lambda: planned(release="sp"), "release = "),
]


@pytest.mark.parametrize(("make", "words"), WRONG)
def test_wrong_extensions_are_refused(make, words) -> None:
    with pytest.raises(tp.InputError, match=rf"^[^\n]*{words}[^\n]*$"):
        make()
