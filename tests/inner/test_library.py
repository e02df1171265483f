"""Fails if a plan from the library of solved throws is not judged anew, is found for another scene,
or if harmed records, other users' files or two that grow it cost more than time."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.planner.search import Library
from throwplan.planner.throw import make_manipulator
from throwplan.problems import Choice, Cost

from benchmarks.judge import judge

COUNT = 30


@pytest.fixture(scope="module")
def prepared() -> tp.Planner:
    planner = tp.Planner(tp.load_scene("hand-flip"))
    heard: list[tuple[int, int]] = []
    made = planner.prepare(COUNT, lambda done, total: heard.append((done, total)))
    assert 0.9 * COUNT <= made == planner.prepared < 1.5 * COUNT
    assert heard[-1] == (min(made, COUNT), COUNT) and heard == sorted(heard)
    return planner


def targets(planner: tp.Planner, count: int, away: float = 0.0) -> list[tp.Pose]:
    """Poses so far [m, rad] beside throws of the library."""
    x, theta, _ = planner.library.landings(planner.scene.target.z)
    chosen = np.linspace(0, len(x) - 1, count).astype(int)
    return [
        planner.scene.target.in_plane(float(x[i]) + away, float(theta[i]) - 4 * away)
        for i in chosen
    ]


def copy_of(planner: tp.Planner, monkeypatch: pytest.MonkeyPatch, folder: Path) -> Path:
    """The planner's library in another cache folder."""
    kept = planner.library.folder
    assert kept is not None
    copied = folder / kept.name
    copied.mkdir()
    for path in kept.glob("*.npy"):
        (copied / path.name).write_bytes(path.read_bytes())
    monkeypatch.setenv("THROWPLAN_CACHE", str(folder))
    return copied


def reopened(planner: tp.Planner) -> Library:
    return Library(planner.scene, make_manipulator(planner.scene))


def test_a_moved_throw_is_a_whole_plan(prepared, tmp_path) -> None:
    plans = map(prepared.plan, targets(prepared, 12, 0.005))
    plan = next(plan for plan in plans if plan.solver == "corrector")
    assert plan.solved and plan.iterations == 0
    plan.save(tmp_path)
    answer = plan.to_dict()
    assert answer["nlp"]["variables"] > 100 and answer["landing"]["limit_surface"]
    assert all(math.isfinite(answer["error"][name]["angle"]) for name in ("planned", "exact"))
    assert tp.read_plan(tmp_path).miss(plan.target) == pytest.approx((0, 0), abs=0.02)
    # It may be started from, moved, followed by a solver, and made robust. Half of the way back to
    # the library's throw is in reach.
    near = plan.target.in_plane(plan.target.plane_x - 0.0025, plan.target.theta + 0.01)
    for options in ({}, {"solver": "fatrop"}):
        assert prepared.plan(near, warm=plan, **options).solved
    assert prepared.plan(plan.target, robust=True).robust


def test_other_planners_find_it_and_other_scenes_do_not(prepared) -> None:
    scene = prepared.scene
    # A target elsewhere, another name and a choice make no difference; another bar does.
    elsewhere = scene.replace(target=scene.target.in_plane(0.3, 6.0), name="mine", choice=Choice())
    assert tp.Planner(elsewhere).prepared == prepared.prepared
    assert not tp.Planner(varied(scene, object={"mass": 0.2})).prepared
    assert not tp.Planner(scene, library=False).prepared
    one, other = (p.plan(targets(prepared, 3)[1]) for p in (prepared, tp.Planner(scene)))
    assert one.throw.effort == other.throw.effort


@pytest.mark.parametrize("harm", ["garbled", "empty"])
def test_a_harmed_file_is_passed_over(prepared, harm: str, tmp_path, monkeypatch) -> None:
    for path in copy_of(prepared, monkeypatch, tmp_path).glob("*.npy"):
        data = path.read_bytes()
        path.write_bytes(data[:900] + bytes(b ^ 0xFF for b in data[900:1400]) + data[1400:])
        if harm == "empty":
            path.write_bytes(b"")
    assert len(reopened(prepared)) == 0
    assert tp.Planner(prepared.scene).plan().solved


@pytest.mark.parametrize("way", ["elsewhere", "bytes"])
def test_a_plan_from_wrong_records_costs_time_only(prepared, way, tmp_path, monkeypatch) -> None:
    """Records that are whole but say that they land where they do not, or hold random bytes."""
    rows, rng = prepared.library.records.copy(), np.random.default_rng(0)
    if way == "elsewhere":
        order = rng.permutation(len(rows))
        rows["detach"], rows["landing"] = rows["detach"][order], rows["landing"][order]
    else:
        data = rows.view(np.uint8)
        hit = rng.random(data.shape) < 0.001
        data[hit] = rng.integers(0, 256, hit.sum())
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    reopened(prepared).add(list(rows))
    plan = tp.Planner(prepared.scene).plan(targets(prepared, 5, 0.004)[3], patience=20.0)
    assert plan.solved and plan.throw is not None, plan.message
    assert judge(plan).broken == ()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no owner here")
def test_another_users_files_are_passed_over(prepared, tmp_path, monkeypatch) -> None:
    copy_of(prepared, monkeypatch, tmp_path)
    assert len(reopened(prepared)) == len(prepared.library)
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert len(reopened(prepared)) == 0


def test_two_that_grow_the_same_one_lose_nothing(prepared, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    one, other = reopened(prepared), reopened(prepared)
    rows = list(prepared.library.records)
    one.add(rows[:20])
    other.add(rows[15:25])
    assert (len(one.records), len(other.records)) == (20, 10)
    one = reopened(prepared)
    assert len(one.records) == 25
    # Merging takes away what it has seen, and no more.
    other.add(rows[25:])
    one.merge()
    assert len(reopened(prepared).records) == len(rows)


def test_of_two_throws_to_one_landing_the_cheapest_is_kept(prepared, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    library, cheap = reopened(prepared), prepared.library.records[:1]
    dear = cheap.copy()
    dear["effort"] += 1.0
    for rows in (dear, cheap, dear):
        library.add(list(rows))
    for found in (library, reopened(prepared)):
        assert found.records["effort"] == cheap["effort"]


def test_beyond_the_edge_the_nearest_throw_is_found_with_a_library_and_without(prepared) -> None:
    """It is a plan of its own landing, and judged as one."""
    planner = tp.Planner(prepared.scene, library=False)
    target, away = prepared.scene.target.in_plane(4.6, 8.9), []
    for each in (planner, prepared):
        plan = each.plan(target)
        assert plan.status == "not_found" and plan.throw is None and plan.bound is None
        near = plan.nearest
        assert near.solved and near.verdict.ok and judge(near).broken == ()
        assert prepared.plan(near.target).solved and each.plan(near.target, warm=near).solved
        said, off = plan.to_dict()["nearest"], near.throw.deciding.miss(target)
        assert said["error"] == pytest.approx({"position": abs(off[0]), "angle": abs(off[1])})
        assert said["pose_error"] == pytest.approx(prepared.scene.object.pose_error(*off))
        assert plan.binding and all(one.limit and one.key and one.advice for one in plan.binding)
        away.append(target.distance(near.target, prepared.scene.object.half_length))
    assert away[1] < 1.15 * away[0]


def test_turns_alternatives_and_weights_of_the_cost(prepared) -> None:
    target = next(t for t in targets(prepared, 4) if prepared.plan(t).solved)
    turned = prepared.plan(target.turned(-6 * math.pi), turns="any")
    turns = (turned.target.theta - target.theta) / (2 * math.pi)
    assert turned.solved and turns == pytest.approx(round(turns), abs=1e-9)
    several = prepared.plan(target, alternatives=2)
    order = [
        (not p.throw.refinement.quiet, p.throw.effort) for p in (several, *several.alternatives)
    ]
    assert several.solved and order == sorted(order)
    fast = tp.Planner(prepared.scene.replace(cost=Cost(time=100.0)))
    assert fast.prepared == prepared.prepared
    plain, sooner = prepared.plan(target), fast.plan(target)
    assert sooner.solved and sooner.throw.opening_time < plain.throw.opening_time - 0.02
    # No attempt is begun when the time is over.
    assert prepared.plan(target, patience=1e-9).status == "not_found"


def test_the_map_shows_it_and_the_errors_of_sweeps(prepared) -> None:
    found = tp.reach_map(prepared.scene, samples=3000, robust=True)
    x, theta, _ = prepared.library.landings(prepared.scene.target.z)
    error, best_x, best_theta = found.least
    assert error == np.nanmin(found.error95)
    bins = {found.bin_of(*pose) for pose in zip(x, theta, strict=True)}
    assert found.bin_of(best_x, best_theta) in bins
    # Of plans to places of the library, those of small errors scatter least.
    chosen = np.argsort(prepared.library.records["error95"])[[0, -1]]
    small, large = (
        tp.sweep(prepared.plan(prepared.scene.target.in_plane(float(x[i]), float(theta[i]))), 256)
        for i in chosen
    )
    errors = [one.to_dict()["quantiles"]["scaled"]["95"] for one in (small, large)]
    assert errors[0] < errors[1]
    assert found.to_dict()["least"] == {"error95": error, "x": best_x, "theta": best_theta}
    np.testing.assert_allclose(tp.reach_map(prepared.scene, samples=3000).solved, [x, theta])
