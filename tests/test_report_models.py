"""Section `models` of the report: its errors are the models', and nothing is left out."""

from __future__ import annotations

import math
from functools import cache, partial

import numpy as np
import pytest
from throwplan.models import ImplicitRelease, KarnoppRelease, Release, SlidingPivotRelease
from throwplan.planner.report.model_choice import choice
from throwplan.planner.report.model_measures import Measured, Row, least_time, marked
from throwplan.planner.report.model_rows import rows_table
from throwplan.planner.report.model_runs import (
    Method,
    SmoothedRelease,
    extrapolated,
    methods,
    patched,
    python_loop,
    stepped,
)
from throwplan.planner.report.model_throws import Throw, detached, four_throws, off, throws_table
from throwplan.planner.report.model_truths import patch_truth, pivot_truth, surface_truth
from throwplan.planner.report.pareto import pareto
from throwplan.planner.report.random_throws import HELD, random_throws, throw_number

THROWS = {throw.key: throw for throw in four_throws()}
LAWS = {"sp": pivot_truth, "ls": surface_truth, "patch": patch_truth}


@cache
def truth(key: str, law: str) -> np.ndarray:
    return LAWS[law](THROWS[key].case)


def own(throw: Throw, release: Release, law: str) -> float:
    """Scaled landing error [m] against the converged answer of the law."""
    return float(off(throw, detached(release), truth(throw.key, law))[3])


def slope(steps: list[int], errors: list[float]) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def test_the_throws_are_what_they_are_called() -> None:
    rows = throws_table(four_throws()).rows
    assert [row[0] for row in rows] == [throw.title for throw in four_throws()]
    for throw, row in zip(four_throws(), rows, strict=True):
        assert 0 < row[-1] < HELD  # the full grip holds the object
        hand = throw.case.hand.at(np.zeros(1))
        along = float((hand.twist[:2, 0] * hand.acceleration[:2, 0]).sum())
        wanted = {"drop": 0, "accelerating": 1}.get(throw.key, -1)
        assert np.sign(along) == wanted
    assert THROWS["slow"].case.grip.opening == 0.2


def test_converged_answers_agree_with_other_methods() -> None:
    throw = THROWS["decelerating"]
    located = SlidingPivotRelease(steps=32, events=True).release(throw.case)
    assert own(throw, located, "sp") < 1e-8
    assert own(throw, extrapolated(stepped, 4000, throw.case), "ls") < 2e-6
    assert own(throw, extrapolated(patched, 400, throw.case), "patch") < 1e-4


def test_the_drop_converges_to_the_published_turning_rates() -> None:
    """-1.0 rad/s in the paper; -1.021 and -1.034 rad/s in the reference values."""
    assert truth("drop", "sp")[5] == pytest.approx(-1.0212, abs=1e-4)
    assert truth("drop", "ls")[5] == pytest.approx(-1.0340, abs=1e-3)


def test_orders_of_the_sliding_pivot() -> None:
    throw = THROWS["decelerating"]
    steps = [400, 800, 1600, 3200]
    euler = [SlidingPivotRelease(steps=n, integrator="euler").release(throw.case) for n in steps]
    errors = [own(throw, release, "sp") for release in euler]
    assert slope(steps, errors) == pytest.approx(-1, abs=0.3)
    # Across events Runge-Kutta is of second order, in jumps; steps cut there keep the fourth.
    across = [own(throw, SlidingPivotRelease(steps=n).release(throw.case), "sp") for n in (20, 640)]
    assert slope([20, 640], across) < -1.5
    cut = [
        own(throw, SlidingPivotRelease(steps=n, events=True).release(throw.case), "sp")
        for n in (1, 2, 4, 8)
    ]
    assert slope([1, 2, 4, 8], cut) < -2.5


def test_the_loop_in_python_is_the_compiled_one() -> None:
    for throw in four_throws():
        compiled = SlidingPivotRelease(steps=300, integrator="euler").release(throw.case)
        alone = detached(python_loop(300, throw.case))
        np.testing.assert_allclose(alone, detached(compiled), atol=1e-12)


def test_orders_of_time_stepping() -> None:
    throw, steps = THROWS["drop"], [250, 500, 1000, 2000]
    plain = [own(throw, stepped(n, throw.case), "ls") for n in steps]
    assert slope(steps, plain) == pytest.approx(-1, abs=0.3)
    better = [own(throw, extrapolated(stepped, n, throw.case), "ls") for n in steps]
    assert all(b < a / 3 for a, b in zip(plain, better, strict=True))


def test_rounding_costs_the_square_of_its_width() -> None:
    throw, widths = THROWS["decelerating"], [0.03, 0.01, 3e-3, 1e-3]
    exact = truth(throw.key, "sp")
    errors = [float(off(throw, pivot_truth(throw.case, e), exact)[3]) for e in widths]
    assert slope([round(1e4 * e) for e in widths], errors) == pytest.approx(2, abs=0.3)
    smooth = pivot_truth(throw.case, 0.1)
    steps = [float(off(throw, detached(SmoothedRelease(0.1, n).release(throw.case)), smooth)[3])
             for n in (40, 80, 160, 320)]  # fmt: skip
    # Smooth enough for the whole order, four, or more where terms cancel.
    assert slope([40, 80, 160, 320], steps) < -3.5


@pytest.mark.parametrize("key", THROWS)
def test_laws_are_as_near_to_the_patch_as_is_known(key: str) -> None:
    """Random throws differ by at most 3.2 mm and 5 deg (sp), 0.7 mm and 1.3 deg (ls-step)."""
    throw = THROWS[key]
    for law, most in (("sp", (3.2e-3, math.radians(5.0))), ("ls", (7e-4, math.radians(1.3)))):
        x, theta, _, _ = off(throw, truth(key, law), truth(key, "patch"))
        assert 0 < x < most[0]
        assert 0 < theta < most[1]


def some_rows(throw: Throw) -> list[Row]:
    """A few rows as the report makes them, two of them in trouble."""
    blind = ImplicitRelease(1e-6, rtol=1e-6, samples=2, budget=200)
    ways = [
        Method("sp, RK4", "20 steps", "sp", SlidingPivotRelease(steps=20).release),
        Method("sp, RK4", "160 steps", "sp", SlidingPivotRelease(steps=160).release),
        Method("ls, Karnopp, Euler", "500 steps", "ls", KarnoppRelease(500).release),
        Method("ils, LSODA", "d 1e-06 m/s", "ls", blind.release),
        Method("ls-step", "100 steps", "ls", partial(stepped, 100)),
    ]
    rows = []
    for method in ways:
        seconds, release = least_time(partial(method.run, throw.case), 1, 0.0, 1.0)
        end = detached(release)
        errors = [off(throw, end, truth(throw.key, law)) for law in (method.law, "patch")]
        rows.append(Row(method, seconds, *errors, release.trouble))
    return rows


def test_failed_rows_stay_with_their_cause() -> None:
    throw = THROWS["decelerating"]
    known = {law: np.zeros(4) for law in LAWS}
    rows = marked(some_rows(throw), known)
    one = Measured(throw, {law: truth(throw.key, law) for law in LAWS}, known, rows)
    table = rows_table(one)
    assert len(table.rows) == len(rows)
    cells = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    assert all(cell["time [µs]"] > 0 for cell in cells)
    assert [cell["status"] == "ok" for cell in cells] == [True, True, False, False, True]
    assert "chatter" in cells[2]["status"]
    assert "gave up after 200 evaluations" in cells[3]["status"]
    for cell in cells:
        numbers = [v for v in cell.values() if isinstance(v, float)]
        assert all(math.isfinite(v) for v in numbers)
        # What has no error says why; what failed is not in a Pareto set.
        assert (cell["own x [mm]"] is not None) or cell["status"] != "ok"
        assert cell["status"] == "ok" or cell["Pareto set"] == ""
    told = {row[0]: row for row in choice([one])[0].rows}
    assert told["sp, RK4"][4] == "160 steps"  # 20 steps are 0.4 mm off
    assert told["ils, LSODA"][1] is None
    assert "gave up" in told["ils, LSODA"][-1]


@pytest.mark.parametrize("figures", [2, 3])
def test_pareto_set_by_comparing_all_pairs(figures: int) -> None:
    rng = np.random.default_rng(1)
    for columns in rng.integers(1, 9, (40, figures, 12)):
        found, all_points = pareto(*columns), list(zip(*columns, strict=True))
        points = set(all_points)
        best = {p for p in points if not any(q != p and not above(q, p) for q in points)}
        assert {all_points[i] for i in found} == best
        assert len(found) == len(best)


def above(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
    return any(a > b for a, b in zip(one, other, strict=True))


def test_every_method_that_was_asked_for_is_there() -> None:
    for quick in (True, False):
        ways = list(methods(quick))
        assert len({(way.family, way.setting) for way in ways}) == len(ways)
        families = {way.family for way in ways}
        for name in ("Euler", "RK4", "events", "smoothed", "Karnopp", "LSODA", "Radau", "BDF"):
            assert any(name in family for family in families), name
        assert {"ls-step", "patch", "LuGre"} <= families
    widths = [way.setting.split(",")[0] for way in methods(False) if "smoothed" in way.family]
    assert (widths[0], widths[-1]) == ("ε 0.3", "ε 0.0001")


def test_a_random_throw_alone_is_the_one_of_the_batch() -> None:
    from throwplan.models import throw_sliding_pivot

    batch = random_throws(50, 3)
    together = throw_sliding_pivot(batch, 200).detach
    for i in (0, 17, 49):
        case = throw_number(batch, i)
        alone = detached(SlidingPivotRelease(steps=32, events=True).release(case))
        assert np.abs(alone - together[i]).max() < 1e-4
    assert np.array_equal(random_throws(50, 3).body.mass, batch.body.mass)
    assert not np.array_equal(random_throws(50, 4).body.mass, batch.body.mass)
