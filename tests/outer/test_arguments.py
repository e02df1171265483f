"""Arguments in Python: InputError with one line for what is of the wrong kind or out of range."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import throwplan as tp
from throwplan import InputError, Plan, Planner, Pose

Call = Callable[[Planner, Plan], object]


class Odd:
    """Of no kind that anything takes; its repr has several lines."""

    def __repr__(self) -> str:
        return "an odd\n\nthing" + " and more" * 100


def entries() -> Iterator[tuple[str, Callable[..., Any], str]]:
    """Every annotated argument of the functions and methods of `throwplan`."""
    for name in tp.__all__:
        value = getattr(tp, name)
        if not inspect.isclass(value):
            known = {name: value}
        elif (hasattr(value, "changed") and value is not tp.Scene) or issubclass(value, Exception):
            continue  # Sections check their fields, which test_scene_files.py tries.
        else:
            members = {key: getattr(value, key) for key in vars(value) if not key.startswith("_")}
            members |= {"__init__": value} if value is Planner else {}
            known = {f"{name}.{key}": one for key, one in members.items() if callable(one)}
        for label, function in known.items():
            for argument in inspect.signature(function).parameters.values():
                free = argument.annotation in (argument.empty, "Any")
                if not free and argument.kind is not argument.VAR_KEYWORD:
                    yield label, function, argument.name


ENTRIES = [pytest.param(f, name, id=f"{label}-{name}") for label, f, name in entries()]


@pytest.mark.parametrize(("function", "name"), ENTRIES)
def test_every_argument_of_another_kind_is_refused_in_one_line(function, name) -> None:
    """Before anything else: no other argument is needed, no method needs its object."""
    method = next(iter(inspect.signature(function).parameters)) == "self"
    with pytest.raises(
        InputError, match=rf"^{name} = an odd thing and .*\.\.\.: must be "
    ) as error:
        function(*[None] * method, **{name: Odd()})
    assert len(str(error.value).splitlines()) == 1 and len(str(error.value)) < 300


def test_most_of_the_public_face_takes_arguments() -> None:
    """So that the test above has something to try."""
    assert len(ENTRIES) > 100


#: Mistakes of people with a planner `pl` and its plan `p`, and words of the message.
MISTAKES: list[tuple[Call, str]] = [
    # A pose.
    (lambda pl, p: pl.plan([1.2, 0.0, 1.0]), r"target = \[1.2, 0.0, 1.0\]: must be a"),
    (lambda pl, p: pl.plan((1.2, 0.0, 1.0)), "must be a Pose or a Region, or an array"),
    (lambda pl, p: pl.plan(np.array([1.2, 0.0])), "target = array.* must be a Pose"),
    (lambda pl, p: pl.plan(np.eye(4)), "target = array.* must be a Pose or a Region"),
    (lambda pl, p: pl.plan(np.array([[1.2, 0.0, 1.0]])), "target = array.*: must be"),
    (lambda pl, p: pl.plan(np.array([1.2, 0.0, np.nan])), "target = array.*: must be"),
    (lambda pl, p: pl.plan(np.array([1.2, 0.0, -90.0])), "must be .*theta .rad"),
    (lambda pl, p: pl.plan(np.array(["a", "b", "c"])), "target = array.*: must be a"),
    (lambda pl, p: pl.plan(np.array([True, False, True])), "target = array.*: must"),
    (lambda pl, p: pl.plan("cup"), "target = 'cup': must be a Pose"),
    (lambda pl, p: pl.plan(0), "target = 0: must be a Pose"),
    (lambda pl, p: pl.check({"x": 1.0}), "target = {'x': 1.0}: must be a Pose"),
    (lambda pl, p: tp.plan("hand-flip", [1.0, 0.0]), r"target = \[1.0, 0.0\]: must be a"),
    (lambda pl, p: pl.scene.replace(target=[1.0, 0.0, 0.0]), "target = .*must be a P"),
    (lambda pl, p: pl.scene.aimed_at(None), "target = None: must be a Pose"),
    (lambda pl, p: pl.plan(Pose(x=1.0, z=0.0, y=0.2)), "y"),
    # A scene.
    (lambda pl, p: Planner(None), "scene = None: must be Scene or a text or Path"),
    (lambda pl, p: Planner({"name": "cup"}), "scene = .*: must be Scene"),
    (lambda pl, p: Planner(pl), "scene = <throwplan.*: must be Scene"),
    (lambda pl, p: Planner("cupp"), "did you mean 'cup'"),
    (lambda pl, p: tp.plan(["cup", "pose"]), r"scene = \['cup', 'pose'\]: must be Scene"),
    (lambda pl, p: tp.simulate_batch("drop"), "scene = 'drop': must be Scene"),
    (lambda pl, p: tp.simulate(3), "scene = 3: must be Scene"),
    (lambda pl, p: tp.load_scene(None), "source = None: must be a text or Path"),
    (lambda pl, p: tp.scene_text(7), "name = 7: must be a text"),
    (lambda pl, p: tp.reach_map(None), "scene = None: must be Scene"),
    (lambda pl, p: tp.calibrate(None, "pose"), "data = None: must be ThrowData or a text"),
    # A model.
    (lambda pl, p: tp.simulate("drop", ["sp", "ls"]), r"model = \['sp', 'ls'\]: must be a t"),
    (lambda pl, p: tp.simulate("drop", None), "model = None: must be a text"),
    (lambda pl, p: tp.simulate_batch(pl.scene, ("sp",)), "model = .*: must be a text"),
    (lambda pl, p: tp.sweep(p, model=["sp"]), "model = .*: must be a text"),
    (lambda pl, p: tp.sweep(p, model="spp"), "must be one of sp, .*did you mean 'sp'"),
    (lambda pl, p: p.throw.deciding.with_model("spp"), "model = 'spp': must be one of sp"),
    # An executor, and functions.
    (lambda pl, p: tp.sweep(p, executor=4), "executor = 4: must be Executor"),
    (lambda pl, p: tp.simulate_batch(pl.scene, executor=2), "executor = 2: must be E"),
    (lambda pl, p: pl.prepare(10, "yes"), "progress = 'yes': must be a function"),
    (lambda pl, p: pl.prepare(10, workers="two"), "workers = 'two': must be a whole"),
    (lambda pl, p: pl.prepare(10, scheduler=8786), "scheduler = 8786: must be a text"),
    (lambda pl, p: tp.reach_map("pose", progress=True), "progress = True: must be a func"),
    # A folder or a file.
    (lambda pl, p: p.save(None), "folder = None: must be a text or Path"),
    (lambda pl, p: p.save(b"out"), "folder = b'out': must be a text or Path"),
    (lambda pl, p: p.save(""), "--out: needs a folder's name"),
    (lambda pl, p: p.save("out", draw="gif"), "draw = 'gif': must be true or false or"),
    (lambda pl, p: p.draw(3), "file = 3: must be a text or Path"),
    (lambda pl, p: tp.read_plan(None), "path = None: must be a text or Path"),
    (lambda pl, p: tp.load_throws(None), "folder = None: must be a text or Path"),
    (lambda pl, p: tp.view(None), "plan = None: must be Plan or Throw or a text or Path"),
    (lambda pl, p: tp.replay(42), "throw = 42: must be Plan or Throw or a text or Path"),
    (lambda pl, p: tp.export(p, franka=1), "franka = 1: must be a text or Path"),
    (lambda pl, p: tp.export(p, ros="out", names="panda"), "names = 'panda': must be a li"),
    # A p.
    (lambda pl, p: pl.plan(warm="out"), "warm = 'out': must be Plan"),
    (lambda pl, p: pl.polish(None), "plan = None: must be Plan"),
    (lambda pl, p: pl.follow(None), "plan = None: must be Plan"),
    (lambda pl, p: pl.follow(p, sent=p), "sent = Plan.*: must be Throw"),
    (lambda pl, p: pl.follow(p, response=1.0), "response = 1.0: must be Response"),
    (lambda pl, p: tp.sweep("out/pose"), "out/pose: no such file"),
    (lambda pl, p: tp.sweep(3), "plan = 3: must be Plan or SavedThrow or a text or Path"),
    (lambda pl, p: tp.throw_data(p), "plans = Plan.*: must be a list, each Plan"),
    (lambda pl, p: tp.throw_data([p, None]), "plans = .*: must be a list, each Plan"),
    (lambda pl, p: tp.throw_data([]), "plans: must be a list of at least one plan"),
    (lambda pl, p: pl.plan(start=3), "start = 3: must be State"),
    # Numbers, choices and tables.
    (lambda pl, p: pl.plan(alternatives=1.5), "alternatives = 1.5: must be a whole"),
    (lambda pl, p: pl.plan(alternatives=99), "alternatives = 99: must be at most 20"),
    (lambda pl, p: pl.plan(patience="3"), "patience = '3': must be a number"),
    (lambda pl, p: pl.plan(patience=0), "patience = 0: must be above 0"),
    (lambda pl, p: pl.plan(patience=math.nan), "patience = nan: must be a finite"),
    (lambda pl, p: pl.plan(robust="loud"), "robust = 'loud': must be one of auto, q"),
    (lambda pl, p: pl.plan(robust=True), "robust = True: must be a text"),
    (lambda pl, p: pl.plan(robust="quiet", alternatives=2), "not with a robust plan"),
    (lambda pl, p: pl.plan(solver="snopt"), "solver = 'snopt': must be one of auto, f"),
    (lambda pl, p: pl.plan(turns="some"), "turns = 'some': must be one of exact, any"),
    (lambda pl, p: pl.follow(p, "20 ms"), "horizon = '20 ms': must be a number"),
    (lambda pl, p: pl.prepare(0), "throws = 0: must be at least 1"),
    (lambda pl, p: Planner("hand-flip", library=1), "library = 1: must be true or false"),
    (lambda pl, p: tp.Response.fitted([[math.nan]] * 3, [[0.0]] * 3), "sent, q: must be"),
    (lambda pl, p: tp.Response.fitted([], []), "sent, q: must be finite numbers"),
    (lambda pl, p: tp.Response.fitted("a", "b"), "sent = 'a': must be numbers"),
    (lambda pl, p: tp.sweep(p, samples=0), "samples = 0: must be at least 1"),
    (lambda pl, p: tp.sweep(p, samples=2.5), "samples = 2.5"),
    (lambda pl, p: tp.sweep(p, samples=True), "samples = True"),
    (lambda pl, p: tp.sweep(p, seed=-1), "seed = -1"),
    (lambda pl, p: tp.view(p, port="8080"), "port = '8080': must be a whole number"),
    (lambda pl, p: tp.view(p, hold=-1), "hold = -1: must be above 0"),
    (lambda pl, p: tp.replay(p, points=-1), "points = -1: must be at least 1"),
    (lambda pl, p: tp.replay(p, points=100_000), "points = 100000: must be at most 64"),
    (lambda pl, p: tp.replay(p, step=0), "step = 0: must be at least 1e-07"),
    (lambda pl, p: tp.reach_map("pose", z=math.nan), "z = nan: must be a finite number"),
    (lambda pl, p: tp.reach_map("pose", samples=2.5), "samples = 2.5: must be a whole"),
    (lambda pl, p: tp.simulate_batch(pl.scene, hand=[0.0] * 3), "hand = .*: must be a t"),
    (lambda pl, p: tp.simulate_batch(pl.scene, steps=0), "steps = 0: must be a whole"),
    (lambda pl, p: tp.simulate_batch(pl.scene, object={"mass": []}), "object.mass: must be fin"),
    (lambda pl, p: p.throw.deciding.delayed("10 ms"), "delay = '10 ms': must be a number"),
    (lambda pl, p: p.throw.deciding.hand("now"), "times = 'now': must be numbers"),
    (lambda pl, p: tp.throw_data([p], [(math.nan, 0.0)]), "landing 1 = nan: must be a"),
    (lambda pl, p: tp.throw_data([p], [(1.0, 0.0)] * 2), "landings: must be 1, one per"),
    (lambda pl, p: tp.throw_data([p], [1.0]), r"landings = \[1.0\]: must be a list, each"),
    (lambda pl, p: tp.throw_data([p], position_noise=-1.0), "position_noise = -1"),
    (lambda pl, p: tp.thrown(tp.throw_data([p]), "sp", {}), "contact: must have fric"),
    (
        lambda pl, p: tp.thrown(
            tp.throw_data([p]), "sp", {"friction": math.nan, "patch_radius": 0.002}
        ),
        "friction = nan: must be a finite number",
    ),
    (lambda pl, p: tp.throw_data([p]).picked([1]), "numbers: must be at least one, each from 0"),
    (lambda pl, p: tp.throw_data([p]).picked([]), "numbers: must be at least one, each from 0"),
    (lambda pl, p: p.draw("throw.gif"), "file = 'throw.gif': must be a .png file"),
    (lambda pl, p: p.draw("absent/throw.png"), "absent/throw.png: No such file"),
    (lambda pl, p: tp.Response(np.array([1.0]), np.array(["a"])), "rate, share: must be finite"),
    (lambda pl, p: tp.Response(np.ones(2), np.ones(2)).all(np.ones((5, 3))), "rows of 2 joints"),
    (lambda pl, p: tp.throw_data([p]).picked(np.array([True])), r"numbers = array\(\[ True\]\)"),
    (lambda pl, p: tp.identify(tp.throw_data([p])), "throw-1: has no landing"),
    (lambda pl, p: tp.identify("data"), "data = 'data': must be ThrowData"),
    (lambda pl, p: tp.identify(tp.throw_data([p]), ["sp"]), "model = .*: must be a text"),
    (lambda pl, p: tp.draw_cup(None, None), "axes = None: must be Axes"),
    (lambda pl, p: tp.draw_flight("axes", p), "axes = 'axes': must be Axes"),
]


@pytest.fixture(scope="module")
def thrown(planner_of, plan_of) -> tuple[Planner, Plan]:
    return planner_of("hand-flip"), plan_of("hand-flip")


@pytest.mark.parametrize(("call", "words"), MISTAKES, ids=[words for _, words in MISTAKES])
def test_mistakes_are_input_errors_of_one_line(call, words, thrown, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=words) as error:
        call(*thrown)
    assert len(str(error.value).splitlines()) == 1 and not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", [float, np.float32, int])
def test_an_array_of_three_numbers_is_a_pose(kind, thrown) -> None:
    planner, _ = thrown
    array = np.array([1, 0, 2], kind)
    assert planner.check(array) == Pose(x=1.0, z=0.0, theta=2.0)
    assert planner.scene.replace(target=array) == planner.scene.replace(target=Pose(1.0, 0.0, 2.0))


def test_numbers_of_numpy_are_numbers(thrown) -> None:
    target = Pose(x=np.float32(1.25), z=np.int64(0), theta=np.float64(1.0))
    assert target == Pose(x=1.25, z=0.0, theta=1.0)
    data = tp.throw_data([thrown[1]], np.array([[1.2, 0.3]]))
    assert data.throws[0].landing == (1.2, thrown[1].target.z, 0.3)
