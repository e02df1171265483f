"""Fails if a picture draws an object or obstacle elsewhere than it is, depends on a user's settings
of Matplotlib, or if saving one takes away a user's file."""

from __future__ import annotations

import dataclasses

import matplotlib
import numpy as np
import pytest
import throwplan as tp
from matplotlib.figure import Figure
from matplotlib.path import Path
from throwplan import pictures
from throwplan.problems import OutlinePart


@pytest.fixture(scope="module")
def plan(plan_of) -> tp.Plan:
    return plan_of("hand-flip")


def test_pictures_of_an_earlier_result_go_and_other_files_stay(plan, tmp_path) -> None:
    """Also a user's own file in the folder that a plan not found writes."""
    pictures.save(plan, tmp_path)
    kept = tmp_path / "nearest" / "notes.txt"
    kept.parent.mkdir()
    kept.write_text("mine")
    (tmp_path / "nearest" / "plan.json").write_text("old")
    plan.save(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "motion.csv",
        "nearest",
        "plan.json",
    ]
    assert [path.name for path in kept.parent.iterdir()] == ["notes.txt"]
    assert pictures.draw(plan.sent_motion()).axes


def test_a_user_s_settings_change_no_picture(plan, tmp_path) -> None:
    drawn = []
    for folder, settings in (
        ("plain", {}),
        ("own", {"text.usetex": True, "lines.linewidth": 9, "savefig.dpi": 30, "axes.grid": True}),
    ):
        (tmp_path / folder).mkdir()
        with matplotlib.rc_context(settings):
            pictures.draw(plan.throw.deciding, tmp_path / folder / "throw.png")
        drawn.append((tmp_path / folder / "throw.png").read_bytes())
    assert drawn[0] == drawn[1]


def hammer(bar: tp.Object) -> tp.Object:
    """An object of the bar's length with three capsules, one inside of the others."""
    far = bar.length - 0.02
    parts = (
        OutlinePart((0.008, 0.0), (far, 0.0), 0.008),
        OutlinePart((far, -0.12), (far, 0.12), 0.02),
        OutlinePart((far - 0.02, 0.0), (far - 0.02, 0.0), 0.012),
    )
    return dataclasses.replace(bar, width=0.0, outline=parts)


def test_an_outline_is_filled_where_its_capsules_are(saved) -> None:
    bar = hammer(tp.read_plan(saved("near-cup")).scene.object)
    axes, pose = Figure().subplots(), np.array([0.3, 0.4, 0.7])
    pictures.draw_bars(axes, bar, pose)
    (patch,) = axes.patches
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    points = np.random.default_rng(3).uniform(-0.2, 0.3, (1000, 2))
    # How far the nearest capsule is from points along and across the axis from the CoM.
    ends = bar.capsules[:, :4].reshape(-1, 2, 2) - [bar.com, 0.0]
    shares = np.linspace(0.0, 1.0, 401)[:, None, None]
    along = ends[:, 0] + shares * (ends[:, 1] - ends[:, 0])
    away = np.linalg.norm(points[:, None, None] - along, axis=-1).min(axis=1)
    room = (away - bar.capsules[:, 4]).min(axis=1)
    places = pose[:2] + points @ np.array([[cos, sin], [-sin, cos]])
    drawn, clear = patch.get_path().contains_points(places), np.abs(room) > 1e-3
    assert 0.05 < (room < 0).mean() < 0.5
    assert (drawn[clear] == (room < 0)[clear]).all()
    # One loop: no line runs through the object.
    assert np.count_nonzero(patch.get_path().codes == Path.MOVETO) == 1
