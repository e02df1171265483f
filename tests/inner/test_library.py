"""The library of solved throws: grown over the reach, moved to targets, never trusted."""

from __future__ import annotations

import copy
import dataclasses
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.planner.library import Library
from throwplan.planner.ocp import Margins, Refinement
from throwplan.planner.throw import Throw, make_manipulator, send
from throwplan.planner.verdict import verdict
from throwplan.problems import Choice, Cost

from benchmarks.judge import judge

COUNT = 50


@pytest.fixture(scope="module")
def prepared() -> tp.Planner:
    planner = tp.Planner(tp.load_scene("hand-flip"))
    heard: list[tuple[int, int]] = []
    made = planner.prepare(COUNT, lambda done, total: heard.append((done, total)))
    assert COUNT <= made == planner.prepared < 1.5 * COUNT
    assert heard[-1] == (COUNT, COUNT) and heard == sorted(heard)
    return planner


@pytest.fixture(scope="module")
def plain() -> tp.Planner:
    return tp.Planner(tp.load_scene("hand-flip"), library=False)


@pytest.fixture(scope="module")
def boxes() -> tp.Planner:
    """A planner for bins, where theta is open: so many throws show how far its reach goes."""
    planner = tp.Planner(tp.load_scene("box"))
    assert planner.prepare(150) >= 120
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


@pytest.mark.slow
def test_moved_throws_land_break_nothing_and_cost_no_more(plain, prepared) -> None:
    tolerance = plain.scene.tolerance
    pairs = [(plain.plan(t), prepared.plan(t)) for t in targets(prepared, 9, 0.01)]
    moved = [after for _, after in pairs if after.solver == "corrector"]
    assert len(moved) >= 6
    for before, after in pairs:
        assert after.solved or not before.solved
    for plan in moved:
        dx, dtheta = plan.error_sent()
        assert dx <= tolerance.position / 2 and dtheta <= tolerance.angle / 2
        assert verdict(plan.throw.deciding, plan.target).ok
    both = [(b.throw.effort, a.throw.effort) for b, a in pairs if b.solved and a in moved]
    assert np.median([after / before for before, after in both]) < 1.03


def test_a_moved_throw_is_a_whole_plan(prepared, tmp_path) -> None:
    plans = map(prepared.plan, targets(prepared, 12, 0.005))
    plan = next(plan for plan in plans if plan.solver == "corrector")
    assert plan.solved and plan.iterations == 0
    answer = plan.save(tmp_path, draw="png").to_dict()
    assert answer["nlp"]["variables"] > 100 and answer["landing"]["limit_surface"]
    assert all(math.isfinite(answer["error"][name]["angle"]) for name in ("planned", "exact"))
    assert tp.read_plan(tmp_path).miss(plan.target) == pytest.approx((0, 0), abs=0.02)
    # It may be started from, moved, followed by a solver, and made robust. Half of the way back to
    # the library's throw is in reach.
    near = plan.target.in_plane(plan.target.plane_x - 0.0025, plan.target.theta + 0.01)
    for options in ({}, {"solver": "fatrop"}):
        assert prepared.plan(near, warm=plan, **options).solved
    assert prepared.plan(plan.target, robust="quiet").robust


def test_polishing_brings_a_moved_throw_to_its_optimum(plain) -> None:
    target = plain.scene.target
    far = target.in_plane(target.plane_x + 0.03, target.theta - 0.1)
    moved = plain.plan(far, warm=plain.plan())
    assert moved.solver == "corrector"
    better, cold = plain.polish(moved), plain.plan(far)
    assert better.solved and better.solver == "fatrop"
    assert better.throw.effort < moved.throw.effort
    assert better.throw.effort < 1.001 * cold.throw.effort
    # There is nothing left to gain.
    assert plain.polish(better).throw.effort <= better.throw.effort


@pytest.mark.parametrize(
    ("name", "model"),
    [("pose", "ls-step"), ("pose", "sp"), ("hand-flip", "ls-step"), ("fr3", "sp")],
)
def test_a_moved_throw_is_what_its_parts_give(name: str, model: str) -> None:
    scene = varied(tp.load_scene(name), tolerance={"model": model})
    planner = tp.Planner(scene, library=False)
    target = planner.scene.target
    near = target.in_plane(target.plane_x + 0.01, target.theta + 0.02)
    plan = planner.plan(near, warm=planner.plan())
    assert plan.solver == "corrector"
    moved, samples = plan.throw.deciding, send(planner.manipulator, plan.throw.planned)
    for one, other in zip(
        (samples.q, samples.dq, samples.ddq),
        (moved.samples.q, moved.samples.dq, moved.samples.ddq),
        strict=True,
    ):
        assert np.allclose(one, other, rtol=0, atol=1e-8)
    # Another of the same motion is thrown anew.
    thrown = dataclasses.replace(moved, samples=samples)
    assert np.allclose(thrown.release.com, moved.release.com, rtol=0, atol=1e-9)
    assert thrown.release.pivot == moved.release.pivot
    assert thrown.miss(near) == pytest.approx(moved.miss(near), abs=1e-9)


def test_its_slopes_are_those_of_the_optimum(plain, prepared) -> None:
    """How the cost grows along the slope is how optima themselves differ."""
    target = plain.scene.target
    first = plain.plan(target)
    costs = []
    for step in (0.002, 0.004):
        near = target.in_plane(target.plane_x + step, target.theta)
        moved = plain.plan(near, warm=first)
        solved = plain.plan(near, warm=first, solver="fatrop")
        assert moved.solver == "corrector" and solved.solver == "fatrop"
        costs.append(moved.throw.effort / solved.throw.effort - 1)
    # It is off by the second order.
    assert max(map(abs, costs)) < 1e-3


def test_other_planners_find_it_and_other_scenes_do_not(prepared) -> None:
    scene = prepared.scene
    # A target elsewhere, another name and a choice make no difference; another bar does.
    elsewhere = scene.replace(target=scene.target.in_plane(0.3, 6.0), name="mine", choice=Choice())
    assert tp.Planner(elsewhere).prepared == prepared.prepared
    assert not tp.Planner(varied(scene, object={"mass": 0.2})).prepared
    assert not tp.Planner(scene, library=False).prepared
    one, other = (p.plan(targets(prepared, 3)[1]) for p in (prepared, tp.Planner(scene)))
    assert one.throw.effort == other.throw.effort


#: What a library does not depend on: texts, weights of the cost, what chooses among throws, what
#: stands elsewhere from target to target, and where in the reach the target lies.
FREE = {"name", "description", "file", "cost", "choice", "robust", "obstacle", "target"}


def changed_numbers(value: object, where: str) -> Iterator[tuple[str, object]]:
    """A value with one of the numbers in it changed, or a choice, each with its place."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            part = getattr(value, field.name)
            for place, other in changed_numbers(part, f"{where}.{field.name}"):
                copied = copy.copy(value)
                object.__setattr__(copied, field.name, other)
                yield place, copied
    elif isinstance(value, tuple):
        for i, part in enumerate(value):
            for place, other in changed_numbers(part, f"{where}[{i}]"):
                yield place, (*value[:i], other, *value[i + 1 :])
    elif isinstance(value, float) and math.isfinite(value):
        yield where, value + 1e-9
    elif where == "tolerance.model":
        yield where, "sp"


@pytest.mark.parametrize("name", ["hand-flip", "cup", "fr3", "ur5e"])
def test_each_number_that_throws_depend_on_has_a_library_of_its_own(name: str) -> None:
    scene = tp.load_scene(name)
    manipulator, folders = make_manipulator(scene), dict[str, Path | None]()
    folders["as it is"] = Library(scene, manipulator).folder
    folders["height"] = Library(scene.aimed_at(scene.target.changed(z=0.01)), manipulator).folder
    if scene.cup is None:
        open_angle = scene.aimed_at(scene.target.changed(theta=None))
        folders["open angle"] = Library(open_angle, manipulator).folder
    for field in dataclasses.fields(scene):
        if field.name not in FREE:
            for place, other in changed_numbers(getattr(scene, field.name), field.name):
                edited = copy.copy(scene)
                object.__setattr__(edited, field.name, other)
                folders[place] = Library(edited, manipulator).folder
    assert len(folders) > 20 and len(set(folders.values())) == len(folders)
    # One number of `u` more for each interval and coordinate.
    finer = scene.replace(mesh=scene.mesh.changed(carry=scene.mesh.carry + 1))
    assert Library(finer, manipulator).folder not in folders.values()


def test_a_library_outlives_a_change_of_the_sources(tmp_path) -> None:
    code = "import throwplan as tp; print(tp.__file__, tp.Planner('hand-flip').library.folder.name)"

    def folder_of(path: Path) -> list[str]:
        environment = os.environ | {"PYTHONPATH": str(path)}
        command = [sys.executable, "-c", code]
        return subprocess.check_output(command, env=environment, text=True).split()

    package = tmp_path / "throwplan"
    shutil.copytree(Path(tp.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    place, before = folder_of(tmp_path)
    assert Path(place).is_relative_to(tmp_path)
    for path in package.rglob("*.py"):
        path.write_text(path.read_text(encoding="utf-8") + "\n# A comment.\n", encoding="utf-8")
    assert folder_of(tmp_path)[1] == before


@pytest.mark.parametrize(
    ("names", "rounding"),
    [
        (("cup", "held", "passing", "tool speed", "torque"), 1e-6),
        (("clear", "cup", "held", "palm", "passing", "slowing", "tool speed", "torque"), 5e-5),
    ],
)
def test_a_record_has_room_for_all_that_may_be_asked(prepared, names, rounding) -> None:
    asked = Refinement(
        frozenset({"carry", "flight", "passing", "return"}), Margins(**dict.fromkeys(names, 1 / 70))
    )
    optimum = dataclasses.replace(prepared.library.optimum(0), refinement=asked)
    library = Library(prepared.scene, make_manipulator(prepared.scene), keep=False)
    library.add([library.record(optimum, (0.0, 0.0), solved=True)])
    kept = library.optimum(0).refinement
    assert kept.lazy == asked.lazy
    assert dict(kept.margins.values) == pytest.approx(dict(asked.margins.values), abs=rounding)


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


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("margins", b"[1, 2"),
        ("margins", b"null"),
        ("margins", b'{"cup": "wide"}'),
        ("margins", b'{"cup": 1e999}'),
        ("margins", b"\xff\xfe"),
        ("guards", b"\xff\xfe"),
        ("guards", b"no-name"),
        ("binding", b"\x80"),
        ("u", 1e30),
        ("u", -1.0),
        ("u", math.nan),
        ("slope", math.inf),
        ("detach", -1e4),
        ("effort", 0.0),
        ("landing", 1e20),
        ("nlp_size", -1),
    ],
)
def test_records_that_are_none_are_passed_over(
    prepared, field: str, value, tmp_path, monkeypatch
) -> None:
    rows = prepared.library.records.copy()
    rows[field][::2] = value
    kept_as(prepared, rows, monkeypatch, tmp_path)
    assert len(reopened(prepared).records) == len(rows) // 2


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
    other.add(rows[40:50])
    one.merge()
    assert len(reopened(prepared).records) == 50


def test_a_full_disk_costs_the_file_only(prepared, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    library, rows = reopened(prepared), list(prepared.library.records)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        library.add(rows[:10])
    assert len(library.records) == 10 and len(reopened(prepared).records) == 0
    library.add(rows[10:20])
    assert len(reopened(prepared).records) == 10


def test_far_from_all_of_them_a_target_is_out_of_reach(plain, prepared) -> None:
    far = plain.scene.target.in_plane(50.0, 0.0)
    before, after = plain.plan(far), prepared.plan(far)
    assert before.status == after.status == "out_of_reach"
    # From throws at the edge the way to the nearest possible landing is no longer.
    nearest = [plan.nearest.plane_x for plan in (before, after)]
    assert nearest[1] > nearest[0] - 0.02 and after.binding


def test_the_nearest_landing_beyond_the_edge_can_be_thrown_to(prepared) -> None:
    target = prepared.scene.target
    farthest = prepared.library.landings(target.z)[0].max()
    answer = prepared.plan(target.in_plane(4.27, 8.9))
    assert answer.status == "out_of_reach" and answer.binding
    assert farthest < answer.nearest.plane_x < 4.27
    assert prepared.plan(answer.nearest).solved
    x, theta, _ = prepared.library.landings(target.z)
    first = x.argmin()
    answer = prepared.plan(target.in_plane(float(x[first]) - 3.0, float(theta[first])))
    assert answer.status == "out_of_reach" and answer.binding
    assert prepared.plan(answer.nearest).solved


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


def test_throws_of_the_boundary_land_where_they_say(prepared: tp.Planner) -> None:
    target = prepared.scene.target
    found = list(prepared.library.nearest_of_boundary(target, "exact", 8))
    assert len(found) >= 4
    assert [one.distance for one in found] == sorted(one.distance for one in found)
    for near in found:
        assert near.optimum.binding
        landing = near.goal.shifted(*near.miss)
        assert prepared.plan(landing).solved


@pytest.mark.slow
def test_throws_that_growth_moved_land_where_they_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    planner = tp.Planner(tp.load_scene("pose"))
    assert planner.prepare(60) >= 60
    library, scene = planner.library, planner.scene
    # A throw that was moved keeps the slope of the one it began with.
    slopes = library.records["slope"][library.records["solved"]]
    assert len(np.unique(slopes, axis=0)) < len(slopes)
    x, theta, _ = library.landings(scene.target.z)
    for k in range(len(library)):
        planned, opening = library.controls.motion(library.optimum(k).u)
        samples = send(planner.manipulator, planned)
        thrown = Throw.sent(scene, planner.manipulator, planned, samples, opening).landing
        assert abs(thrown.x - x[k]) < 2e-5 and abs(thrown.theta - theta[k]) < 2e-4


@pytest.mark.slow
def test_beyond_the_reach_a_library_names_the_nearest(boxes: tp.Planner) -> None:
    """With few NLPs, inside the base column without any; a search without it finds none nearer."""
    planner, alone = boxes, tp.Planner("box", library=False)
    lever = planner.scene.object.half_length
    x, theta, _ = planner.library.landings(planner.scene.target.z)
    for place in (0.03, 0.08, 2.2, -2.2):
        target = planner.scene.target.in_plane(place, None)
        plan, other = (one.plan(target, patience=60.0) for one in (planner, alone))
        assert plan.status == other.status == "out_of_reach"
        if abs(place) < 0.1:
            assert plan.iterations == 0 and plan.binding == ("base column",)
        else:
            assert plan.binding and plan.iterations < 300
        away, most = (target.distance(one.nearest, lever) for one in (plan, other))
        assert away < 1.1 * most
        assert away < 1.001 * planner.scene.object.pose_error(*target.miss(x, theta)).min()
        assert planner.plan(plan.nearest).solved


@pytest.mark.slow
def test_a_library_answers_before_releases_are_drawn(boxes: tp.Planner, monkeypatch) -> None:
    """Which would take ten times as long as the answer."""
    monkeypatch.setattr("throwplan.planner.search.candidates.drawn_towards", None)
    for place in (2.3, -2.3):
        plan = boxes.plan(boxes.scene.target.in_plane(place, None), patience=60.0)
        assert plan.status == "out_of_reach" and plan.binding, plan.message


@pytest.mark.slow
def test_a_hand_s_library_answers_far_from_the_target_with_few_nlps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A search without it tries 25 more starts, and its nearest landing is no nearer."""
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    planner, alone = tp.Planner("hand-box"), tp.Planner("hand-box", library=False)
    planner.prepare(150)
    for place in (3.2, -3.4):
        target = planner.scene.target.in_plane(place, None)
        plan, other = (one.plan(target, patience=60.0) for one in (planner, alone))
        assert plan.status == other.status == "out_of_reach"
        assert plan.binding and plan.iterations < 200 < other.iterations
        away, most = (target.distance(one.nearest, 1.0) for one in (plan, other))
        assert away < 1.01 * most
        assert planner.plan(plan.nearest).solved


@pytest.mark.slow
def test_a_library_is_no_evidence_for_targets_of_another_kind(boxes: tp.Planner) -> None:
    """Its throws with theta open show nothing of targets with an angle, which are searched for."""
    alone, own = tp.Planner("box", library=False), boxes.scene.target
    for x, theta in ((0.9, 1.0), (1.2, -2.0), (2.3, 0.5)):
        target = dataclasses.replace(own.in_plane(x, None), theta=theta)
        plan, other = (one.plan(target, patience=60.0) for one in (boxes, alone))
        assert plan.status == other.status and plan.attempts == other.attempts


def test_turns_alternatives_and_a_choice(prepared) -> None:
    target = next(t for t in targets(prepared, 4) if prepared.plan(t).solved)
    turned = prepared.plan(target.turned(-6 * math.pi), turns="any")
    turns = (turned.target.theta - target.theta) / (2 * math.pi)
    assert turned.solved and turns == pytest.approx(round(turns), abs=1e-9)
    several = prepared.plan(target, alternatives=2)
    assert several.solved
    for other in several.alternatives:
        assert other.throw.effort >= several.throw.effort
        assert other.error_sent()[0] <= prepared.scene.tolerance.position
    # No attempt is begun when the time is over.
    assert prepared.plan(target, patience=1e-9).status == "not_converged"


def test_it_serves_other_weights_of_the_cost(prepared) -> None:
    target = next(t for t in targets(prepared, 4) if prepared.plan(t).solved)
    fast = tp.Planner(prepared.scene.replace(cost=Cost(time=100.0)))
    assert fast.prepared == prepared.prepared
    plain, sooner = prepared.plan(target), fast.plan(target)
    assert sooner.solved and sooner.throw.opening_time < plain.throw.opening_time - 0.02


def test_its_throws_have_the_usual_weights(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    scene = tp.load_scene("hand-box")
    assert tp.Planner(scene.replace(cost=Cost(time=100.0))).prepare(10) > 0
    planner, cold = tp.Planner(scene), tp.Planner(scene, library=False)
    x, _, _ = planner.library.landings(scene.target.z)
    target = scene.target.changed(x=float(x.max()) - 0.005)
    known, solved = planner.plan(target), cold.plan(target)
    assert planner.prepared and known.solved and solved.solved
    assert known.throw.opening_time == pytest.approx(solved.throw.opening_time, abs=5e-3)


def test_without_a_cache_folder_nothing_is_kept(monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", "")
    assert tp.Planner(tp.load_scene("hand-box")).prepare(5) > 0


def test_the_map_shows_it(prepared, tmp_path) -> None:
    found = tp.reach_map(prepared.scene, samples=3000)
    assert found.solved.shape == (2, prepared.prepared)
    x, theta, _ = prepared.library.landings(prepared.scene.target.z)
    np.testing.assert_allclose(found.solved, [x, theta])
    assert found.to_dict()["solved"] == prepared.prepared and "library:" in found.summary()
    assert found.save(tmp_path).parent.joinpath("map.png").stat().st_size > 10_000


@pytest.mark.slow
def test_places_out_of_reach_are_of_the_library_s_height(boxes: tp.Planner) -> None:
    z = boxes.scene.target.z
    here, above = (tp.reach_map(boxes.scene, samples=3000, z=height) for height in (z, z + 0.2))
    assert here.beyond.size and not above.beyond.size
    assert here.solved.shape == above.solved.shape
    assert "out of reach" in here.summary() and "out of reach" not in above.summary()
