"""The table of sampled releases: feasible, dense at the edge, cached, thrown as the models do."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from scipy.interpolate import BPoly
from throwplan.planner.check.exact_release import sliding_pivot_release
from throwplan.planner.check.motion import PlannedMotion
from throwplan.planner.check.mover import make_mover
from throwplan.planner.check.rollout import MoverTrack, case_of, friction_use, hand_samples, landing
from throwplan.planner.search import releases as table_module
from throwplan.planner.search.release_cache import stored
from throwplan.planner.search.release_room import clears_palm
from throwplan.planner.search.releases import Releases, ReleaseSampler

ARRAYS = ("q", "dq", "ddq", "run_up", "detach")


def drawn(scene: tp.Scene, count: int = 4000, seed: int = 0) -> Releases:
    return ReleaseSampler(scene, make_mover(scene)).draw(count, seed)


@pytest.mark.parametrize("name", ["pose", "cup", "hand-flip"])
def test_releases_keep_limits_and_grip(name: str) -> None:
    scene = tp.load_scene(name)
    mover, table = make_mover(scene), drawn(scene)
    limits, opening = mover.planning, scene.gripper.profile().opening
    assert len(table.q) > 300
    for t in (0.0, opening):
        q, dq = table.q + t * (table.dq + t * table.ddq / 2), table.dq + t * table.ddq
        assert (q >= limits.q_min - 1e-9).all() and (q <= limits.q_max + 1e-9).all()
        assert (np.abs(dq) <= limits.dq + 1e-9).all()
    motion = PlannedMotion(np.array([0.0, 1.0]), table.q, table.dq, table.ddq, 0 * table.q)

    class AtStart:
        def at(self, times: np.ndarray) -> tuple[np.ndarray, ...]:
            return motion.q.T, motion.dq.T, motion.ddq.T

    use = np.hypot(*friction_use(scene, hand_samples(mover, AtStart(), np.zeros(len(table.q)))))
    assert use.max() <= 1.0


@pytest.mark.parametrize("name", ["pose", "hand-flip"])
def test_thrown_as_the_exact_model_throws(name: str) -> None:
    """Within what twelve even steps, enough for a starting point, leave."""
    scene = tp.load_scene(name)
    mover, table = make_mover(scene), drawn(scene)
    x, theta, time = table.landings(scene.target.z, scene.gravity)
    for i in np.flatnonzero(np.isfinite(time))[::300]:
        one = PlannedMotion(
            np.array([0.0, 1.0]), table.q[[i]], table.dq[[i]], table.ddq[[i]], 0 * table.q[[i]]
        )
        release = sliding_pivot_release(case_of(scene, MoverTrack(mover, one, 0.0)), np.zeros(0))
        if release.trouble:
            continue
        exact = landing(release, scene.target.z, scene.gravity)
        assert x[i] == pytest.approx(exact.x, abs=6e-3)
        assert theta[i] == pytest.approx(exact.theta, abs=0.05)


def test_run_ups_through_the_base_column_are_told_from_those_beside_it() -> None:
    """SciPy's polynomials, and the bar's axis point by point."""
    scene = tp.load_scene("cup")
    mover, table, workspace = make_mover(scene), drawn(scene, 2000), scene.workspace
    opening = scene.gripper.profile().opening
    end = table.q + opening * (table.dq + opening * table.ddq / 2)
    rate = table.dq + opening * table.ddq
    off_palm = clears_palm(scene, mover, end, rate, table.detach)
    bar = np.linspace(-scene.object.com, scene.object.length - scene.object.com, 53)
    deepest = np.full(len(table.q), -np.inf)
    for i, duration in enumerate(table.run_up):
        ends = [[mover.start, 0 * mover.start, 0 * mover.start]]
        ends.append([table.q[i], table.dq[i], table.ddq[i]])
        path = BPoly.from_derivatives([0.0, duration], ends)(np.linspace(0.0, duration, 120))
        x, z, theta = np.array(mover.motion(path.T, 0 * path.T, 0 * path.T)[0])[:, :, None]
        theta = theta + scene.grasp.angle
        x = x + (scene.com_offset + bar) * np.cos(theta)
        z = z + (scene.com_offset + bar) * np.sin(theta)
        inside = np.minimum(workspace.column_radius - np.abs(x), workspace.column_height - z)
        deepest[i] = inside.max()
    through = deepest > 0.02
    assert 0.1 < through.mean() < 0.5
    assert not table.clear[through].any()
    assert table.clear[off_palm & (deepest < -scene.object.width)].all()


def test_draws_beside_sparse_landings_reach_farther(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many states tried, more different landings."""
    scene = tp.load_scene("hand-flip")

    def cells(table: Releases) -> int:
        x, theta, _ = table.landings(scene.target.z, scene.gravity)
        ok = np.isfinite(x)
        return len(set(zip((x[ok] // 0.1).tolist(), (theta[ok] // 0.2).tolist(), strict=True)))

    beside = cells(drawn(scene))
    monkeypatch.setattr(table_module, "SPARSE_SHARE", 0.0)
    assert beside > 1.3 * cells(drawn(scene))


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    return tmp_path


def kept(scene: tp.Scene, draws: list[int]) -> Releases:
    mover = make_mover(scene)

    def draw() -> Releases:
        draws.append(1)
        return ReleaseSampler(scene, mover).draw(500)

    return stored(scene, mover, 500, 0, draw)


def test_cache_gives_the_same_arrays_and_a_damaged_file_is_drawn_again(cache: Path) -> None:
    scene, draws = tp.load_scene("pose"), []
    first = kept(scene, draws)
    again = kept(scene, draws)
    assert len(draws) == 1
    for name in ARRAYS:
        assert np.array_equal(getattr(first, name), getattr(again, name))
    (file,) = cache.glob("*.npz")
    whole = file.read_bytes()
    for damaged in (whole[:100], b"", whole[: len(whole) // 2]):
        file.write_bytes(damaged)
        mended = kept(scene, draws)
        assert np.array_equal(mended.q, first.q)
    assert len(draws) == 4


def test_what_the_cache_depends_on(cache: Path) -> None:
    scene, draws = tp.load_scene("cup"), []
    kept(scene, draws)
    kept(scene.aimed_at(tp.Pose(x=1.0, z=0.3, theta=-1.5)), draws)
    kept(scene.replace(tolerance=dataclasses.replace(scene.tolerance, position=0.01)), draws)
    assert len(draws) == 1
    kept(scene.replace(object=dataclasses.replace(scene.object, mass=0.23)), draws)
    kept(scene.replace(contact=dataclasses.replace(scene.contact, friction=0.9)), draws)
    kept(scene.replace(robot=dataclasses.replace(scene.robot, velocity_margin=0.1)), draws)
    assert len(draws) == 4


def test_without_a_cache_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", "")
    draws: list[int] = []
    kept(tp.load_scene("hand-box"), draws)
    kept(tp.load_scene("hand-box"), draws)
    assert len(draws) == 2
