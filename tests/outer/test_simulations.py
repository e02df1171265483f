"""Fails if a release model throws the drop or a batch otherwise, or a motion is read wrongly."""

from __future__ import annotations

import dataclasses
import io
import json
from contextlib import redirect_stdout

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


@pytest.mark.parametrize("kind", ["seconds from 1970", "semicolons", "tabs"])
def test_recorded_motions_of_other_clocks_and_spreadsheets(tmp_path, kind) -> None:
    """The clock may count from 1970; cells may be parted by semicolons, with decimal commas."""
    separator = {"semicolons": ";", "tabs": "\t"}.get(kind, ",")
    begin = 1.7e9 if kind == "seconds from 1970" else 0.0

    def detach(name: str, start: float, parted: str) -> list[float]:
        lines = [
            parted.join((f"{start + t!r}", f"{0.3 * t**2!r}", "1.0", f"{-1.0 + 4 * t!r}"))
            for t in (np.arange(0, 121) / 1000).tolist()
        ]
        text = "\n".join([parted.join(("t", "x", "z", "theta")), *lines])
        text = text if parted == "," else text.replace(".", ",")
        (tmp_path / "motion.csv").write_text(text)
        head = tp.scene_text("drop").split("[motion]")[0]
        motion = f'[motion]\ntable = "motion.csv"\nopening_time = {start + 0.05!r}\n'
        (tmp_path / name).write_text(head + motion)
        return list(tp.simulate(tmp_path / name, "sp")["sp"].to_dict()["detach"].values())

    expected = detach("plain.toml", 0.0, ",")
    # A double counts seconds from 1970 to 0.2 us only, which the spline's accelerations show.
    assert detach("other.toml", begin, separator) == pytest.approx(expected, rel=1e-3)


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
