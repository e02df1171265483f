"""Throws solved ahead: fewer iterations to the same promise, made once, on request only."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from throwplan.problems import Choice

COUNT = 40


@pytest.fixture(scope="module")
def prepared() -> tp.Planner:
    planner = tp.Planner(tp.load_scene("hand-flip"))
    heard: list[tuple[int, int]] = []
    made = planner.prepare(COUNT, lambda done, total: heard.append((done, total)))
    assert COUNT / 2 < made == planner.prepared <= COUNT
    assert heard == [(k, COUNT) for k in range(COUNT + 1)]
    return planner


@pytest.fixture(scope="module")
def plain() -> tp.Planner:
    return tp.Planner(tp.load_scene("hand-flip"))


def targets(planner: tp.Planner, count: int) -> list[tp.Pose]:
    """Poses all over what random throws of the scene reach."""
    reach = tp.reach_map(planner.scene, samples=20_000)
    chosen = np.linspace(0, len(reach.x) - 1, count).astype(int)
    return [planner.scene.target.in_plane(float(reach.x[i]), float(reach.theta[i])) for i in chosen]


def test_plans_take_fewer_iterations_and_keep_their_promise(
    plain: tp.Planner, prepared: tp.Planner
) -> None:
    tolerance = plain.scene.tolerance
    pairs = [(plain.plan(t), prepared.plan(t)) for t in targets(plain, 16)]
    for before, after in pairs:
        assert after.solved or not before.solved
        if after.solved:
            dx, dtheta = after.error_sent()
            assert dx <= tolerance.position and dtheta <= tolerance.angle
    iterations = np.array([[plan.iterations for plan in pair] for pair in pairs])
    # Only some have a prepared throw within reach: those whose iterations differ.
    differ = iterations[iterations[:, 0] != iterations[:, 1]]
    assert len(differ) >= 3 and np.median(differ[:, 1] / differ[:, 0]) < 0.8
    costs = np.array([[p.throw.solution.cost for p in pair] for pair in pairs if pair[0].solved])
    assert np.median(costs[:, 1] / costs[:, 0]) == pytest.approx(1.0, abs=0.02)


def test_made_once_and_read_by_other_planners_to_the_digit(prepared: tp.Planner) -> None:
    scene, heard = prepared.scene, []
    second = tp.Planner(scene)
    assert second.prepare(COUNT, lambda done, total: heard.append(done)) == prepared.prepared
    # A target elsewhere and another name make no difference; another bar does.
    elsewhere = scene.replace(target=scene.target.in_plane(0.3, 6.0), name="mine")
    assert tp.Planner(elsewhere).prepare(COUNT, lambda done, total: heard.append(done))
    assert not heard
    heavier = scene.replace(object=dataclasses.replace(scene.object, mass=0.2))
    assert tp.Planner(heavier).prepare(5, lambda done, total: heard.append(done))
    assert heard
    for target in targets(prepared, 3):
        one, other = prepared.plan(target), second.plan(target)
        assert one.iterations == other.iterations
        np.testing.assert_array_equal(one.throw.solution.x, other.throw.solution.x)


@pytest.mark.slow
def test_a_damaged_file_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    scene, heard = tp.load_scene("hand-flip"), []
    made = tp.Planner(scene).prepare(6)
    whole = {path: path.read_bytes() for path in tmp_path.glob("*.npz")}
    for path, data in whole.items():
        flipped = bytes(byte ^ 0xFF for byte in data[100:600])
        path.write_bytes(data[:100] + flipped + data[600:])
    assert tp.Planner(scene).prepare(6, lambda done, total: heard.append(done)) == made
    assert heard


def test_far_from_all_of_them_the_plan_is_the_usual_one(
    plain: tp.Planner, prepared: tp.Planner
) -> None:
    near = targets(plain, 2)
    higher = [dataclasses.replace(target, z=target.z + 0.3) for target in near]
    for target in (*higher, plain.scene.target.in_plane(50.0, 0.0)):
        before, after = plain.plan(target), prepared.plan(target)
        assert (before.status, before.iterations) == (after.status, after.iterations)
    # Distinct throws are looked for from the table.
    counted = [p.plan(near[0], alternatives=2).iterations for p in (plain, prepared)]
    assert counted[0] == counted[1]


def test_other_ways_to_ask_for_a_plan(prepared: tp.Planner) -> None:
    target = next(t for t in targets(prepared, 4) if prepared.plan(t).solved)
    turned = prepared.plan(target.turned(-6 * math.pi), turns="any")
    turns = (turned.target.theta - target.theta) / (2 * math.pi)
    assert turned.solved and turns == pytest.approx(round(turns), abs=1e-9)
    for options in ({"solver": "ipopt"}, {"warm": prepared.plan()}):
        assert prepared.plan(target, **options).solved
    # No attempt is begun when the time is over.
    assert not prepared.plan(target, patience=1e-9).solved


def test_without_a_cache_folder_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", "")
    assert tp.Planner(tp.load_scene("hand-flip")).prepare(5) > 0


def test_refused() -> None:
    scene = tp.load_scene("hand-flip")
    with pytest.raises(tp.InputError, match="not for a scene with \\[choice\\]"):
        tp.Planner(scene.replace(choice=Choice())).prepare()
    for throws in (0, -1, 10_001, 2.5, True, "many"):
        with pytest.raises(tp.InputError, match=r"throws = .*: must be a whole number, 1 to 10000"):
            tp.Planner(scene).prepare(throws)  # type: ignore[arg-type]
