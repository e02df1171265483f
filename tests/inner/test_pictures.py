"""Pictures of a throw: files, colours, what moves where, and a user's Matplotlib left alone."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from matplotlib.colors import to_rgb
from PIL import Image, ImageSequence
from throwplan.planner.show import GREEN, GREY, RED, draw_releases, draw_throw_moving
from throwplan.problems import Motion


@pytest.fixture(scope="module")
def plan(plan_of) -> tp.Plan:
    return plan_of("hand-flip")


DRAW = """
import json, sys, matplotlib
matplotlib.use("svg")
import throwplan as tp

tp.plan("hand-box").save("plan")
tp.reach_map("hand-box", samples=2000).save("map")
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


def test_only_the_pictures_asked_for_are_drawn(plan, tmp_path) -> None:
    (tmp_path / "throw.gif").write_text("of an earlier plan")
    for draw, pictures in (("png", {"throw.png"}), (False, set())):
        plan.save(tmp_path, draw=draw)
        assert set(os.listdir(tmp_path)) == {"plan.json", "motion.csv"} | pictures


def share_of(picture: np.ndarray, colour: str) -> float:
    """Share of the pixels (H, W, 3) that have a colour, to 6 of 255."""
    return float((np.abs(picture - 255 * np.array(to_rgb(colour))).max(axis=2) < 6).mean())


@pytest.mark.slow
def test_the_gif_shows_every_phase_in_its_colour_on_white(saved, tmp_path) -> None:
    throw = tp.read_plan(saved("hand-flip"))
    draw_throw_moving(throw, tmp_path / "throw.gif")
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
    """The drop, with the hand moving, without gravity, too weak a grip, held at its CoM."""
    drop = tp.load_scene("drop")
    motion = Motion((0.0, 1.0), -1.0, (1.5, 1.0), 4.0, (5.0, 8.0), 20.0)
    return {
        "moving": drop.replace(name="moving", motion=motion),
        "weightless": drop.replace(gravity=0.0),
        "weak": varied(drop, gripper={"force": 15.0}),
        "centred": varied(drop, grasp={"offset": drop.object.com}),
    }


@pytest.mark.parametrize("kind", ["moving", "weightless", "weak", "centred"])
def test_the_releases_are_drawn(kind: str, tmp_path) -> None:
    scene, path = given_motions()[kind], tmp_path / "releases.png"
    draw_releases(scene, tp.simulate(scene, "ls" if kind == "moving" else "sp"), path)
    with Image.open(path) as picture:
        assert 900 <= picture.width <= 1200 and 600 <= picture.height <= 1100
        # Not an empty sheet: some ink, mostly background.
        assert 0.005 < (np.asarray(picture.convert("L")) < 128).mean() < 0.5
