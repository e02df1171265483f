"""Pictures of a throw: files, colours, what moves where, and a user's Matplotlib left alone."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys

import matplotlib
import numpy as np
import pytest
import throwplan as tp
from builders import varied
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.text import Text
from PIL import Image, ImageSequence
from throwplan import pictures
from throwplan.pictures import GREEN, GREY, RED, draw_releases, save_figure
from throwplan.problems import Motion, Obstacle, OutlinePart


@pytest.fixture(scope="module")
def plan(plan_of) -> tp.Plan:
    return plan_of("hand-flip")


@pytest.mark.parametrize(
    "wrong", [None, [], 3, "no/such/plan", lambda plan: plan.scene, tp.ReachMap]
)
def test_what_has_no_picture_is_refused(plan, wrong) -> None:
    with pytest.raises(tp.InputError):
        pictures.draw(wrong(plan) if callable(wrong) and wrong is not tp.ReachMap else wrong)
    with pytest.raises(tp.InputError, match="folder = "):
        pictures.save(plan, None)


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


DRAW = """
import json, sys, matplotlib
matplotlib.use("svg")
import throwplan as tp
from throwplan import pictures

pictures.save(tp.plan("hand-box"), "plan")
pictures.save(tp.reach_map("hand-box", samples=2000), "map")
pyplot = sorted(name for name in sys.modules if name.startswith("matplotlib.pyplot"))
print(json.dumps([matplotlib.get_backend(auto_select=False), pyplot]))
"""


@pytest.mark.slow
def test_drawing_neither_changes_the_backend_nor_imports_pyplot(tmp_path) -> None:
    command = [sys.executable, "-c", DRAW]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == ["svg", []]
    for name in ("plan/throw.png", "plan/throw.gif", "map/map.png"):
        assert (tmp_path / name).exists(), name


@pytest.mark.parametrize("name", ["throw.png", "map.png"])
def test_a_user_s_settings_change_no_picture(plan, name, tmp_path) -> None:
    draw = {
        "throw.png": lambda path: pictures.draw(plan.throw.deciding, path),
        "map.png": lambda path: pictures.draw(tp.reach_map("hand-box", samples=500), path),
    }[name]
    drawn = []
    for folder, settings in (
        ("plain", {}),
        ("own", {"text.usetex": True, "lines.linewidth": 9, "savefig.dpi": 30, "axes.grid": True}),
    ):
        (tmp_path / folder).mkdir()
        with matplotlib.rc_context(settings):
            draw(tmp_path / folder / name)
        drawn.append((tmp_path / folder / name).read_bytes())
    assert drawn[0] == drawn[1]


def share_of(picture: np.ndarray, colour: str) -> float:
    """Share of the pixels (H, W, 3) that have a colour, to 6 of 255."""
    return float((np.abs(picture - 255 * np.array(to_rgb(colour))).max(axis=2) < 6).mean())


@pytest.mark.slow
def test_the_gif_shows_every_phase_in_its_colour_on_white(loud_plan_of, tmp_path) -> None:
    loud_plan_of("hand-flip").save(tmp_path / "plan")
    throw = tp.read_plan(tmp_path / "plan")
    pictures.save(throw, tmp_path)
    with Image.open(tmp_path / "throw.gif") as moving:
        length, frames = 0.0, []
        for frame in ImageSequence.Iterator(moving):
            frames.append(np.asarray(frame.convert("RGB"), int))
            if len(frames) < 2 or (frames[-1] != frames[-2]).any():
                length += frame.info["duration"] / 1000
    # A fifth of the speed; then the last frame, for a moment.
    assert length == pytest.approx(5 * throw.landing_time, rel=0.15)
    assert all((frame[:2] == 255).all() for frame in frames)
    for colour in (GREY, RED, GREEN):
        assert max(share_of(frame, colour) for frame in frames) > 3e-4
    assert share_of(frames[0], GREY) > 3e-4 > share_of(frames[0], GREEN)
    assert share_of(frames[-6], GREEN) > 3e-4


def given_motions() -> dict[str, tp.Scene]:
    """The drop, with the hand moving, and with too weak a grip."""
    drop = tp.load_scene("drop")
    motion = Motion((0.0, 1.0), -1.0, (1.5, 1.0), 4.0, (5.0, 8.0), 20.0)
    return {
        "moving": drop.replace(name="moving", motion=motion),
        "weak": varied(drop, gripper={"force": 15.0}),
    }


@pytest.mark.parametrize("kind", ["moving", "weak"])
def test_the_releases_are_drawn(kind: str, tmp_path) -> None:
    scene, path = given_motions()[kind], tmp_path / "releases.png"
    runs = tp.simulate(scene, "ls" if kind == "moving" else "sp")
    save_figure(draw_releases(scene, runs), path)
    with Image.open(path) as picture:
        assert 900 <= picture.width <= 1200 and 600 <= picture.height <= 1100
        # Not an empty sheet: some ink, mostly background.
        assert 0.005 < (np.asarray(picture.convert("L")) < 128).mean() < 0.5


def shown_texts(figure: Figure) -> list[Text]:
    """The texts of a drawn figure that are not empty, without ticks outside their axes."""
    hidden = set[int]()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if not (low <= tick.get_loc() <= high):
                    hidden |= {id(tick.label1), id(tick.label2)}
    every = figure.findobj(Text)
    return [t for t in every if t.get_visible() and t.get_text().strip() and id(t) not in hidden]


def cut_texts(figure: Figure) -> list[str]:
    """Texts that leave the figure, notes that leave their axes, and pairs that overlap."""
    figure.draw_without_rendering()
    texts, found = shown_texts(figure), list[str]()
    boxes = [text.get_window_extent() for text in texts]
    for text, box in zip(texts, boxes, strict=True):
        inside = [figure.bbox]
        if any(text in axes.texts for axes in figure.axes):
            inside.append(text.axes.bbox)
        for room in inside:
            # To half a pixel.
            ends = (box.x0 - room.x0, box.y0 - room.y0, room.x1 - box.x1, room.y1 - box.y1)
            if min(ends) < -0.5:
                found.append(f"{text.get_text()!r} leaves by {-min(ends):.0f} px")
    for i, box in enumerate(boxes):
        for k, other in enumerate(boxes[:i]):
            wide = min(box.x1, other.x1) - max(box.x0, other.x0)
            high = min(box.y1, other.y1) - max(box.y0, other.y0)
            if min(wide, high) > 1.0:
                found.append(f"{texts[k].get_text()!r} and {texts[i].get_text()!r} overlap")
    return found


def obstacles() -> tuple[Obstacle, ...]:
    """A wall across the plane, turned, and a post beside it."""
    wall = Obstacle("wall", "box", (0.06, 0.8, 0.3), (0.7, 0.0, 0.15), yaw=np.radians(20.0))
    return wall, Obstacle("post", "capsule", (0.05, 0.6), (0.5, 0.3, 0.3))


def hammer(bar: tp.Object) -> tp.Object:
    """An object of the bar's length with three capsules, one inside of the others."""
    far = bar.length - 0.02
    parts = (
        OutlinePart((0.008, 0.0), (far, 0.0), 0.008),
        OutlinePart((far, -0.12), (far, 0.12), 0.02),
        OutlinePart((far - 0.02, 0.0), (far - 0.02, 0.0), 0.012),
    )
    return dataclasses.replace(bar, width=0.0, outline=parts)


def drawn_scenes(scene: tp.Scene) -> dict[str, tp.Scene]:
    """A scene with what makes its picture's texts longer, or its object another shape."""
    region = tp.Region(x=(0.88, 0.96), z=0.22, theta=(-1.9, -1.2))
    return {
        "wide letters": scene.replace(name="W" * 90, obstacle=obstacles(), target=region),
        "outline": scene.replace(name="into $\\frac{$ " * 30, object=hammer(scene.object)),
    }


@pytest.mark.parametrize("kind", ["wide letters", "outline"])
def test_no_text_of_a_throws_picture_is_cut(kind: str, saved) -> None:
    throw = tp.read_plan(saved("near-cup"))
    scene = drawn_scenes(throw.scene)[kind]
    assert not cut_texts(pictures.draw(dataclasses.replace(throw, scene=scene)))


def area(corners: np.ndarray) -> float:
    """Area [m²] of a polygon (N, 2)."""
    x, z = corners.T
    return abs(float(x @ np.roll(z, -1) - np.roll(x, -1) @ z)) / 2


def test_an_obstacle_is_drawn_as_the_plane_cuts_it(saved) -> None:
    throw = tp.read_plan(saved("near-cup"))
    scene = throw.scene.replace(obstacle=obstacles())
    stage = pictures.draw(dataclasses.replace(throw, scene=scene)).axes[0]
    drawn = {str(patch.get_label()): patch for patch in stage.patches}
    wall, post = drawn["obstacle"], drawn["obstacle beside the plane"]
    # 6 cm across a wall that is turned by 20 degrees; the post as seen from aside, not filled.
    assert area(wall.get_xy()) == pytest.approx(0.3 * 0.06 / np.cos(np.radians(20.0)), rel=1e-6)
    assert area(post.get_xy()) == pytest.approx(np.pi * 0.05**2 + 0.6 * 0.1, rel=0.01)
    assert wall.get_fill() and not post.get_fill()


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
