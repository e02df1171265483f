"""Prepared throws: fewer iterations to the same promise, made once, and only where asked for."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner import solved_throws
from throwplan.planner.solved_throws import SolvedThrows, _read

COUNT = 60


@pytest.fixture(scope="module", autouse=True)
def a_cache_of_their_own(tmp_path_factory: pytest.TempPathFactory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THROWPLAN_CACHE", str(tmp_path_factory.mktemp("prepared")))
        patch.setattr(solved_throws, "SAMPLES", 20_000)
        yield


def near(planner: tp.Planner, count: int) -> list[tp.Pose]:
    """Poses 1 cm and 2 deg beside where some of a planner's prepared throws land."""
    assert planner._throws is not None
    chosen = planner._throws._throws[:: planner.prepared // count][:count]
    open_angle = chosen[0].target.theta is None
    return [
        t.target.in_plane(
            t.target.plane_x + 0.01, None if open_angle else t.target.theta + math.radians(2)
        )
        for t in chosen
    ]


@pytest.mark.parametrize("name", ["hand-flip", "hand-box", "pose"])
def test_plans_take_fewer_iterations_and_keep_their_promise(name: str) -> None:
    scene = tp.load_scene(name)
    plain, prepared = tp.Planner(scene), tp.Planner(scene)
    assert prepared.prepared == 0
    heard: list[tuple[int, int]] = []
    made = prepared.prepare(COUNT, lambda done, total: heard.append((done, total)))
    assert COUNT / 2 < made == prepared.prepared <= COUNT
    assert heard == [(k, COUNT) for k in range(COUNT)]
    pairs = [(plain.plan(t), prepared.plan(t)) for t in near(prepared, 10)]
    for _, after in pairs:
        assert after.solved
        dx, dtheta = after.error_sent()
        assert dx <= scene.tolerance.position and dtheta <= scene.tolerance.angle
    iterations = np.array([[plan.iterations for plan in pair] for pair in pairs])
    assert np.median(iterations[:, 1] / iterations[:, 0]) < 0.6
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
    assert len(heard) == COUNT
    for target in near(first, 4):
        one, other = first.plan(target), second.plan(target)
        assert one.iterations == other.iterations
        np.testing.assert_array_equal(one.throw.solution.x, other.throw.solution.x)


def test_what_is_read_is_what_was_saved(tmp_path: Path) -> None:
    scene = tp.load_scene("cup")
    planner = tp.Planner(scene)
    planner.prepare(20)
    assert planner._throws is not None and len(planner._throws) > 0
    path = tmp_path / "throws.npz"
    planner._throws.save(path)
    found = _read(path)
    assert found is not None and len(found) == len(planner._throws)
    for one, other in zip(found, planner._throws._throws, strict=True):
        assert one.guards == other.guards and one.room == other.room and one.aim == other.aim
        assert one.target.plane_x == other.target.plane_x and one.target.theta == other.target.theta
        for name in solved_throws.PARTS:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    whole = path.read_bytes()
    for damaged in (whole[:-100], whole[: len(whole) // 2], b"", b"no archive"):
        path.write_bytes(damaged)
        assert _read(path) is None


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
    assert planner._throws is not None
    target = planner._throws._throws[0].target
    turned = target.turned(-6 * math.pi)
    plan = planner.plan(turned, turns="any")
    assert plan.solved and plan.iterations == planner.plan(target).iterations
    assert plan.target.theta == pytest.approx(target.theta, abs=1e-9)


def test_throws_of_another_problem_are_passed_over() -> None:
    scene = tp.load_scene("hand-flip")
    planner, plain = tp.Planner(scene), tp.Planner(scene)
    planner.prepare(COUNT)
    wanted = near(planner, 3)
    foreign = [dataclasses.replace(t, x=t.x[:-1]) for t in planner._throws._throws]
    planner._throws = SolvedThrows(foreign, scene)
    for target in wanted:
        assert planner.plan(target).iterations == plain.plan(target).iterations


@pytest.mark.parametrize("throws", [0, -1, 10_001, 2.5, True, "many"])
def test_refused(throws: object) -> None:
    planner = tp.Planner(tp.load_scene("hand-flip"))
    with pytest.raises(tp.InputError, match=r"throws = .*: must be a whole number, 1 to 10000"):
        planner.prepare(throws)  # type: ignore[arg-type]
