"""Fails if a wrong argument in Python is taken, or is not one line that names it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import throwplan as tp
from throwplan import InputError, Plan, Planner, Pose, lab, pictures, robots

Call = Callable[[Planner, Plan], object]


CONTACT = {"friction": math.nan, "patch_radius": 0.002}
#: Mistakes of people with a planner `pl` and its plan `p`, and words of the message.
MISTAKES: list[tuple[Call, str]] = [
    # A target.
    (lambda pl, p: pl.plan([1.2, 0.0, 1.0]), "target"),
    (lambda pl, p: pl.plan(np.eye(4)), "target"),
    (lambda pl, p: pl.plan(np.array([1.2, 0.0, np.nan])), "target"),
    (lambda pl, p: pl.plan(np.array([1.2, 0.0, -90.0])), "theta .rad"),
    (lambda pl, p: pl.plan(np.array([True, False, True])), "target"),
    (lambda pl, p: pl.plan("cup"), "target = 'cup'"),
    (lambda pl, p: pl.scene.replace(target=[1.0, 0.0, 0.0]), "target"),
    (lambda pl, p: pl.scene.aimed_at(None), "target = None"),
    (lambda pl, p: pl.plan(Pose(x=1.0, z=0.0, y=0.2)), "y"),
    (lambda pl, p: pl.plan(Pose(x=50.0, z=math.inf)), "z = inf"),
    # A scene and a file.
    (lambda pl, p: Planner("cupp"), "did you mean 'cup'"),
    (lambda pl, p: tp.simulate_batch("dropp"), "did you mean 'drop'"),
    (lambda pl, p: tp.sweep("out/pose"), "out/pose"),
    (lambda pl, p: p.save(""), "--out"),
    (lambda pl, p: pictures.draw(p, "throw.gif"), "file = 'throw.gif'"),
    (lambda pl, p: pictures.draw(p, "absent/throw.png"), "absent/throw.png"),
    # A name.
    (lambda pl, p: tp.sweep(p, model="spp"), "did you mean 'sp'"),
    (lambda pl, p: p.throw.deciding.with_model("spp"), "model = 'spp'"),
    (lambda pl, p: pl.plan(robust="loud"), "robust = 'loud'"),
    (lambda pl, p: pl.plan(solver="snopt"), "solver = 'snopt'"),
    (lambda pl, p: pl.plan(turns="some"), "turns = 'some'"),
    (lambda pl, p: tp.plan("hand-box", turns="any"), "turns = 'any'"),
    # A number.
    (lambda pl, p: pl.plan(alternatives=99), "alternatives = 99"),
    (lambda pl, p: pl.plan(patience=0), "patience = 0"),
    (lambda pl, p: pl.plan(patience=math.nan), "patience = nan"),
    (lambda pl, p: robots.follow(pl, p, math.nan), "horizon = nan"),
    (lambda pl, p: pl.prepare(0), "throws = 0"),
    (lambda pl, p: tp.sweep(p, samples=0), "samples = 0"),
    (lambda pl, p: tp.sweep(p, samples=2.5), "samples = 2.5"),
    (lambda pl, p: tp.sweep(p, seed=-1), "seed = -1"),
    (lambda pl, p: pictures.view(p, port=80_000), "port = 80000"),
    (lambda pl, p: pictures.view(p, hold=-1), "hold = -1"),
    (lambda pl, p: lab.replay(p, step=0), "step = 0"),
    (lambda pl, p: tp.reach_map("pose", z=math.nan), "z = nan"),
    (lambda pl, p: tp.reach_map("pose", samples=2.5), "samples = 2.5"),
    (lambda pl, p: tp.simulate_batch(pl.scene, steps=0), "steps = 0"),
    (lambda pl, p: tp.simulate_batch(p, mass=[]), "mass"),
    (lambda pl, p: tp.simulate_batch(p, hand={"pose": np.zeros(3)}), "hand"),
    (lambda pl, p: tp.simulate_batch(p, delays=[-100.0]), "must cover"),
    (lambda pl, p: tp.simulate_batch(pl), "Planner"),
    (lambda pl, p: p.throw.deciding.delayed(math.nan), "delay = nan"),
    # Arrays and data.
    (lambda pl, p: robots.Response.fitted([[math.nan]] * 3, [[0.0]] * 3), "sent, q"),
    (lambda pl, p: robots.Response.fitted([], []), "sent, q"),
    (lambda pl, p: robots.Response(np.ones(2), np.ones(2)).all(np.ones((5, 3))), "2 joints"),
    (lambda pl, p: lab.throw_data([]), "plans"),
    (lambda pl, p: lab.throw_data([p], [(math.nan, 0.0)]), "landing 1 = nan"),
    (lambda pl, p: lab.throw_data([p], [(1.0, 0.0)] * 2), "landings"),
    (lambda pl, p: lab.throw_data([p], position_noise=-1.0), "position_noise = -1"),
    (lambda pl, p: lab.thrown(lab.throw_data([p]), "sp", {}), "contact"),
    (lambda pl, p: lab.thrown(lab.throw_data([p]), "sp", CONTACT), "friction = nan"),
    (lambda pl, p: lab.throw_data([p]).picked([1]), "numbers"),
    (lambda pl, p: lab.throw_data([p]).picked(np.array([True])), "numbers"),
    (lambda pl, p: lab.identify(lab.throw_data([p])), "throw-1"),
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
    data = lab.throw_data([thrown[1]], np.array([[1.2, 0.3]]))
    assert data.throws[0].landing == (1.2, thrown[1].target.z, 0.3)
