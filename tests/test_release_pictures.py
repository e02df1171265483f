"""Pictures of a release: written, of sensible size, and the physics that they show."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import throwplan
from PIL import Image
from throwplan.models import (
    ImplicitRelease,
    KarnoppRelease,
    Release,
    ReleaseCase,
    SlidingPivotRelease,
    SteppedRelease,
    ellipsoid,
    rotated_ellipsoid,
)
from throwplan.planner.show.contact_pictures import (
    draw_limit_surface,
    first_slip,
    given_case,
    held_wrench,
    slide_onset,
)
from throwplan.planner.show.overhang_picture import draw_overhang
from throwplan.planner.show.release_pictures import draw_chatter, draw_release_pictures, quartic
from throwplan.problems import InputError, Motion, Scene

NAMES = ["limit-surface.png", "chatter.png", "shapes.png", "overhang.png", "comparison.png"]
SHAPES = {"ellipsoid": ellipsoid, "rotated": rotated_ellipsoid, "quartic": quartic}


@pytest.fixture(scope="module")
def drop() -> Scene:
    return throwplan.load_scene("drop")


@pytest.fixture(scope="module")
def case(drop: Scene) -> ReleaseCase:
    return given_case(drop)


def moving(scene: Scene) -> Scene:
    motion = Motion((0.0, 1.0), -1.0, (1.5, 1.0), 4.0, (5.0, 8.0), 20.0)
    return scene.replace(name="moving", motion=motion)


def sign_changes(release: Release, start: float) -> int:
    """Changes of the sign of f_z from one instant to the next, from `start` [s] on."""
    f_z = release.wrench[1, release.times > start]
    return int((np.sign(f_z[1:]) * np.sign(f_z[:-1]) < 0).sum())


def check_picture(file: Path) -> None:
    with Image.open(file) as picture:
        assert picture.format == "PNG"
        assert 900 <= picture.width <= 1200
        assert 600 <= picture.height <= 1100
        # Not an empty sheet: some ink, mostly background.
        assert 0.005 < (np.asarray(picture.convert("L")) < 128).mean() < 0.5


@pytest.mark.parametrize("kind", ["drop", "moving", "weightless"])
def test_pictures_are_written(drop: Scene, kind: str, tmp_path: Path) -> None:
    kinds = {"drop": drop, "moving": moving(drop), "weightless": drop.replace(gravity=0.0)}
    folder = tmp_path / "new" / "folder"
    assert draw_release_pictures(kinds[kind], folder) == NAMES
    assert sorted(file.name for file in folder.iterdir()) == sorted(NAMES)
    for name in NAMES:
        check_picture(folder / name)


def test_pictures_of_a_bar_held_at_its_centre_or_too_weakly(drop: Scene, tmp_path: Path) -> None:
    centred = drop.replace(grasp=dataclasses.replace(drop.grasp, offset=drop.object.com))
    weak = drop.replace(gripper=dataclasses.replace(drop.gripper, force=15.0))
    for scene in (centred, weak):
        for draw in (draw_limit_surface, draw_overhang):
            draw(scene, tmp_path / "picture.png")
            check_picture(tmp_path / "picture.png")


def test_a_scene_without_motion_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no section \[motion\]"):
        draw_release_pictures(throwplan.load_scene("hand-flip"), tmp_path / "none")
    assert not (tmp_path / "none").exists()


# The physics in the pictures.


def test_held_wrench_of_a_level_bar_at_rest_carries_its_weight(case: ReleaseCase) -> None:
    weight = case.body.mass * case.gravity
    expected = [0.0, weight, weight * case.body.com_offset]
    np.testing.assert_allclose(held_wrench(case, np.zeros(1))[:, 0], expected, atol=1e-12)


def test_onset_is_where_the_falling_grip_meets_the_load(case: ReleaseCase) -> None:
    # (19) by hand: both faces hold mu f_N of force and c r_p mu f_N of torque.
    weight, arm = case.body.mass * case.gravity, case.body.com_offset / (0.6 * 0.0075)
    grip = weight * np.sqrt(1 + arm**2) / (2 * 0.8)
    start = slide_onset(case, ellipsoid(case.contact))
    assert start == pytest.approx(case.grip.opening * (1 - grip / case.grip.full), rel=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_explicit_steps_chatter_from_the_onset_on(case: ReleaseCase, shape: str) -> None:
    surface = SHAPES[shape]
    start = slide_onset(case, surface(case.contact))
    run = KarnoppRelease(shape=surface).release(case)
    slip = first_slip(case, run, KarnoppRelease().dead_zone)
    assert start is not None and slip is not None
    assert start < run.times[slip] < start + 3 * case.grip.opening / 500
    # Nearly every step of those that are left turns the friction round.
    assert sign_changes(run, start) > 0.7 * (run.times > start).sum()
    assert sign_changes(run, 0.0) == sign_changes(run, start)
    # And with the whole limit: friction is not between, but at plus and minus mu f_N.
    late = run.wrench[1, slip + 2 : slip + 40]
    limit = 2 * 0.8 * case.grip.force(run.times[slip + 2 : slip + 40])
    assert np.abs(late).min() > 0.8 * limit.min()


@pytest.mark.parametrize("half_band", [None, 0.01])
def test_finer_explicit_steps_chatter_too(case: ReleaseCase, half_band: float | None) -> None:
    # The paper: the oscillations persist with smaller steps.
    start = slide_onset(case, ellipsoid(case.contact))
    counts = [
        sign_changes(KarnoppRelease(steps, half_band=half_band).release(case), start)
        for steps in (500, 1000, 2000)
    ]
    assert counts[0] > 150
    assert counts[0] < counts[1] < counts[2]


@pytest.mark.parametrize("shape", SHAPES)
def test_stepped_and_implicit_friction_keeps_its_sign(case: ReleaseCase, shape: str) -> None:
    surface = SHAPES[shape]
    start = slide_onset(case, surface(case.contact))
    for model in (SteppedRelease(500, surface), ImplicitRelease(shape=surface)):
        run = model.release(case)
        assert sign_changes(run, start) == 0
        # Upwards, and never more than the weight that it no longer holds.
        f_z = run.wrench[1, (run.times > start) & (run.times < 0.98 * case.grip.opening)]
        assert f_z.min() > 0.0
        assert f_z.max() < case.body.mass * case.gravity * (1 + 1e-6)


def test_explicit_steps_detach_elsewhere_than_all_others(case: ReleaseCase) -> None:
    # Fig. 6: not the mean of the oscillations but another motion.
    explicit = [KarnoppRelease(half_band=d).release(case).detach.omega for d in (None, 0.01)]
    others = [
        model.release(case).detach.omega
        for model in (ImplicitRelease(), SteppedRelease(), SlidingPivotRelease(events=True))
    ]
    assert max(explicit) < 1.5 * min(others)
    assert max(others) - min(others) < 0.05


def test_chatter_is_drawn_although_its_runs_are_not_to_be_trusted(
    drop: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The picture must hold the explicit curves, friction at its limit both ways included."""
    from matplotlib.figure import Figure

    seen: dict[str, np.ndarray] = {}

    def look(figure: Figure, *_args, **_options) -> None:
        for axis in figure.axes:
            if "f_z" in axis.get_ylabel():
                for line in axis.lines:
                    seen.setdefault(str(line.get_label()), np.asarray(line.get_ydata()))

    monkeypatch.setattr(Figure, "savefig", look)
    draw_chatter(drop, tmp_path / "chatter.png")
    explicit = seen["Karnopp, Euler"]
    assert explicit.size > 400
    assert explicit.max() > 30 and explicit.min() < -30
