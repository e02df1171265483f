"""The library of solved throws: grown over the reach, moved to targets, never trusted."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan import pictures
from throwplan.planner.search import Library
from throwplan.planner.throw import make_manipulator
from throwplan.problems import Choice, Cost

from benchmarks.judge import judge

COUNT = 50


@pytest.fixture(scope="module")
def prepared() -> tp.Planner:
    planner = tp.Planner(tp.load_scene("hand-flip"))
    heard: list[tuple[int, int]] = []
    made = planner.prepare(COUNT, lambda done, total: heard.append((done, total)))
    assert 0.9 * COUNT <= made == planner.prepared < 1.5 * COUNT
    assert heard[-1] == (min(made, COUNT), COUNT) and heard == sorted(heard)
    return planner


@pytest.fixture(scope="module")
def plain() -> tp.Planner:
    return tp.Planner(tp.load_scene("hand-flip"), library=False)


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


def test_growth_goes_on_from_what_there_is(prepared, tmp_path, monkeypatch) -> None:
    copy_of(prepared, monkeypatch, tmp_path)
    planner = tp.Planner(prepared.scene)

    def stopped(done: int, total: int) -> None:
        if done > COUNT + 10:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        planner.prepare(2 * COUNT, stopped)
    assert len(planner.library) > COUNT
    assert len(reopened(planner)) == len(planner.library)
    kept = {row.tobytes() for row in reopened(planner).records}
    assert {row.tobytes() for row in prepared.library.records} <= kept


@pytest.mark.parametrize(
    "harm",
    ["garbled", "empty"]
    + [pytest.param(one, marks=pytest.mark.slow) for one in ("cut", "renamed", "text")],
)
def test_a_harmed_file_is_passed_over(prepared, harm: str, tmp_path, monkeypatch) -> None:
    folder = copy_of(prepared, monkeypatch, tmp_path)
    for path in folder.glob("*.npy"):
        data = path.read_bytes()
        if harm == "garbled":
            path.write_bytes(data[:900] + bytes(b ^ 0xFF for b in data[900:1400]) + data[1400:])
        if harm == "cut":
            path.write_bytes(data[: len(data) // 2])
        if harm == "renamed":
            path.rename(folder / "0123456789abcdef01234567.npy")
        if harm in ("text", "empty"):
            path.write_text("no records" if harm == "text" else "")
    assert len(reopened(prepared)) == 0
    planner = tp.Planner(prepared.scene)
    assert planner.plan().solved
    assert planner.prepare(3) >= 3


def kept_as(
    planner: tp.Planner, rows: np.ndarray, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    """Makes a cache folder whose library has these records, in a file that is whole."""
    monkeypatch.setenv("THROWPLAN_CACHE", str(folder))
    reopened(planner).add(list(rows))


def scrambled(rows: np.ndarray, way: str) -> None:
    """Makes records wrong that still read as records, all or some."""
    rng = np.random.default_rng(0)
    if way == "flat":
        rows["slope"] = 0
    elif way == "steep":
        rows["slope"] *= 1e20
    elif way == "noise":
        rows["slope"] *= 1 + rng.standard_normal(rows["slope"].shape)
    elif way == "shuffled":
        rows["u"] = rng.permutation(rows["u"])
    elif way == "bytes":
        data = rows.view(np.uint8)
        hit = rng.random(data.shape) < 0.001
        data[hit] = rng.integers(0, 256, hit.sum())
    elif way == "elsewhere":
        # They say that they land where they do not.
        order = rng.permutation(len(rows))
        rows["detach"], rows["landing"] = rows["detach"][order], rows["landing"][order]
    else:
        rows["margins"], rows["guards"] = b'{"held": 0.3, "self": 0.5}', b"carry return nothing"


@pytest.mark.parametrize(
    "way",
    [
        "elsewhere",
        "bytes",
        *(
            pytest.param(way, marks=pytest.mark.slow)
            for way in ("flat", "steep", "noise", "shuffled", "other margins")
        ),
    ],
)
def test_a_plan_from_wrong_records_costs_time_only(
    prepared, way: str, tmp_path, monkeypatch
) -> None:
    rows = prepared.library.records.copy()
    scrambled(rows, way)
    kept_as(prepared, rows, monkeypatch, tmp_path)
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
    other.add(rows[15:40])
    assert (len(one.records), len(other.records)) == (20, 25)
    one = reopened(prepared)
    assert len(one.records) == 40
    # Merging takes away what it has seen, and no more.
    other.add(rows[40:])
    one.merge()
    assert len(reopened(prepared).records) == len(rows)


def test_beyond_the_edge_the_nearest_throw_is_found_with_a_library_and_without(
    plain, prepared
) -> None:
    for x, theta in ((4.6, 8.9), (-3.0, 0.0)):
        target = plain.scene.target.in_plane(x, theta)
        plans = [planner.plan(target) for planner in (plain, prepared)]
        for plan in plans:
            assert plan.status == "not_found" and plan.binding and plan.nearest.verdict.ok
            assert prepared.plan(plan.nearest.target).solved
        lever = plain.scene.object.half_length
        away = [target.distance(plan.nearest.target, lever) for plan in plans]
        assert away[1] < 1.15 * away[0]


def test_growth_goes_outward_from_the_target(
    prepared: tp.Planner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    planner, target = tp.Planner(prepared.scene), prepared.scene.target

    def stopped(done: int, total: int) -> None:
        if done >= COUNT // 4:
            raise KeyboardInterrupt

    def distances(one: tp.Planner) -> np.ndarray:
        x, theta, _ = one.library.landings(target.z)
        return one.scene.object.pose_error(x - target.plane_x, theta - target.theta)

    with pytest.raises(KeyboardInterrupt):
        planner.prepare(COUNT, stopped)
    assert planner.prepared >= COUNT // 4
    assert np.median(distances(planner)) < 0.7 * np.median(distances(prepared))


def test_turns_alternatives_and_a_choice(prepared) -> None:
    target = next(t for t in targets(prepared, 4) if prepared.plan(t).solved)
    turned = prepared.plan(target.turned(-6 * math.pi), turns="any")
    turns = (turned.target.theta - target.theta) / (2 * math.pi)
    assert turned.solved and turns == pytest.approx(round(turns), abs=1e-9)
    several = prepared.plan(target, alternatives=2)
    assert several.solved
    order = [
        (not p.throw.refinement.quiet, p.throw.effort) for p in (several, *several.alternatives)
    ]
    assert order == sorted(order)
    for other in several.alternatives:
        assert other.error_sent()[0] <= prepared.scene.tolerance.position
    # No attempt is begun when the time is over.
    assert prepared.plan(target, patience=1e-9).status == "not_found"


def test_it_serves_other_weights_of_the_cost(prepared) -> None:
    target = next(t for t in targets(prepared, 4) if prepared.plan(t).solved)
    fast = tp.Planner(prepared.scene.replace(cost=Cost(time=100.0)))
    assert fast.prepared == prepared.prepared
    plain, sooner = prepared.plan(target), fast.plan(target)
    assert sooner.solved and sooner.throw.opening_time < plain.throw.opening_time - 0.02


def test_without_a_cache_folder_nothing_is_kept(monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", "")
    assert tp.Planner(tp.load_scene("hand-box")).prepare(5) > 0


def test_the_map_shows_it(prepared, tmp_path) -> None:
    found = tp.reach_map(prepared.scene, samples=3000)
    assert found.solved.shape == (2, prepared.prepared)
    x, theta, _ = prepared.library.landings(prepared.scene.target.z)
    np.testing.assert_allclose(found.solved, [x, theta])
    assert found.to_dict()["solved"] == prepared.prepared and "library:" in found.summary()
    pictures.save(found, tmp_path)
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_the_robust_map_has_the_errors_of_sweeps(prepared, tmp_path) -> None:
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
    with pytest.raises(tp.InputError, match="must be the target's"):
        tp.reach_map(prepared.scene, prepared.scene.target.z + 0.1, robust=True)
    with np.load(found.save(tmp_path)) as arrays:
        np.testing.assert_array_equal(arrays["error95"], found.error95)
