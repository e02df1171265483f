"""Prepared throws: fewer iterations to the same promise, made once, and only where asked for."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.ocp import Margins
from throwplan.planner.reach import preparing
from throwplan.planner.search import correction, solved_throws
from throwplan.planner.search.solved_throws import SolvedThrow, SolvedThrows, _read
from throwplan.problems import Choice

COUNT = 60


@pytest.fixture(scope="module", autouse=True)
def a_cache_of_their_own(tmp_path_factory: pytest.TempPathFactory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THROWPLAN_CACHE", str(tmp_path_factory.mktemp("prepared")))
        patch.setattr(preparing, "SAMPLES", 20_000)
        yield


def throws_of(planner: tp.Planner) -> tuple[SolvedThrow, ...]:
    assert planner._throws is not None
    return planner._throws._throws


def near(planner: tp.Planner, count: int) -> list[tp.Pose]:
    """Poses 1 cm and 2 deg beside where some of a planner's prepared throws land."""
    throws = throws_of(planner)
    assert len(throws) >= count
    chosen = throws[:: len(throws) // count][:count]
    open_angle = chosen[0].target.theta is None
    return [
        t.target.in_plane(
            t.target.plane_x + 0.01, None if open_angle else t.target.theta + math.radians(2)
        )
        for t in chosen
    ]


@pytest.mark.parametrize(("name", "count"), [("hand-flip", 60), ("hand-box", 40), ("pose", 24)])
def test_plans_take_fewer_iterations_and_keep_their_promise(name: str, count: int) -> None:
    scene = tp.load_scene(name)
    plain, prepared = tp.Planner(scene), tp.Planner(scene)
    assert prepared.prepared == 0
    heard: list[tuple[int, int]] = []
    made = prepared.prepare(count, lambda done, total: heard.append((done, total)))
    assert count / 2 < made == prepared.prepared <= count
    assert heard == [(k, count) for k in range(count + 1)]
    pairs = [(plain.plan(t), prepared.plan(t)) for t in near(prepared, 8)]
    for _, after in pairs:
        assert after.solved
        dx, dtheta = after.error_sent()
        assert dx <= scene.tolerance.position and dtheta <= scene.tolerance.angle
    iterations = np.array([[plan.iterations for plan in pair] for pair in pairs])
    assert np.median(iterations[:, 1] / iterations[:, 0]) < 0.75
    # Mostly the same throw, not a costlier one.
    costs = np.array([[p.throw.solution.cost for p in pair] for pair in pairs if pair[0].solved])
    assert np.median(costs[:, 1] / costs[:, 0]) == pytest.approx(1.0, abs=0.01)


def test_made_once_and_read_by_other_planners_to_the_digit() -> None:
    scene = tp.load_scene("hand-flip")
    first, second = tp.Planner(scene), tp.Planner(scene)
    first.prepare(COUNT)
    heard: list[int] = []
    assert second.prepare(COUNT, lambda done, total: heard.append(done)) == first.prepared
    assert not heard
    # A target elsewhere and another name make no difference; another bar does.
    elsewhere = scene.replace(target=scene.target.in_plane(0.3, 6.0), name="mine")
    assert tp.Planner(elsewhere).prepare(COUNT, lambda done, total: heard.append(done))
    assert not heard
    heavier = scene.replace(object=dataclasses.replace(scene.object, mass=0.2))
    assert tp.Planner(heavier).prepare(COUNT, lambda done, total: heard.append(done))
    assert len(heard) == COUNT + 1
    for target in near(first, 4):
        one, other = first.plan(target), second.plan(target)
        assert one.iterations == other.iterations
        np.testing.assert_array_equal(one.throw.solution.x, other.throw.solution.x)


def test_what_is_read_is_what_was_saved(tmp_path: Path) -> None:
    scene = tp.load_scene("hand-flip")
    planner = tp.Planner(scene)
    planner.prepare(COUNT)
    throws = list(throws_of(planner)[:6])
    room = Margins(held=0.01, cup=2e-4, torque=0.3)
    guards = frozenset({"carry", "flight"})
    throws[1] = dataclasses.replace(throws[1], guards=guards, room=room, aim=(1e-3, -2e-3))
    longer = np.append(throws[2].lam_g, 1.0)
    throws[2] = dataclasses.replace(throws[2], target=tp.Pose(0.5, z=0.1), lam_g=longer)
    path = tmp_path / "throws.npz"
    SolvedThrows(throws, scene).save(path)
    found = _read(path)
    assert found is not None and len(found) == len(throws)
    for one, other in zip(found, throws, strict=True):
        assert one.guards == other.guards and one.room == other.room and one.aim == other.aim
        assert one.target.plane_x == other.target.plane_x and one.target.theta == other.target.theta
        for name in solved_throws.PARTS:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    whole = path.read_bytes()
    for damaged in (whole[:-100], whole[: len(whole) // 2], b"", b"no archive"):
        path.write_bytes(damaged)
        assert _read(path) is None
    rng = np.random.default_rng(0)
    for at in [*range(60), *rng.integers(0, len(whole), 60).tolist()]:
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        # What zip does not look at may be read as it was.
        again = _read(path)
        assert again is None or len(again) == len(throws)


def test_a_damaged_file_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    scene = tp.load_scene("hand-flip")
    made = tp.Planner(scene).prepare(10)
    before = set(tmp_path.glob("*.npz"))
    sizes = {path: path.stat().st_size for path in before}
    for path in before:
        path.write_bytes(path.read_bytes()[:200])
    assert tp.Planner(scene).prepare(10) == made
    assert {path: path.stat().st_size for path in tmp_path.glob("*.npz")} == sizes


def test_far_from_all_of_them_the_plan_is_the_usual_one() -> None:
    scene = tp.load_scene("hand-flip")
    plain, prepared = tp.Planner(scene), tp.Planner(scene)
    prepared.prepare(COUNT)
    higher = [dataclasses.replace(t, z=t.z + 0.3) for t in near(prepared, 2)]
    for target in (*higher, scene.target.in_plane(50.0, 0.0)):
        before, after = plain.plan(target), prepared.plan(target)
        assert (before.status, before.iterations) == (after.status, after.iterations)
        if before.solved:
            np.testing.assert_array_equal(before.throw.solution.x, after.throw.solution.x)
    # Distinct throws are looked for from the table.
    target = near(prepared, 1)[0]
    assert (
        prepared.plan(target, alternatives=2).iterations
        == plain.plan(target, alternatives=2).iterations
    )


def test_full_turns_count_modulo_where_asked() -> None:
    scene = tp.load_scene("hand-flip")
    planner = tp.Planner(scene)
    planner.prepare(COUNT)
    target = throws_of(planner)[0].target
    turned = target.turned(-6 * math.pi)
    plan = planner.plan(turned, turns="any")
    assert plan.solved and plan.iterations == planner.plan(target).iterations
    assert plan.target.theta == pytest.approx(target.theta, abs=1e-9)


@pytest.mark.parametrize("part", solved_throws.PARTS)
def test_throws_of_another_problem_are_passed_over(part: str) -> None:
    scene = tp.load_scene("hand-flip")
    planner, plain = tp.Planner(scene), tp.Planner(scene)
    planner.prepare(COUNT)
    wanted = near(planner, 3)
    planner._throws = SolvedThrows(
        [dataclasses.replace(t, **{part: getattr(t, part)[:-1]}) for t in throws_of(planner)], scene
    )
    for target in wanted:
        assert planner.plan(target).iterations == plain.plan(target).iterations


def test_an_open_angle_is_another_problem() -> None:
    scene = tp.load_scene("hand-flip")
    fixed = scene.target
    free = scene.replace(target=fixed.in_plane(fixed.x, None))
    for one, target in ((scene, free.target), (free, fixed)):
        planner = tp.Planner(one)
        planner.prepare(20)
        before, after = tp.Planner(one).plan(target), planner.plan(target)
        assert after.solved and before.iterations == after.iterations


def test_after_throws_that_lead_nowhere_the_search_is_the_usual_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = tp.load_scene("hand-flip")
    planner, plain = tp.Planner(scene), tp.Planner(scene)
    planner.prepare(COUNT)
    target = near(planner, 1)[0]
    roomier = [dataclasses.replace(t, room=Margins(held=0.04)) for t in throws_of(planner)]
    planner._throws = SolvedThrows(roomier, scene)
    asked = []

    def attempt(problem, mover, target, guess, search, *warm, near=True):
        asked.append((search.room, bool(warm)))
        # What is prepared leads nowhere.
        return None if warm else correction.attempt(problem, mover, target, guess, search)

    monkeypatch.setattr("throwplan.planner.plan.attempt", attempt)
    before, after = plain.plan(target), planner.plan(target)
    assert 1 <= asked.count((Margins(held=0.04), True)) <= solved_throws.NEAREST
    assert all(room == Margins() for room, warm in asked if not warm)
    np.testing.assert_array_equal(before.throw.solution.x, after.throw.solution.x)


def test_other_ways_to_ask_for_a_plan() -> None:
    scene = tp.load_scene("hand-flip")
    planner = tp.Planner(scene)
    planner.prepare(COUNT)
    target = near(planner, 1)[0]
    for options in ({"solver": "ipopt"}, {"robust": "quiet"}, {"warm": planner.plan()}):
        plan = planner.plan(target, **options)
        assert plan.solved and plan.error_sent()[0] <= scene.tolerance.position
    # No attempt is begun when the time is over.
    assert not planner.plan(target, patience=1e-9).solved


def test_without_a_cache_folder_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", "")
    planner = tp.Planner(tp.load_scene("hand-flip"))
    assert planner.prepare(5) > 0


def test_plans_that_choose_among_throws_do_without() -> None:
    scene = tp.load_scene("hand-flip")
    planner = tp.Planner(scene.replace(choice=Choice()))
    with pytest.raises(tp.InputError, match="not for a scene with \\[choice\\]"):
        planner.prepare()


@pytest.mark.parametrize("throws", [0, -1, 10_001, 2.5, True, "many"])
def test_refused(throws: object) -> None:
    planner = tp.Planner(tp.load_scene("hand-flip"))
    with pytest.raises(tp.InputError, match=r"throws = .*: must be a whole number, 1 to 10000"):
        planner.prepare(throws)  # type: ignore[arg-type]
