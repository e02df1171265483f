"""Fails if throws teach another bias than theirs, or a plan with [calibration] aims elsewhere."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import loud, made_throws
from throwplan import lab, robots

#: A bias, x [m] and theta [rad].
BIAS = (0.03, math.radians(6.0))


@pytest.fixture(scope="module")
def plans(tmp_path_factory) -> tuple[Path, list[tp.Plan]]:
    """Plans of `pose` at three places, saved as a, b and c in a folder; not to be changed."""
    folder = tmp_path_factory.mktemp("plans")
    planner = tp.Planner(loud("pose"), library=False)
    made = [planner.plan(tp.Pose(x=x, z=0.1, theta=0.0)) for x in (1.18, 1.2, 1.22)]
    for name, plan in zip("abc", made, strict=True):
        assert plan.solved
        plan.save(folder / name)
    return folder, made


def predicted(plan: tp.Plan) -> tuple[float, float]:
    """The landing by the deciding model: x [m], theta [rad]."""
    landing = plan.to_dict()["landing"]["limit_surface"]
    return landing["x"], landing["theta"]


def throws_file(plans, path: Path, count: int, scatter=(0.004, 0.03), seed: int = 1, bias=BIAS):
    """A CSV file of `count` throws with a bias and a normal scatter; their residuals (N, 2)."""
    folder, made = plans
    residuals = np.random.default_rng(seed).normal(bias, scatter, (count, 2))
    lines = ["plan,x,theta,note"]
    for i, (dx, dtheta) in enumerate(residuals.tolist()):
        x, theta = predicted(made[i % 3])
        lines.append(f"{folder / 'abc'[i % 3]},{x + dx!r},{theta + dtheta!r},sunny")
    path.write_text("\n".join(lines) + "\n")
    return residuals


def calibration(**changes) -> tp.Calibration:
    """A [calibration] of `pose`, its speeds those of any throw."""
    x, theta = BIAS
    known = {
        "throws": 24,
        "level": 0.9,
        "x": x,
        "theta": theta,
        "x_interval": (x - 0.01, x + 0.01),
        "theta_interval": (theta - 0.1, theta + 0.1),
        "position": 0.0307,
        "angle": math.radians(10.6),
        "speed": (0.0, 9.0),
        "rate": (-20.0, 20.0),
        "mass": 0.24,
        "com": 0.1,
        "force": 70.0,
        "opening": 0.05,
        "friction": 1.0,
        "patch_radius": 0.0025,
        "model": "ls-step",
    }
    return tp.Calibration(**known | changes)


# From throws to a plan.


def test_from_a_csv_to_a_plan_that_aims_beside_the_target(run, plans, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    residuals = throws_file(plans, tmp_path / "throws.csv", 20)
    found = run("calibrate throws.csv --scene pose --out cal --json").json
    mean, half = residuals.mean(axis=0), found["region"]
    assert [found["bias"][name]["value"] for name in ("x", "theta")] == pytest.approx(mean)
    for name, value in zip(("x", "theta"), mean, strict=True):
        assert found["bias"][name]["low"] < value < found["bias"][name]["high"]
    # Student's 90 % interval of 20 throws: 1.729 standard errors.
    error = residuals[:, 0].std(ddof=1) / math.sqrt(20)
    assert found["bias"]["x"]["high"] - mean[0] == pytest.approx(1.729 * error, rel=1e-3)
    assert (found["throws"], found["level"], found["guaranteed"]) == (20, 0.9, 19 / 21)
    off = np.abs(residuals - mean) <= [half["position"], half["angle"]]
    assert off.all(axis=1).sum() >= 18
    names = {path.name for path in (tmp_path / "cal").iterdir()}
    assert names == {"calibrate.json", "calibration.toml", "calibration.png"}
    run("scenes --write pose")
    text = Path("pose.toml").read_text() + Path("cal/calibration.toml").read_text()
    text += "\n[cost]\nquiet = 0.0\n"
    Path("mine.toml").write_text(text)
    said = run("plan mine.toml --out plan --verbose")
    assert said.status == 0, said
    words = f"by 20 of your throws 90 % land within {math.ceil(1e3 * half['position'])} mm"
    assert words in said.out and "°" in said.out and "aimed at x 1.1" in said.out
    # The motion that was sent, thrown without the calibration, lands the bias short of the target.
    sent = tp.read_plan("plan")
    bare = sent.in_scene(sent.scene.replace(calibration=None))
    assert bare.landing.x == pytest.approx(1.2 - mean[0], abs=2e-4)
    assert bare.landing.theta == pytest.approx(-mean[1], abs=1e-3)
    assert sent.landing.x == pytest.approx(1.2, abs=2e-4)


# Plans with a calibration.


@pytest.fixture(scope="module")
def aimed() -> tuple[tp.Planner, tp.Plan]:
    """A planner of `pose` with a calibration, and its plan."""
    planner = tp.Planner(loud("pose").replace(calibration=calibration()), library=False)
    return planner, planner.plan()


def test_without_the_section_nothing_is_added(plans, aimed):
    found, again = plans[1][1].to_dict(), aimed[1].to_dict()
    assert "calibration" not in found and again["nlp"] == found["nlp"]
    assert again["calibration"]["holds"] and again["calibration"]["bias"]["x"] == BIAS[0]
    assert again["calibration"]["aim"]["x"] == pytest.approx(1.17)


def test_sweeps_and_replays_have_the_bias(aimed):
    """A replay in MuJoCo compares landings without it."""
    swept = tp.sweep(aimed[1], samples=64).to_dict()
    assert swept["bias"]["position"] < 1e-3 and swept["bias"]["angle"] < math.radians(0.3)
    pytest.importorskip("mujoco")
    (one,) = lab.replay(aimed[1], step=2e-4).objects
    dx, dtheta = one.off("limit_surface")
    assert abs(dx) < 2e-3 < abs(BIAS[0]) and abs(dtheta) < math.radians(1) < abs(BIAS[1])
    assert abs(one.off("target")[0]) > abs(BIAS[0]) - 2e-3


def test_a_cup_is_entered_by_the_throw_as_it_really_flies():
    """The flight with the bias spread over it, by formulas of the test, passes the rim inside."""
    scene = tp.load_scene("near-cup").replace(calibration=calibration(x=-0.02, x_interval=(-1, 1)))
    plan = tp.Planner(scene, library=False).plan()
    assert plan.solved, plan.message
    throw, cup = plan.throw.deciding, plan.scene.cup
    start, flight = throw.release.detach, throw.landing.flight_time
    shares = np.linspace(0.7, 1.25, 400)
    t = shares * flight
    x = start.x + start.v_x * t - 0.02 * shares
    z = start.z + start.v_z * t - 9.81 * t**2 / 2
    theta = start.theta + start.omega * t + BIAS[1] * shares
    ahead = scene.object.length - scene.object.com
    depth = cup.rim - (z + ahead * np.sin(theta))
    within = (depth > 0.0) & (depth < cup.insertion)
    assert within.sum() > 10
    end = x + ahead * np.cos(theta) - cup.x
    assert (np.abs(end[within]) < cup.radius - scene.object.width / 2).all()
    # The motion that forgets the bias does not pass the same verdict.
    plain = tp.Planner("near-cup", library=False).plan()
    judged = dataclasses.replace(plain, scene=scene)
    moved = dataclasses.replace(plain.throw, deciding=plain.throw.deciding.in_scene(scene))
    assert not dataclasses.replace(judged, throw=moved, status="not_found").verdict.ok


def test_warm_moving_and_followed_throws_have_the_bias_too(aimed):
    planner, plan = aimed
    scene = planner.scene
    again = planner.plan(tp.Pose(x=1.21, z=0.1, theta=0.02), warm=plan)
    moving = planner.plan(tp.Pose(x=1.2, z=0.1, theta=0.0, velocity=(0.05,)))
    for one in (again, moving):
        assert one.solved
        bare = one.throw.deciding.in_scene(one.throw.scene.replace(calibration=None))
        missed = bare.miss(one.goal)
        assert missed == pytest.approx((-BIAS[0], -BIAS[1]), abs=3e-3)
    # An arm that follows exactly, and a target that has jumped by 2 cm.
    session, tick = robots.follow(planner, plan, 0.02), 0
    there = tp.Pose(x=1.22, z=0.1, theta=0.0)
    status = ""
    while status not in ("committed", "stopped"):
        sent = session.throw.samples
        status = session.update(0.001 * tick, sent.q[tick], sent.dq[tick], there).status
        tick += 5
    assert status == "committed"
    thrown = session.throw.in_scene(scene.replace(calibration=None).aimed_at(there))
    assert thrown.miss() == pytest.approx((-BIAS[0], -BIAS[1]), abs=3e-3)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"speed": (4.0, 5.0)}, "speed"),
        ({"rate": (5.0, 6.0)}, "turning rate"),
        ({"mass": 0.3}, "[object] mass"),
        ({"force": 100.0}, "[gripper] force"),
        ({"model": "sp"}, "[tolerance] model"),
    ],
)
def test_a_throw_unlike_the_measured_ones_is_warned_of(changes, key, aimed):
    plan = aimed[1]
    scene = plan.scene.replace(calibration=calibration(**changes))
    throw = dataclasses.replace(plan.throw, deciding=plan.throw.deciding.in_scene(scene))
    other = dataclasses.replace(plan, scene=scene, throw=throw)
    assert not other.to_dict()["calibration"]["holds"]
    assert f"[calibration] does not hold here: {key}" in other.summary()


def test_throws_aimed_by_a_calibration_calibrate_again(aimed, tmp_path):
    """They land on their target; their residual is the bias itself, not what is left of it."""
    aimed[1].save(tmp_path / "aimed")
    (tmp_path / "throws.csv").write_text("\n".join(["plan,x,theta", *["aimed,1.2,0.0"] * 9]))
    for base in (aimed[0].scene, "pose"):
        found = lab.calibrate(tmp_path / "throws.csv", base)
        assert found.section.bias == pytest.approx(BIAS, abs=1e-3)


# Folders of recordings.


@pytest.fixture(scope="module")
def recorded() -> tuple[lab.ThrowData, tp.Scene]:
    """18 made throws, and a scene with their object, grip and true contact."""
    scene = loud("pose")
    return made_throws(), scene.replace(
        gripper=tp.Gripper(force=220.0, dwell=0.05, opening=0.06),
        contact=dataclasses.replace(scene.contact, friction=0.8, patch_radius=0.0031),
    )


def test_recordings_are_predicted_by_the_scene(recorded):
    data, scene = recorded
    found = lab.calibrate(data, scene)
    # The scene has the true contact: little is left but the stated scatter and noise.
    assert abs(found.section.x) < 0.003 and abs(found.section.theta) < math.radians(1.5)
    assert 0.002 < found.section.position < 0.02
    late = [dataclasses.replace(t, command=t.command + 0.008) for t in data.throws]
    shifted = lab.calibrate(dataclasses.replace(data, throws=tuple(late)), scene)
    assert abs(shifted.section.x - found.section.x) > 0.004


@pytest.mark.slow
def test_a_throw_is_left_out_of_the_fit_that_predicts_it(recorded):
    data, scene = recorded
    scene = scene.replace(uncertainty=tp.Uncertainty(delay=tp.Distribution(uniform=0.002)))
    few = data.picked(list(range(0, 18, 2)))
    before = lab.calibrate(few, scene, fit=True)
    x, z, theta = few.throws[4].landing
    far = dataclasses.replace(few.throws[4], landing=(x + 0.1, z, theta))
    throws = (*few.throws[:4], far, *few.throws[5:])
    after = lab.calibrate(dataclasses.replace(few, throws=throws), scene, fit=True)
    change = after.residuals.landing - before.residuals.landing
    assert change[4] == pytest.approx([0.1, 0.0], abs=1e-12)
    assert before.guaranteed is None and before.section.fitted
    fitted = before.apply(scene)
    assert fitted.contact.friction != scene.contact.friction
    assert fitted.calibration.friction == fitted.contact.friction
    sections = tomllib.loads(before.text())
    assert sections["contact"]["friction"] == pytest.approx(fitted.contact.friction, rel=1e-5)
    assert set(sections["uncertainty"]) >= {"friction", "patch_radius", "delay"}


# Wrong input.


@pytest.mark.parametrize(("count", "level", "needed"), [(8, 0.9, 9), (2, 0.5, 3)])
def test_too_few_throws_are_refused_with_the_number_needed(
    refused, plans, tmp_path, count, level, needed
):
    path = tmp_path / "throws.csv"
    throws_file(plans, path, count)
    assert f"at least {needed}" in refused(f"calibrate --scene pose --level {level}", path)
    throws_file(plans, path, needed)
    assert lab.calibrate(path, "pose", level).section.throws == needed


def test_wrong_files_and_options_are_refused(refused, plans, tmp_path):
    path = tmp_path / "throws.csv"
    for text, words in (
        ("plan,x\na,1\n", "theta"),
        (f"plan,x,theta\n{plans[0] / 'a'},1.2,wide\n", "line 2: theta = 'wide'"),
        (f"plan,x,theta\n{plans[0] / 'a'},1,2,0,1\n", "line 2"),
        ("plan,x,theta\nnowhere,1.2,0\n", "nowhere"),
    ):
        path.write_text(text)
        said = refused("calibrate --scene pose", path)
        assert "throws.csv" in said and words in said
    throws_file(plans, path, 9, bias=(0.0, 6.2))
    assert "theta" in refused("calibrate --scene pose", path)
    throws_file(plans, path, 9)
    for options, words in (
        ("fr3", "its arm"),
        ("drop", "[motion]"),
        ("pose --fit", "--fit"),
        ("pose --throws 4", "--throws"),
        ("pose --only com=com1", "--only"),
        ("pose --level 0.4", "--level"),
        ("pose --level nine", "--level"),
    ):
        assert words in refused(f"calibrate {path} --scene {options}")


def test_another_object_or_grip_is_refused(recorded, plans, tmp_path):
    path = tmp_path / "throws.csv"
    throws_file(plans, path, 9)
    data, scene = recorded
    pose = loud("pose")
    heavy = pose.replace(object=dataclasses.replace(pose.object, mass=0.3))
    with pytest.raises(tp.InputError, match="mass"):
        lab.calibrate(path, heavy)
    with pytest.raises(tp.InputError, match="force"):
        lab.calibrate(path, scene)
    with pytest.raises(tp.InputError, match="force"):
        lab.calibrate(data, pose)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"throws": 8}, "at least 9"),
        ({"level": 1.2}, "level = 1.2"),
        ({"speed": (3.0, 2.0)}, "speed"),
        ({"x": 40.0}, "x = 40"),
        ({"model": "patch"}, "model = 'patch'"),
    ],
)
def test_wrong_sections_are_refused(changes, words):
    with pytest.raises(tp.InputError, match=words):
        calibration(**changes)


def test_a_given_motion_has_no_calibration():
    with pytest.raises(tp.InputError, match=r"\[calibration\]: only for a scene with \[hand\]"):
        tp.load_scene("drop").replace(calibration=calibration())


def test_a_known_mean_delay_is_no_bias() -> None:
    """Throws that land where their plan says have none, however late the pads open."""
    delay = tp.Distribution(uniform=0.002, mean=0.01)
    late = loud("pose").replace(uncertainty=tp.Uncertainty(delay=delay))
    plan = tp.Planner(late, library=False).plan()
    landing = plan.throw.deciding.landing
    data = lab.throw_data([plan] * 9, [(landing.x, landing.theta)] * 9)
    bias = lab.calibrate(data, plan.scene).section.bias
    assert plan.solved and np.abs(bias) == pytest.approx(np.zeros(2), abs=2e-3)
    # A recorded force that holds the delay already is not shifted by it again.
    grip = [dataclasses.replace(one, grip=one.grip.delayed(0.01)) for one in data.throws]
    recorded = dataclasses.replace(data, throws=tuple(grip))
    whole = lab.calibrate(recorded, late.replace(uncertainty=None)).section
    assert np.abs(whole.bias) == pytest.approx(np.zeros(2), abs=2e-3)
