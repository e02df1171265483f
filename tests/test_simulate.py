"""`simulate` from the command line and from Python: all models, statuses, scene motions."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.cli import main

NAMES = ("sp", "sp-paper", "ls", "ls-smooth", "ils", "ls-step", "patch", "lugre")
SCENES = Path(__file__).parent.parent / "problems/scenes"


def test_all_models_of_the_drop_as_json(capsys) -> None:
    assert main(["simulate", "drop", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["scene"] == "drop" and tuple(result["models"]) == NAMES
    for name, model in result["models"].items():
        assert set(model) == {"status", "detach", "landing", "events", "time"}
        assert model["landing"] is None
        assert (model["status"] == "ok") == (not name.startswith("ls") or name == "ls-step")
    rates = {name: model["detach"]["omega"] for name, model in result["models"].items()}
    for name in ("sp", "sp-paper", "ils", "ls-step", "patch", "lugre"):
        assert rates[name] == pytest.approx(-1.035, abs=0.02)
    assert result["models"]["sp"]["events"] == pytest.approx(
        {"pivot": 0.02275, "slide": 0.0487736}, abs=1e-6
    )


def test_a_model_that_fails_is_shown_and_the_others_go_on(tmp_path: Path, capsys) -> None:
    text = (SCENES / "drop.toml").read_text()
    text = text.replace("opening = 0.05", "opening = 2.0").replace("force = 50.0", "force = 2000.0")
    text += "acceleration = [300.0, 200.0]\nangular_acceleration = 500.0\nrate = 9.0\n"
    (tmp_path / "hard.toml").write_text(text)
    assert main(["simulate", str(tmp_path / "hard.toml"), "--json"]) == 0
    models = json.loads(capsys.readouterr().out)["models"]
    failing = [name for name, model in models.items() if model["status"] != "ok"]
    assert {"ls", "sp"} <= set(failing) and "ls-step" not in failing
    assert main(["simulate", str(tmp_path / "hard.toml")]) == 0
    assert "ls: not to be trusted" in capsys.readouterr().out


def test_landing_is_given_where_there_is_a_height(capsys) -> None:
    scene = tp.load_scene("drop").replace(target=tp.Pose(x=0.0, z=-1.0))
    for simulation in tp.simulate(scene).values():
        landing = simulation.to_dict()["landing"]
        assert landing["z"] == -1.0 and 0.05 < landing["x"] < 0.15


def test_pressure_of_the_scene_reaches_the_meshed_models() -> None:
    scene = tp.load_scene("drop-2cm")
    hertz = scene.replace(contact=dataclasses.replace(scene.contact, pressure="hertz"))
    one, other = (tp.simulate(s, "patch")["patch"].release for s in (scene, hertz))
    assert abs(one.com_twist[2, -1] - other.com_twist[2, -1]) > 1e-7


@pytest.mark.parametrize(
    "motion",
    [
        {"times": (0.0, 0.02), "accelerations": ((1.0, 0.0, 0.0), (0.0, 2.0, 5.0))},
        {"acceleration": (3.0, -2.0), "angular_acceleration": 8.0},
    ],
)
def test_batch_throws_the_scenes_own_motion(motion) -> None:
    scene = tp.load_scene("drop")
    scene = scene.replace(motion=dataclasses.replace(scene.motion, **motion))
    alone = tp.simulate(scene, "sp")["sp"].release
    batch = tp.simulate_batch(scene, contact={"friction": [0.8, 0.8]}).detach
    assert batch[1, :3] == pytest.approx(alone.com[:, -1], abs=1e-5)
    assert batch[0, 3:] == pytest.approx(alone.com_twist[:, -1], abs=2e-3)


def test_batch_refuses_motions_that_do_not_cover_the_opening() -> None:
    scene, t = tp.load_scene("drop"), np.linspace(0, 0.06, 20)
    poses = np.zeros((1, 20, 3))
    for hand, words in (
        ({"times": t, "poses": poses, "delays": [0.0, 0.02]}, "must cover 0 to 0.07"),
        ({"times": t, "poses": poses, "delays": [-0.01]}, "must cover -0.01"),
        ({"times": t, "poses": poses, "twist": np.zeros((1, 3))}, "not both"),
    ):
        with pytest.raises(tp.InputError, match=words):
            tp.simulate_batch(scene, hand=hand)


# Found by a reviewer.


def test_a_hand_keeps_its_range_while_it_brakes(tmp_path: Path) -> None:
    scene = tp.load_scene("hand-box")
    tight = scene.replace(
        hand=dataclasses.replace(scene.hand, z=(0.66, 0.74), x=(-0.4, 0.25)),
        gripper=dataclasses.replace(scene.gripper, opening=0.1),
    )
    plan = tp.plan(tight)
    assert plan.solved
    plan.save(tmp_path, draw=False)
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    assert table["z"].max() <= 0.74 and table["z"].min() >= 0.66
    assert table["x"].max() <= 0.25
    assert np.abs([table["vx"], table["vz"]]).max() <= 3.0
    assert np.abs([table["ax"], table["az"]]).max() <= 30.0
    assert table["vx"][-1] == table["vz"][-1] == 0.0


def test_a_target_at_the_apex_gets_an_answer() -> None:
    plan = tp.Planner(tp.load_scene("hand-box")).plan(tp.Pose(x=-0.2, z=1.33))
    assert plan.status in ("solved", "not_converged", "out_of_reach") and plan.message


def test_total_time_is_the_time_that_passed() -> None:
    planner = tp.Planner(tp.load_scene("hand-flip"))
    planner.plan()
    start = time.perf_counter()
    total = planner.plan().time["total"]
    assert total == pytest.approx(time.perf_counter() - start, rel=0.1, abs=0.02)


def test_landing_bounds_are_kept_by_the_exact_model() -> None:
    text = tp.load_scene("pose")
    from throwplan.problems.scene import Landing

    plan = tp.plan(text.replace(landing=Landing(speed_max=3.2, rate_max=3.0)))
    assert plan.solved
    state = plan.throw.sent.landing.state
    assert math.hypot(state.v_x, state.v_z) <= 3.2 and abs(state.omega) <= 3.0


def test_any_turn_means_any() -> None:
    plan = tp.plan("pose", tp.Pose(x=1.2, z=0.1, theta=20 * math.pi), turns="any")
    assert plan.solved


def test_negative_x_with_an_azimuth_is_refused(capsys) -> None:
    status = main(["plan", "box", "--target", "-0.6", "0.1", "free", "--azimuth", "10"])
    assert status == 2 and "above 0 with --azimuth" in capsys.readouterr().err


def test_letting_go_at_rest_is_found() -> None:
    scene = tp.load_scene("hand-box")
    slow = scene.replace(hand=dataclasses.replace(scene.hand, speed=1e-3))
    assert tp.plan(slow, tp.Pose(x=0.0, z=0.0)).solved


@pytest.mark.parametrize("angle", ["-9e1", "-90", "-9.0E1"])
def test_negative_exponents_are_numbers(angle: str, capsys) -> None:
    assert main(["plan", "cup", "--target", "0.9", "0.22", angle, "--json"]) == 0
    target = json.loads(capsys.readouterr().out)["target"]
    assert target["theta"] == pytest.approx(-math.pi / 2)


def test_byte_order_mark_and_null_byte(tmp_path: Path, capsys) -> None:
    text = (SCENES / "hand-box.toml").read_text()
    before, after = text.index("[gripper]"), text.index("[hand]")
    rows = "\n".join(f"{0.01 * k},{max(50 - 10 * k, 0)}" for k in range(6))
    (tmp_path / "grip.csv").write_text(f"\ufefft,f_N\n{rows}\n", encoding="utf-8")
    for name, status in (("grip.csv", 0), ("a\\u0000b", 2)):
        gripper = f'[gripper]\ntable = "{name}"\n'
        (tmp_path / "scene.toml").write_text(text[:before] + gripper + text[after:])
        assert main(["plan", str(tmp_path / "scene.toml")]) == status
    assert capsys.readouterr().err.count("\n") == 1
