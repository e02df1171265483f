"""Drawing leaves a user's matplotlib alone; what is drawn of a plan, and the moving picture."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image, ImageSequence
from throwplan import Plan, Planner, load_scene
from throwplan.planner.result.files import sent_throw
from throwplan.planner.result.plan import Draw
from throwplan.planner.show import moving_picture
from throwplan.planner.show.moving_picture import frames, indexed
from throwplan.planner.show.timeline import timeline


@pytest.fixture(scope="module")
def plan() -> Plan:
    return Planner(load_scene("cup")).plan()


DRAW = """
import json, sys, matplotlib
matplotlib.use("svg")
import throwplan as tp
from throwplan.planner.cli import main

tp.Planner(tp.load_scene("hand-flip")).plan().save("plan")
main(["map", "hand-box", "--out", "map", "--samples", "5000"])
main(["sweep", "delay", "--samples", "20", "--out", "sweep"])
pyplot = sorted(name for name in sys.modules if name.startswith("matplotlib.pyplot"))
print(json.dumps([matplotlib.get_backend(auto_select=False), pyplot]), file=sys.stderr)
"""


def test_drawing_neither_changes_the_backend_nor_imports_pyplot(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", DRAW], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert json.loads(done.stderr.splitlines()[-1]) == ["svg", []]
    for name in ("plan/throw.png", "plan/throw.gif", "map/map.png", "sweep/landings.png"):
        assert (tmp_path / name).exists(), name


@pytest.mark.parametrize(
    ("draw", "pictures"),
    [(True, {"throw.png", "throw.gif"}), ("png", {"throw.png"}), (False, set())],
)
def test_only_the_pictures_asked_for_are_drawn(
    plan: Plan, tmp_path: Path, draw: Draw, pictures: set[str]
) -> None:
    (tmp_path / "throw.gif").write_text("of an earlier plan")
    plan.save(tmp_path, draw=draw)
    assert set(os.listdir(tmp_path)) == {"plan.json", "motion.csv"} | pictures


def test_frames_are_what_drawing_everything_anew_would_give(
    plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What stays in front of the bar, as the target's outline, is not covered by it."""
    throw = sent_throw(plan)
    line = timeline(throw)
    last = len(line.times) - 1
    figures: list[Figure] = []

    def kept(**options: Any) -> Figure:
        figures.append(Figure(**options))
        return figures[-1]

    monkeypatch.setattr(moving_picture, "Figure", kept)
    for i in (last // 2, last):
        *_, picture = frames(throw, line, np.array([0, i]))
        for artist in figures[-1].findobj():
            artist.set_animated(False)
        canvas = FigureCanvasAgg(figures[-1])
        canvas.draw()
        np.testing.assert_array_equal(picture, np.asarray(canvas.buffer_rgba()))


def test_the_palette_keeps_the_colours(plan: Plan, tmp_path: Path) -> None:
    throw = sent_throw(plan)
    line = timeline(throw)
    pictures = list(frames(throw, line, np.linspace(0, len(line.times) - 1, 9).astype(int)))
    first, *others = indexed(pictures)
    first.save(tmp_path / "throw.gif", save_all=True, append_images=others)
    with Image.open(tmp_path / "throw.gif") as moving:
        back = [np.asarray(frame.convert("RGB"), int) for frame in ImageSequence.Iterator(moving)]
    assert len(back) == 9
    for picture, found in zip(pictures, back, strict=True):
        off = np.abs(picture[..., :3] - found).max(axis=2)
        assert off.max() < 40 and off.mean() < 0.2
        assert (found[picture[..., :3].min(axis=2) == 255] == 255).all()
