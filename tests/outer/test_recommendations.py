"""Fails if a plan goes beyond what a maker recommends, or a margin, and does not say so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.models.robot import SpatialArm
from throwplan.planner.throw import TICK
from throwplan.planner.verdict import Code, measures_of, verdict_on

from oracle import read_oracle

ARM_SCENES = [name for name in tp.scene_names() if tp.load_scene(name).robot is not None]
EVERY_DAY = ("cup", "pose", "ur5e")


def tool_speed(plan: tp.Plan) -> float:
    """Highest speed [m/s] of flange and pads' centre, by differences of what is sent."""
    path, arm = plan.path(), plan.scene.arm
    flange = SpatialArm(arm).frames(path.joints)[-1]
    pads = flange[:, :3, 3] + arm.tool.tcp * flange[:, :3, 2]
    moved = np.diff([flange[:, :3, 3], pads], axis=1) / TICK
    return float(np.linalg.norm(moved, axis=2).max())


@pytest.mark.parametrize(
    "name", [n if n in EVERY_DAY else pytest.param(n, marks=pytest.mark.slow) for n in ARM_SCENES]
)
def test_shipped_scenes_keep_all_that_makers_recommend(plan_of, saved, name: str) -> None:
    """Tool speed and torque by code of their own; no shipped scene has a warning."""
    plan = plan_of(name)
    assert plan.solved and not plan.exceeds and not plan.verdict.warnings
    limits = plan.scene.arm.limits
    assert tool_speed(plan) <= limits.tool_speed * (1 + 1e-6)
    throw = plan.throw.deciding
    found = read_oracle(saved(name)).judge(planned=True).found
    assert float(found["torque"].value[0]) <= 0.9 + 1e-4
    assert measures_of(throw).value("rate")[0] <= limits.torque_rate


def test_the_verdict_keeps_the_margin_that_the_nlp_keeps() -> None:
    """A throw that uses more than the margin leaves is not solved; with a smaller margin it is."""
    wide = tp.plan(varied(tp.load_scene("pose"), torque=tp.Torque(margin=0.0)))
    throw = wide.throw.deciding
    use = float(measures_of(throw).torque[0].max())
    assert wide.solved and use > 0.9
    for margin, kept in ((1 - use + 0.01, False), (1 - use - 0.01, True)):
        scene = varied(throw.scene, torque=tp.Torque(margin=margin))
        assert (Code.TORQUE not in verdict_on(throw.in_scene(scene)).codes) == kept


@pytest.mark.parametrize("name", ["near-cup", "hand-flip"])
def test_the_verdict_keeps_the_grip_s_margin(plan_of, name: str) -> None:
    """A throw that uses more than [gripper] sticking_margin leaves breaks it, short of slipping."""
    throw = plan_of(name).throw.deciding
    use = float(measures_of(throw).value("grip")[0])
    assert use <= 1.0 - throw.scene.gripper.sticking_margin + 0.002
    for margin, kept in ((1 - use + 0.01, False), (1 - use - 0.01, True)):
        scene = varied(throw.scene, gripper={"sticking_margin": margin})
        judged = verdict_on(throw.in_scene(scene))
        assert (Code.SLIP_BEFORE_OPENING not in judged.codes) == kept
        assert judged.reserves == (not kept)


def test_a_scene_may_ask_for_more_and_the_plan_says_by_how_much() -> None:
    scene = tp.load_scene("pose")
    scene = varied(
        scene,
        torque=tp.Torque(rate=2e4, margin=0.02),
        robot={"tool_speed": 2.5},
        gripper={"force": 120.0},
    )
    plan = tp.plan(scene)
    said = plan.to_dict()["exceeds"]
    assert plan.solved
    assert said["grip_force"] == {"value": 120.0, "recommended": 70.0}
    assert said["torque_rate"]["recommended"] == 1000.0
    assert 1000.0 < said["torque_rate"]["value"] <= 2e4
    lines = [line for line in plan.summary().splitlines() if "the maker recommends" in line]
    assert len(lines) == len(said)
    for key, most in (("[gripper] force", "70"), ("[torque] rate", "1000")):
        assert sum(f"{key} = {most}" in line for line in lines) == 1


def test_a_grippers_spread_is_the_scenes_uncertainty_where_that_is_silent(tmp_path: Path) -> None:
    shipped = Path(tp.__file__).parent / "problems" / "grippers" / "franka-hand.toml"
    lines = "delay = {{ uniform = 0.004 }}\nopening_spread = {{ uniform = 0.5, relative = true }}\n"
    text = shipped.read_text(encoding="utf-8").replace("capsules", lines.format() + "capsules", 1)
    (tmp_path / "hand.toml").write_text(text, encoding="utf-8")
    scene_text = tp.scene_text("pose").replace('"franka-hand"', '"hand.toml"')
    for name, more in (("silent", ""), ("own", "dwell = 0.06\nopening = 0.04\n")):
        file = tmp_path / f"{name}.toml"
        file.write_text(scene_text.replace("force = 70.0", f"{more}force = 70.0"), encoding="utf-8")
    silent, own = (tp.load_scene(tmp_path / f"{name}.toml") for name in ("silent", "own"))
    assert silent.uncertainty.delay.uniform == 0.004
    assert silent.uncertainty.opening.uniform == 0.5 and silent.uncertainty.opening.relative
    assert own.uncertainty is None
    assert set(silent.assumed) - set(own.assumed) == {"gripper.dwell", "gripper.opening"}
