"""Fails if an FR3's controller refuses a motion, or a run over its protocol does not throw.

franky-sim speaks the protocol and lags by 0.1 s; franka-sim has the rules of the controller. `make
verify` installs both.
"""

from __future__ import annotations

import importlib
import subprocess
import sys
from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest
import throwplan as tp
from builders import loud
from throwplan.planner.reach import reach_map
from throwplan.robots import approach, joint_motion

HOST = "127.0.19.1"


@pytest.fixture(scope="module")
def robot() -> Iterator[str]:
    """The address of a simulated FR3, served by a process of its own."""
    pytest.importorskip("pylibfranka")
    pytest.importorskip("franky_sim")
    words = [sys.executable, "-u", "-m", "franky_sim.run_server", "-s", "mujoco"]
    server = subprocess.Popen(
        [*words, "--hostname", HOST], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        assert server.stdout is not None
        assert any("Ctrl+C" in line for line in server.stdout)
        yield HOST
    finally:
        server.kill()
        server.communicate()


def half_open(robot: str) -> None:
    """Closes the gripper of the simulated robot as if it held something."""
    importlib.import_module("pylibfranka").Gripper(robot).move(0.04, 0.1)


def over_map(scene: str, seed: int) -> Iterator[tp.Plan]:
    """Solved plans to random places of random bins of a scene's map."""
    found = reach_map(loud(scene), samples=20000)
    planner, rng = tp.Planner(found.scene), np.random.default_rng(seed)
    assert found.scene.target is not None and found.theta_edges is not None
    bins = np.argwhere(found.landings > 0)
    for i, j in bins[rng.permutation(len(bins))]:
        x, theta = (
            float(rng.uniform(*edges[k : k + 2]))
            for edges, k in ((found.x_edges, i), (found.theta_edges, j))
        )
        plan = planner.plan(found.scene.target.in_plane(x, theta))
        if plan.solved:
            yield plan


@pytest.mark.slow
def test_a_robot_throws_and_what_it_did_is_recorded(
    robot, loud_plan_of, tmp_path, run, table
) -> None:
    plan = tmp_path / "plan"
    loud_plan_of("fr3").save(plan)
    shown = run("run --dry --json", plan, "--robot", robot).json
    assert shown["approach"]["duration"] > 1.0
    out = tmp_path / "out"
    said = run("run --yes --json", plan, "--robot", robot, "--out", out)
    assert said.status == 0 and "to the start pose" in said.err
    (thrown,) = said.json["runs"]
    rows = table(out / "run.csv")
    assert [path.name for path in out.iterdir()] == ["run.csv"]
    # It opened, in the cycle of its command; it lagged, and landed elsewhere.
    motion = joint_motion(plan)
    assert thrown["command_time"] == pytest.approx(motion.throw.command_time, abs=0.02)
    assert thrown["width"][1] > thrown["width"][0] + 0.03
    assert 0.03 < thrown["lag"] < 0.1 and thrown["error"]["position"] > 0.05
    assert rows["t"][0] == 0.0 and rows["t"][-1] > motion.times[-1]
    assert abs(rows["sent4"] - rows["q4"]).max() < 0.1
    # The same from the recording, and the next run.
    again = run("correct --json", plan, out / "run.csv").json
    assert again["recorded"]["error"] == pytest.approx(thrown["error"], abs=1e-6)
    after = ("--after", out / "run.csv", "--out", out)
    half_open(robot)
    better = run("run --yes --json", plan, "--robot", robot, *after).json["runs"][0]
    assert better["error"]["position"] < thrown["error"]["position"] / 10
    assert better["error"]["angle"] < thrown["error"]["angle"] / 10


@pytest.mark.slow
def test_a_rehearsal_opens_nothing(robot, saved, run) -> None:
    said = run("run --yes --json --rehearse", saved("fr3"), "--robot", robot)
    assert said.status == 0 and "times as slow" in said.err
    before, after = said.json["width"]
    assert after == pytest.approx(before, abs=1e-3)
    # Slowly the joints follow.
    assert said.json["lag"] < 0.03 and said.json["duration"] > 1.5


def refusals(q: np.ndarray) -> list[str]:
    """What an FR3's controller refuses in joint positions (N, 7) sent at 1 kHz."""
    modes = pytest.importorskip("franka_sim.control_modes")
    checker = pytest.importorskip("franka_sim.limits.checker").MotionLimitChecker(enforce=True)
    state = {"q": q[0].tolist(), "q_d": q[0].tolist(), "dq_d": [0.0] * 7, "ddq_d": [0.0] * 7}
    checker.start_motion(modes.ControlMode.POSITION, state)
    found = []
    for number, row in enumerate(q.tolist(), start=1):
        command = {"q_c": row, "message_id": number}
        checker.note_published(number)
        violation = checker.check(command, row)
        if violation is not None:
            found.append(f"row {number}: {violation}")
        checker.record(command)
    return found


def test_an_fr3s_controller_takes_a_throw_and_a_cycle(saved, cycled) -> None:
    motion = joint_motion(saved("fr3"))
    assert refusals(motion.q) == [] == refusals(joint_motion(cycled).q)
    home = np.array([0.0, 0.0, 0.0, -1.57, 0.0, 1.57, 0.785])
    assert refusals(approach(motion, home)) == []
    # They would see what is too fast, and what jerks.
    assert refusals(motion.q[::8])
    spoilt = motion.q.copy()
    spoilt[100:, 3] += 1e-3
    assert refusals(spoilt)


@pytest.mark.slow
def test_an_fr3s_controller_takes_targets_over_the_map(tmp_path) -> None:
    for plan in islice(over_map("fr3", seed=20), 8):
        plan.save(tmp_path)
        assert refusals(joint_motion(tmp_path).q) == [], plan.target
