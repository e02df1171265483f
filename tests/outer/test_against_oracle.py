"""Fails if the oracle, which shares no code with the planner, finds a limit broken or a miss."""

from __future__ import annotations

import json

import numpy as np
import pytest
import throwplan as tp

from oracle import read_oracle, read_rows

SCENES = [
    *("pose", "near-cup", "cup", "delay", "fr3", "conveyor", "hand-flip", "ur5e"),
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("box", "flip")),
]
#: Landings agree to this [m], [rad]; shares of limits to this share.
LANDING, SHARE = (1e-4, np.radians(0.05)), 1e-3


@pytest.mark.parametrize("name", SCENES)
def test_nothing_is_wrong_with_a_solved_plan_and_it_lands_where_it_says(name: str, saved) -> None:
    oracle = read_oracle(saved(name))
    plan, found = json.loads((saved(name) / "plan.json").read_text()), oracle.judge(planned=True)
    assert found.broken() == [()]
    said, (x, theta, _) = plan["landing"]["limit_surface"], found.landing[0]
    there = oracle.plane.points(np.array(x), np.array(said["z"]))
    assert np.hypot(there[0] - said["x"], there[1] - said.get("y", 0.0)) < LANDING[0]
    assert abs(theta - said["theta"]) < LANDING[1]
    if "torque" in plan:
        assert found.found["torque"].value[0] == pytest.approx(plan["torque"]["use"], rel=SHARE)


def test_the_oracle_sees_what_is_wrong(saved) -> None:
    """What has too little grip, is too heavy, or opens too late, fails for that."""
    oracle = read_oracle(saved("near-cup"))
    rows = {"friction": [1.0, 0.3, 1.0, 1.0], "mass": [0.24, 0.24, 9.0, 0.24]}
    broken = oracle.judge(rows | {"delay": [0.0, 0.0, 0.0, 0.05]}).broken()
    assert broken[0] == ()
    assert "grip" in broken[1]
    assert "torque" in broken[2]
    assert {"cup", "grip"} & set(broken[3])


@pytest.fixture(scope="module")
def swept(saved, plan_of, tmp_path_factory):
    """Oracle, parameters and findings of a sweep that looks at many parameters."""
    folder = tmp_path_factory.mktemp("sweep")
    tp.sweep(plan_of("near-cup"), samples=32).save(folder / "sweep")
    return read_oracle(saved("near-cup")), *read_rows(folder)


def test_a_sweep_lands_where_the_oracle_does(swept) -> None:
    oracle, rows, found = swept
    landing = oracle.judge(rows).landing
    assert np.abs(landing[:, 0] - found["x"]).max() < LANDING[0]
    assert np.abs(landing[:, 1] - found["theta"]).max() < LANDING[1]
