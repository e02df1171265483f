"""Fails if a release model throws the drop or a batch otherwise, or a motion is read wrongly."""

from __future__ import annotations

import dataclasses
import io
import json
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.cli import main

#: What `all` runs, in this order.
NAMES = ("sp", "sp-paper", "ls", "ls-smooth", "ils", "ls-step", "patch", "lugre")


@pytest.fixture(scope="module")
def drop(tmp_path_factory) -> dict[str, dict]:
    """The JSON of the drop by every model, as a file too."""
    folder = tmp_path_factory.mktemp("drop")
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["simulate", "drop", "--json", "--out", str(folder)]) == 0
    found = json.loads(printed.getvalue())
    assert found == json.loads((folder / "simulation.json").read_text())
    assert found["scene"] == "drop" and tuple(found["models"]) == NAMES
    pictures = [path for path in folder.iterdir() if path.suffix == ".png"]
    assert pictures and all(path.stat().st_size > 10_000 for path in pictures)
    return found["models"]


@pytest.fixture(scope="module")
def omega(drop) -> dict[str, float]:
    """Turning rates [rad/s] at detach."""
    return {name: one["detach"]["omega"] for name, one in drop.items()}


def test_every_model_has_the_interface_s_keys(drop) -> None:
    for name in NAMES:
        model = drop[name]
        assert set(model) == {"status", "detach", "landing", "events", "time"}
        assert set(model["detach"]) == {"x", "z", "theta", "vx", "vz", "omega"}
        assert set(model["events"]) == {"pivot", "slide"}
        assert model["landing"] is None  # the scene gives no height
        assert (model["status"] == "ok") == (not name.startswith("ls") or name == "ls-step")


def test_the_drop_is_the_paper_s_by_every_model(drop, omega) -> None:
    for name in ("sp", "sp-paper", "ils", "ls-step", "patch", "lugre"):
        assert omega[name] == pytest.approx(-1.035, abs=0.02)
    assert drop["sp"]["events"] == pytest.approx({"pivot": 0.02275, "slide": 0.0487736}, abs=1e-6)


def test_pressure_of_the_scene_reaches_the_meshed_models(drop) -> None:
    hertz = varied(tp.load_scene("drop"), contact={"pressure": "hertz"})
    found = tp.simulate(hertz, "patch")["patch"].to_dict()["detach"]
    assert found["omega"] == pytest.approx(drop["patch"]["detach"]["omega"], rel=2e-3)
    assert abs(found["omega"] - drop["patch"]["detach"]["omega"]) > 1e-7


# Batches.


@pytest.mark.parametrize(
    "motion",
    [
        {"times": (0.0, 0.02), "accelerations": ((1.0, 0.0, 0.0), (0.0, 2.0, 5.0))},
        {"acceleration": (3.0, -2.0), "angular_acceleration": 8.0},
    ],
)
def test_a_batch_throws_the_scene_s_own_motion(motion) -> None:
    scene = varied(tp.load_scene("drop"), motion=motion)
    alone = tp.simulate(scene, "sp")["sp"].to_dict()["detach"]
    batch = tp.simulate_batch(scene, friction=[0.8, 0.8]).detach
    values = list(alone.values())
    assert batch[1, :3] == pytest.approx(values[:3], abs=1e-5)
    assert batch[0, 3:] == pytest.approx(values[3:], abs=2e-3)


def test_a_batch_refuses_motions_that_do_not_cover_the_opening() -> None:
    scene, t = tp.load_scene("drop"), np.linspace(0, 0.06, 20)
    poses = np.zeros((1, 20, 3))
    for more, delays, words in (
        ({}, [0.0, 0.02], "must cover 0 to 0.07"),
        ({}, -0.01, "must cover -0.01"),
        ({"twist": np.zeros((1, 3))}, 0.0, "not both"),
    ):
        with pytest.raises(tp.InputError, match=words):
            tp.simulate_batch(scene, hand={"times": t, "poses": poses} | more, delays=delays)


def test_recorded_motions_of_other_clocks_and_spreadsheets(tmp_path) -> None:
    """The clock may count from 1970; cells may be parted by semicolons, with decimal commas."""
    found = []
    for start, parted in ((0.0, ","), (1.7e9, ","), (0.0, ";")):
        times = (np.arange(0, 121) / 1000).tolist()
        rows = [(start + t, 0.3 * t**2, 1.0, -1.0 + 4 * t) for t in times]
        lines = [parted.join(("t", "x", "z", "theta")), *(parted.join(map(repr, r)) for r in rows)]
        text = "\n".join(lines)
        (tmp_path / "motion.csv").write_text(text if parted == "," else text.replace(".", ","))
        head = tp.scene_text("drop").split("[motion]")[0]
        motion = f'[motion]\ntable = "motion.csv"\nopening_time = {start + 0.05!r}\n'
        (tmp_path / "own.toml").write_text(head + motion)
        detach = tp.simulate(tmp_path / "own.toml", "sp")["sp"].to_dict()["detach"]
        found.append(list(detach.values()))
    # A double counts seconds from 1970 to 0.2 us only, which the spline's accelerations show.
    assert found[1] == pytest.approx(found[0], rel=1e-3)
    assert found[2] == pytest.approx(found[0], rel=1e-9)


def test_a_batch_throws_what_a_plan_sends(plan_of, saved) -> None:
    """With the scene's values and no delay as the plan; each other throw as it is by itself."""
    plan = plan_of("pose")
    own, delays = plan.scene.contact.friction, np.array([0.0, 0.01, -0.01, 0.0])
    friction = own * np.array([1.0, 1.0, 1.0, 0.7])
    found = tp.simulate_batch(plan, friction=friction, delays=delays)
    throw = plan.sent_throw()
    weak = throw.in_scene(varied(throw.scene, contact={"friction": 0.7 * own}))
    for landing, one in zip(found.landing, [*map(throw.delayed, delays[:3]), weak], strict=True):
        expected = one.sliding_pivot.landing
        assert landing[0] == pytest.approx(expected.x, abs=1e-4)
        assert landing[1] == pytest.approx(expected.theta, abs=1e-3)
        assert landing[2] == pytest.approx(expected.flight_time, abs=1e-4)
    read = tp.simulate_batch(tp.read_plan(saved("pose")), friction=friction, delays=delays)
    np.testing.assert_allclose(read.detach, found.detach, atol=1e-6)
    with pytest.raises(tp.InputError, match="holds no throw"):
        tp.simulate_batch(dataclasses.replace(plan, status="not_found"))


# Limit surfaces of other shapes.

#: Lines of [contact] for each shape.
SHAPES = {
    "ellipsoid": 'shape = "ellipsoid"\ncoefficients = [1.0, 1.2, 1.1, 0.1, 0.3, -0.2]',
    "quartic": 'shape = "quartic"\ncoefficients = '
    "[1.2, 0, 0, 2, 0, 2.5, 0, 0, 0, 0.1, 1, 0.2, 2, 0, 1]",
    "two-points": 'shape = "two-points"',
}


def shaped(folder: Path, lines: str, scene: str = "drop") -> Path:
    """A built-in scene with more lines in [contact], as a file."""
    text = tp.scene_text(scene).replace("[contact]\n", f"[contact]\n{lines}\n")
    (folder / "mine.toml").write_text(text)
    return folder / "mine.toml"


@pytest.mark.parametrize("shape", SHAPES)
def test_each_shape_is_simulated_by_the_limit_surface_alone(shape, omega, tmp_path, refused):
    path = shaped(tmp_path, SHAPES[shape])
    found = tp.simulate(path)
    assert list(found) == ["ls-step"]
    assert 1e-4 < abs(found["ls-step"].release.detach.omega - omega["ls-step"]) < 0.1
    assert "ls-step" in refused("simulate", path, "--model", "patch")
    for call in (tp.Planner, tp.simulate_batch, tp.reach_map):
        with pytest.raises(tp.InputError, match=r"mine.toml: \[contact\] shape"):
            call(path)


def test_of_two_points_the_one_on_the_com_s_side_slides_first(tmp_path) -> None:
    """Section V-A of Liu and Billard: about the other point the weight's moment M g (h + c r_p) is
    that of half the friction at a distance of 2 c r_p."""
    scene = tp.load_scene(shaped(tmp_path, SHAPES["two-points"]))
    found = tp.simulate(scene)["ls-step"].to_dict()
    grip, contact, body = scene.gripper.profile(), scene.patch, scene.body
    at_onset = float(contact.force_limit(grip.force(found["events"]["pivot"])))
    arm, weight = contact.torsion_arm, body.mass * scene.gravity
    assert arm * at_onset == pytest.approx(weight * (body.com_offset + arm), rel=1e-7)
    assert found["detach"]["omega"] == pytest.approx(-1.0786, abs=1e-3)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('shape = "round"', "must be one of ellipsoid, quartic, two-points"),
        ('shape = "quartic"', "quartic takes 15 numbers, not 0"),
        ("coefficients = [1.0]", "only with shape"),
        ('shape = "ellipsoid"\ncoefficients = [1, 1, 1, 2, 0, 0]', "the surface is not"),
    ],
)
def test_a_shape_that_is_none_is_refused(lines, words, tmp_path, refused) -> None:
    line = refused("simulate", shaped(tmp_path, lines))
    assert words in line and "[contact]" in line
