"""A look at the page of the 3-D view, with Chromium."""

from __future__ import annotations

import time

import numpy as np
import pytest
import throwplan as tp
from browser import browsing, needs_browser
from matplotlib.colors import rgb_to_hsv
from throwplan.pictures.space import serving, space_motion


def count(picture: np.ndarray, hue: float, saturation: tuple[float, float], value: tuple) -> int:
    """Pixels within 12 degrees of a hue and in ranges of saturation and value."""
    h, s, v = 360 * picture[..., 0], picture[..., 1], picture[..., 2]
    near = np.abs((h - hue + 180) % 360 - 180) < 12
    inside = (s >= saturation[0]) & (s <= saturation[1]) & (v >= value[0]) & (v <= value[1])
    return int((near & inside).sum())


@pytest.mark.slow
@needs_browser
def test_the_page_shows_arm_bar_cup_and_slider(saved, free_port) -> None:
    space = space_motion(tp.read_plan(saved("near-cup")))
    marks = space.throws[0].line.marks
    least = {"bar": 500, "cup": 1500, "arm": 10_000, "slider": 5000}
    # Not one colour over everything either.
    most = {"bar": 20_000, "cup": 40_000, "arm": 120_000, "slider": 40_000}
    with serving(space, free_port()) as (address, panel):
        panel.go((marks["detach"] + marks["landing"]) / 2)
        with browsing(address) as page:
            end = time.monotonic() + 90
            found = dict.fromkeys(least, 0)
            while time.monotonic() < end and any(found[k] <= least[k] for k in least):
                time.sleep(0.5)
                found = amounts(rgb_to_hsv(page.picture()))
    assert all(least[k] < found[k] < most[k] for k in least), found


def amounts(picture: np.ndarray) -> dict[str, int]:
    """Pixels in the colours of what the page shows: left the throw, right the panel."""
    stage, side = picture[:, :870], picture[:, 880:]
    return {
        "bar": count(stage, 159, (0.8, 1), (0.3, 0.8)),
        "cup": count(stage, 27, (0.25, 1), (0.4, 0.9)),
        "arm": count(stage, 214, (0.08, 0.5), (0.3, 0.75)),
        "slider": count(side, 208, (0.7, 1), (0.7, 1)),
    }
