"""The section [torque]: what it adds, what it keeps, what it refuses."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.check.torque import torque_use
from throwplan.planner.cli import main
from throwplan.problems import Torque, scene_text

#: Under half of the Panda's torques [N m].
WEAK = (45.0, 30.0, 6.0)


def use(plan: tp.Plan, limits: tuple[float, ...] | None) -> tuple[np.ndarray, np.ndarray]:
    """Times and shares of the limits along what a plan sends."""
    assert plan.throw is not None
    scene = plan.scene.replace(torque=Torque(limits=limits))
    samples = plan.throw.samples
    return torque_use(scene, plan.mover, samples, float(samples.times[-1]), plan.throw.opening_time)


@pytest.fixture(scope="module")
def flips() -> dict[tuple[float, ...] | None, tp.Plan]:
    """`flip` without the section, with the arm's limits and with weak ones."""
    scene = tp.load_scene("flip")
    made = {(): tp.plan(scene)}
    for limits in (None, WEAK):
        made[limits] = tp.plan(scene.replace(torque=Torque(limits=limits)))
    return made


def test_the_section_adds_rows_only(flips: dict[tuple[float, ...] | None, tp.Plan]) -> None:
    without, limited = flips[()], flips[None]
    assert without.solved and limited.solved
    assert limited.variables == without.variables
    assert limited.constraints > without.constraints


def test_weak_limits_are_kept(
    flips: dict[tuple[float, ...] | None, tp.Plan],
) -> None:
    plan = flips[WEAK]
    assert plan.solved
    assert use(plan, WEAK)[1].max() <= 1.0


@pytest.mark.parametrize("name", ["pose", "box"])
def test_a_brake_that_takes_too_much_is_asked_for_less(name: str) -> None:
    """The NLP looks at some instants of the brake; the check looks at every sample."""
    plan = tp.plan(tp.load_scene(name).replace(torque=Torque(limits=WEAK)))
    assert plan.solved
    assert use(plan, WEAK)[1].max() <= 1.0


def test_limits_that_bind_change_the_throw() -> None:
    scene = tp.load_scene("cup")
    free = tp.plan(scene)
    _, shares = use(free, (60.0, 30.0, 6.0))
    assert free.solved
    most = shares.max(axis=0)
    limits = tuple(float(v) for v in 0.97 * most * np.array([60.0, 30.0, 6.0]))
    tight = tp.plan(scene.replace(torque=Torque(limits=limits)))
    assert tight.solved
    assert use(free, limits)[1].max() > 1.0
    assert use(tight, limits)[1].max() <= 1.0


def test_at_rest_the_torque_is_the_weight_s_moment() -> None:
    """The first sample: the arm stands still with the bar, so statics alone decide."""
    plan = tp.plan("cup")
    assert plan.throw is not None
    scene, arm = plan.scene, plan.scene.arm
    assert arm is not None
    _, shares = use(plan, (1.0, 1.0, 1.0))
    q = plan.throw.samples.q[0]
    step = 1e-6

    def height_energy(q: np.ndarray) -> float:
        """Potential energy [J] of arm and bar from the full kinematics."""
        kinematics = plan.mover.kinematics
        frames = [np.array(ca.evalf(f)) for f in arm.frames(kinematics.full(ca.SX(q)))]
        hand = frames[-1].copy()
        hand[:3, 3] = frames[-2][:3, 3]
        energy = 0.0
        for link, frame in zip(arm.links, [*frames[: arm.joints], hand], strict=True):
            energy += link.mass * 9.81 * (frame @ [*link.com, 1.0])[2]
        tcp = frames[-1]
        along = tcp[:3, 2] * scene.com_offset
        return energy + scene.object.mass * 9.81 * float((tcp[:3, 3] + along)[2])

    for joint in range(3):
        up, down = q.copy(), q.copy()
        up[joint] += step
        down[joint] -= step
        slope = (height_energy(up) - height_energy(down)) / (2 * step)
        assert shares[0, joint] == pytest.approx(abs(slope), abs=1e-5)


BAD = [
    ("margin = 1.0", ["[torque]", "margin", "below 0.9"]),
    ("limits = [80.0, 80.0]", ["[torque]", "limits", "3"]),
    ("limits = [80.0, 80.0, 0.0]", ["[torque]", "limits", "above 0"]),
    ("limit = [80.0, 80.0, 8.0]", ["[torque]", "limit", "did you mean 'limits'"]),
]


@pytest.mark.parametrize(("line", "words"), BAD)
def test_wrong_sections_are_refused(tmp_path, capsys, line, words) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(f"{scene_text('pose')}\n[torque]\n{line}\n")
    assert main(["plan", str(path)]) == 2
    message = capsys.readouterr().err
    assert len(message.splitlines()) == 1
    for word in ("scene.toml", *words):
        assert word in message


def test_only_for_a_robot_with_masses() -> None:
    scene = tp.load_scene("pose")
    assert scene.arm is not None
    with pytest.raises(tp.InputError, match="no link masses"):
        scene.replace(arm=dataclasses.replace(scene.arm, links=()), torque=Torque())
    with pytest.raises(tp.InputError, match=r"only for a scene with \[robot\]"):
        tp.load_scene("hand-box").replace(torque=Torque())
