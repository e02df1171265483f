"""Fails if the page of the first throw does not run as it stands, or hides an assumption."""

from __future__ import annotations

import dataclasses
import json
import re
import shlex
import subprocess
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from simulated_robot import simulated
from throwplan.robots import commands

ROOT = Path(__file__).parent.parent.parent
PAGE = ROOT / "docs" / "first-throw.md"
SECTIONS = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.M)[1:]
#: A link's mass [kg], its inertia [kg m^2] and its shape.
BODY = """<inertial><mass value="{mass}"/>
<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.06"/></geometry></collision>"""
#: A file that is named and then stands in a block of its own, or the line of a command.
BLOCK = re.compile(r"^`([\w-]+\.toml)`[^\n]*\n\n```toml\n(.*?)^```|^    (\S[^\n]*)", re.M | re.S)


@pytest.fixture
def follow(tmp_path, monkeypatch, run) -> Callable[[int], None]:
    """A function that does what a section of the page says, in a folder with an arm's URDF and the
    examples."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    urdf = (ROOT / "tests" / "data" / "panda.urdf").read_text(encoding="utf-8")
    for number in range(8):
        name, body = f'<link name="panda_link{number}"', BODY.format(mass=3 - 0.2 * number)
        urdf = urdf.replace(f"{name}/>", f"{name}>{body}</link>")
    (tmp_path / "my-robot.urdf").write_text(urdf.replace("panda_link8", "tool0"))

    def command(line: str) -> None:
        name, *words = shlex.split(line, comments=True)
        if name != "throwplan":
            subprocess.run(["bash", "-c", line], check=True)
            return
        if "--robot" in words:
            words.append("--yes")
            robot = simulated(holds="--rehearse" not in words)
            monkeypatch.setattr(commands, "connected", lambda host: nullcontext(robot))
        said = run(*words)
        assert said.status == 0, (line, said.err)

    def following(number: int) -> None:
        section = next(section for section in SECTIONS if section.startswith(f"{number}. "))
        for file, text, line in BLOCK.findall(section):
            if file:
                Path(file).write_text(text, encoding="utf-8")
            else:
                command(line)

    return following


def planned(folder: str) -> dict:
    """A plan that was saved: solved, within all that makers recommend."""
    plan = json.loads((Path(folder) / "plan.json").read_text(encoding="utf-8"))
    assert plan["status"] == "solved" and not plan["exceeds"]
    return plan


def test_the_page_s_scene_is_planned_counted_rehearsed_and_thrown(follow, table) -> None:
    pytest.importorskip("mujoco")
    follow(4)
    plan = planned("out/first")
    assert not plan["assumed"]
    assert 1.05 < plan["landing"]["limit_surface"]["x"] < 1.45
    assert json.loads(Path("out/sweep/sweep.json").read_text())["success"]["rate"] > 0.9
    assert Path("first.png").stat().st_size > 10_000
    follow(5)
    rows = table(Path("out/run/run.csv"))
    assert np.ptp(rows["q2"]) > 0.1 and rows["width"][-1] > rows["width"][0]


@pytest.mark.slow
def test_the_page_s_scene_is_planned_for_an_arm_of_one_s_own(follow, run) -> None:
    pytest.importorskip("yourdfpy")
    follow(1)
    text = re.search(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.S)[1]
    Path("own.toml").write_text(text.replace('"fr3"', '"my-arm.toml"'), encoding="utf-8")
    assert run("plan own.toml --out out/own").status == 0
    plan = planned("out/own")
    assert not plan["assumed"] and plan["torque"] is not None


@pytest.mark.slow
def test_what_is_learnt_from_throws_goes_into_their_scene(follow) -> None:
    follow(6)
    scene, plan = tp.load_scene("next.toml"), planned("out/next")
    assert plan["calibration"]["throws"] == scene.calibration.throws == 90
    product = scene.contact.friction * scene.contact.patch_radius
    assert product == pytest.approx(0.8 * 0.0031, rel=0.1)


def test_the_page_says_how_to_measure_all_that_a_plan_assumes() -> None:
    measured = set()
    for cell in re.findall(r"^\| ([^|]+) \|", PAGE.read_text(encoding="utf-8"), flags=re.M):
        spreads = "±" in cell
        section, _, keys = f"uncertainty {cell}".partition(" ") if spreads else cell.partition(" ")
        measured |= {f"{section}.{key.strip(' ±')}" for key in keys.split(",")}
    assumed = set()
    for name in tp.scene_names():
        scene = tp.load_scene(name)
        uniform = dataclasses.replace(scene.object, inertia=None)
        scene = scene.replace(object=uniform, contact=tp.Contact(friction=0.5))
        assumed |= {*scene.assumed, *(f"uncertainty.{one}" for one in scene.assumed_spreads)}
    assert {name.replace("_", " ") for name in assumed} <= measured
    assert len(assumed) > 8
