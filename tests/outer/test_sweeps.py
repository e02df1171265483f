"""Fails if a sweep counts another share than its throws have, or its seed does not fix it."""

from __future__ import annotations

import dataclasses
import json
import math
import threading
from concurrent.futures import ThreadPoolExecutor

import matplotlib.image
import numpy as np
import pytest
import throwplan as tp

KEYS = {
    *("scene", "samples", "model", "robust", "success", "bias", "quantiles", "sensitivity"),
    "time",
}


@pytest.fixture(scope="module")
def delay(plan_of) -> tp.Plan:
    return plan_of("delay")


def test_what_is_not_given_is_assumed_and_named(delay) -> None:
    """Delay and opening; 0 says that there is no spread."""
    spreads = {"delay": tp.Distribution(uniform=0.005), "opening": tp.Distribution(uniform=0.0)}
    rates = []
    for known in ((), ("delay",), ("delay", "opening")):
        given = tp.Uncertainty(**{name: spreads[name] for name in known}) if known else None
        plan = dataclasses.replace(delay, scene=delay.scene.replace(uncertainty=given))
        found = tp.sweep(plan, samples=256)
        result = found.to_dict()
        missing = [name for name in spreads if name not in known]
        assert result["assumed"] == [f"uncertainty.{name}" for name in missing]
        assert ("assumed" in found.summary()) == bool(missing)
        rates.append(result["success"]["rate"])
    assert rates[0] <= rates[1] < rates[2]
    assert result["uncertain"] == ["delay"]
    assert result["sensitivity"]["delay"]["share"]["x"] > 0.95


def test_an_open_angle_does_not_count(plan_of) -> None:
    found = tp.sweep(plan_of("hand-box"), samples=200).to_dict()
    assert found["bias"]["angle"] == 0.0
    assert found["quantiles"]["scaled"] == pytest.approx(found["quantiles"]["position"])


def test_there_is_nothing_to_sweep_over(delay) -> None:
    none = tp.Distribution(uniform=0.0)
    scene = delay.scene.replace(uncertainty=tp.Uncertainty(delay=none, opening=none))
    with pytest.raises(tp.InputError, match="nothing is uncertain"):
        tp.sweep(dataclasses.replace(delay, scene=scene))


def test_success_of_a_cup_is_going_in(plan_of) -> None:
    result = tp.sweep(plan_of("near-cup"), samples=512).to_dict()
    assert result["assumed"]
    assert result["in_cup"]["rate"] >= result["success"]["rate"] > result["in_tolerance"]["rate"]
    # A throw fails by one limit or several; outside the tolerance but in the cup is no failure.
    failed, shares = 1 - result["success"]["rate"], result["broken"]
    assert "landing" not in shares and max(shares.values()) <= failed <= sum(shares.values())


def test_a_known_mean_delay_moves_the_command() -> None:
    uncertainty = tp.Uncertainty(delay=tp.Distribution(uniform=0.001, mean=0.015))
    late = tp.plan(tp.load_scene("pose").replace(uncertainty=uncertainty))
    release, dwell = late.to_dict()["release"], late.scene.gripper.dwell
    assert release["command_time"] == pytest.approx(release["opening_time"] - dwell - 0.015)
    # The command goes out earlier by the mean, so that the mean throw lands at the target.
    assert tp.sweep(late, samples=64).to_dict()["bias"]["position"] < 5e-4


def test_any_executor_and_the_seed_alone_decides(plan_of) -> None:
    """Of more samples than one worker takes at a time."""

    def result(**options) -> str:
        found = tp.sweep(plan_of("hand-flip"), samples=9000, **options)
        return json.dumps(found.to_dict() | {"time": 0})

    alone = result(seed=7)
    with ThreadPoolExecutor(3) as executor:
        assert result(seed=7, executor=executor) == alone
    other = result(seed=8)
    assert other != alone
    # Of the same distribution.
    one, two = (json.loads(text)["quantiles"]["scaled"]["95"] for text in (alone, other))
    assert two == pytest.approx(one, rel=0.02)


def test_the_command_prints_draws_and_writes(tmp_path, run, table) -> None:
    path, out = tmp_path / "many.toml", tmp_path / "out"
    path.write_text(
        tp.scene_text("hand-flip")
        + "[uncertainty]\ndelay = { uniform = 0.005 }\nfriction = { normal = 0.05 }\n"
        + "hand_omega_deg = { normal = 1.0 }\n"
    )
    said = run("sweep --samples 300 --json --workers 2 --out", out, path)
    assert (said.status, said.err) == (0, "")
    result = said.json
    assert result == json.loads((out / "sweep.json").read_text())
    assert set(result) >= KEYS and result["scene"] == "many"
    assert list(result["sensitivity"]) == ["delay", "opening", "friction", "hand_omega"]
    rows = table(out / "sweep.csv")
    assert rows.size == 300
    assert rows.dtype.names[:6] == ("sample", "delay", "opening", "friction", "hand_omega", "x")
    assert np.abs(rows["delay"]).max() <= 0.005
    assert rows["success"].mean() == pytest.approx(result["success"]["rate"])
    # Wilson's interval: at its ends the rate is 1.96 standard deviations away.
    rate, low, high = (result["success"][key] for key in ("rate", "low", "high"))
    for end in (low, high):
        away = 1.96 * math.sqrt(end * (1 - end) / rows.size)
        assert abs(rate - end) == pytest.approx(away, rel=1e-3, abs=1e-9)
    assert low < high
    scaled = [result["quantiles"]["scaled"][key] for key in ("50", "90", "95", "99")]
    assert scaled == sorted(scaled)
    pictures = {"landings.png", "delay.png", "tornado.png"}
    assert {p.name for p in out.iterdir()} == pictures | {"sweep.csv", "sweep.json"}
    for name in pictures:
        pixels = matplotlib.image.imread(out / name)[:, :, :3]
        assert pixels.shape[0] > 200 and pixels.shape[1] > 600
        assert (pixels < 0.9).any(axis=2).mean() > 0.01, name


def test_a_saved_plan_is_swept_as_before_it_was_saved(plan_of, saved, run, refused) -> None:
    def told(result: dict) -> dict:
        return {key: value for key, value in result.items() if key != "time"}

    before = tp.sweep(plan_of("near-cup"), samples=256)
    for plan in (saved("near-cup"), tp.read_plan(saved("near-cup"))):
        after = tp.sweep(plan, samples=256)
        assert (after.success == before.success).all()
        assert np.abs(after.landings.pose - before.landings.pose).max() < 1e-6
    said = run("sweep --samples 256 --json", saved("near-cup"))
    assert said.status == 0 and told(said.json) == told(after.to_dict())
    assert "--robust: not with a saved plan" in refused("sweep --robust", saved("near-cup"))


def test_without_a_throw(run, planner_of) -> None:
    said = run("sweep hand-box --target 0.3 1.7 free --json")
    assert (said.status, len(said.err.splitlines())) == (3, 1)
    assert said.json["status"] == "not_found"
    failed = planner_of("hand-box").plan(tp.Pose(x=0.3, z=1.7))
    with pytest.raises(tp.InputError, match="not_found"):
        tp.sweep(failed)


def test_an_address_without_a_scheduler_is_named(refused) -> None:
    pytest.importorskip("distributed")
    address, before = "a..b:80", threading.enumerate()
    assert f"--scheduler {address}: " in refused(f"sweep hand-box --scheduler {address}")
    assert set(threading.enumerate()) <= set(before), "a thread is left"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # the cluster's own, about its closing connections
def test_a_dask_cluster_gives_the_same_result(delay, run) -> None:
    distributed = pytest.importorskip("distributed")
    alone = tp.sweep(delay, samples=9000, seed=3).to_dict()
    with (
        distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        found = tp.sweep(delay, samples=9000, seed=3, executor=client.get_executor()).to_dict()
        words = ["--samples", "512", "--json", "--scheduler", cluster.scheduler_address]
        assert run("sweep hand-box", *words).json["samples"] == 512
    assert found | {"time": 0} == alone | {"time": 0}
