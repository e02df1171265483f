"""Fails if a limit surface of another shape is thrown as an ellipsoid, or planned with."""

from __future__ import annotations

from pathlib import Path

import pytest
import throwplan as tp
from builders import MADE_THROWS
from throwplan import lab

#: Lines of [contact] for each shape.
LINES = {
    "ellipsoid": 'shape = "ellipsoid"\ncoefficients = [1.0, 1.2, 1.1, 0.1, 0.3, -0.2]',
    "quartic": 'shape = "quartic"\ncoefficients = '
    "[1.2, 0, 0, 2, 0, 2.5, 0, 0, 0, 0.1, 1, 0.2, 2, 0, 1]",
    "two-points": 'shape = "two-points"',
}


def written(folder: Path, scene: str, lines: str) -> Path:
    """A built-in scene with more lines in [contact], as a file."""
    text = (Path(tp.__file__).parent / "problems" / "scenes" / f"{scene}.toml").read_text()
    path = folder / "mine.toml"
    path.write_text(text.replace("[contact]\n", f"[contact]\n{lines}\n"))
    return path


@pytest.mark.parametrize("shape", LINES)
def test_each_shape_is_simulated_by_the_limit_surface_alone(shape, tmp_path, run, refused) -> None:
    path = written(tmp_path, "drop", LINES[shape])
    found = run("simulate", path, "--out", tmp_path / "out", "--json").json["models"]
    plain = tp.simulate("drop", "ls-step")["ls-step"].release.detach.omega
    assert list(found) == ["ls-step"]
    assert 1e-4 < abs(found["ls-step"]["detach"]["omega"] - plain) < 0.1
    assert "ls-step" in refused("simulate", path, "--model", "patch")


def test_of_two_points_the_one_on_the_com_s_side_slides_first(tmp_path, run) -> None:
    """Section V-A of Liu and Billard: about the other point the weight's moment M g (h + c r_p) is
    that of half the friction at a distance of 2 c r_p."""
    path = written(tmp_path, "drop", LINES["two-points"])
    (found,) = run("simulate", path, "--json").json["models"].values()
    scene = tp.load_scene(path)
    grip, contact, body = scene.gripper.profile(), scene.patch, scene.body
    arm, weight = contact.torsion_arm, body.mass * scene.gravity
    at_onset = float(contact.force_limit(grip.force(found["events"]["pivot"])))
    assert arm * at_onset == pytest.approx(weight * (body.com_offset + arm), rel=1e-7)
    assert found["detach"]["omega"] == pytest.approx(-1.0786, abs=1e-3)


def test_python_refuses_a_motion_with_a_shape_for_all_but_simulate(tmp_path) -> None:
    path = written(tmp_path, "drop", LINES["quartic"])
    data = lab.load_throws(MADE_THROWS)
    for scene in (path, tp.load_scene(path)):
        for call in (
            tp.Planner,
            tp.simulate_batch,
            tp.reach_map,
            lambda scene: lab.identify(data, prior=scene),
            lambda scene: lab.calibrate(data, scene),
        ):
            with pytest.raises(tp.InputError, match=r"mine.toml: \[contact\] shape"):
                call(scene)
        assert set(tp.simulate(scene)) == {"ls-step"}


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('shape = "round"', "must be one of ellipsoid, quartic, two-points"),
        ('shape = "quartic"', "quartic takes 15 numbers, not 0"),
        ("coefficients = [1.0]", "only with shape"),
        ('shape = "ellipsoid"\ncoefficients = [1, 1, 1, 2, 0, 0]', "the surface is not"),
        ('shape = "ellipsoid"\ncoefficients = [1, 1, 1, inf, 0, 0]', "finite"),
    ],
)
def test_a_shape_that_is_none_is_refused_in_one_line(lines, words, tmp_path, refused) -> None:
    line = refused("simulate", written(tmp_path, "drop", lines))
    assert words in line and "[contact]" in line
