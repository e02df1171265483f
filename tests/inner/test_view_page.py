"""A look at the page of the 3-D view, with Chromium."""

from __future__ import annotations

import base64
import io
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import throwplan as tp
from matplotlib.colors import rgb_to_hsv
from PIL import Image
from throwplan.planner.show import serving, space_throw
from websockets.sync.client import connect

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)


@contextmanager
def browsing(address: str):
    """A function that takes the page's picture, (height, width) of hue, saturation, value.

    Headless Chromium over its DevTools protocol, in real time: with --screenshot it takes the
    picture too early, and with a virtual clock it may wait for ever.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [
            *(str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu"),
            *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1200,800"),
            *("--hide-scrollbars", f"--user-data-dir={profile}", "--remote-debugging-port=0"),
            address,
        ]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(command, **quiet, start_new_session=True)
        try:
            port = waited(lambda: (Path(profile) / "DevToolsActivePort").read_text().split()[0])
            with connect(waited(lambda: page_socket(port)), max_size=None) as devtools:
                yield lambda: taken(devtools)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def waited(ask: Callable[[], str]) -> str:
    """What `ask` answers as soon as it can, within a minute."""
    end = time.monotonic() + 60
    while True:
        try:
            return ask()
        except (OSError, LookupError):
            if time.monotonic() > end:
                raise
            time.sleep(0.1)


def page_socket(port: str) -> str:
    """Where the DevTools protocol of the browser's page is spoken."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=20) as answer:
        pages = [page for page in json.load(answer) if page["type"] == "page"]
    return pages[0]["webSocketDebuggerUrl"]


def taken(devtools: Any) -> np.ndarray:
    """One picture of the page, black where there is none yet."""
    devtools.send(json.dumps({"id": 1, "method": "Page.captureScreenshot"}))
    while (answer := json.loads(devtools.recv(timeout=60))).get("id") != 1:
        pass
    if "result" not in answer:
        return np.zeros((800, 1200, 3))
    picture = Image.open(io.BytesIO(base64.b64decode(answer["result"]["data"])))
    return rgb_to_hsv(np.asarray(picture.convert("RGB")) / 255)


def count(picture: np.ndarray, hue: float, saturation: tuple[float, float], value: tuple) -> int:
    """Pixels within 12 degrees of a hue and in ranges of saturation and value."""
    h, s, v = 360 * picture[..., 0], picture[..., 1], picture[..., 2]
    near = np.abs((h - hue + 180) % 360 - 180) < 12
    inside = (s >= saturation[0]) & (s <= saturation[1]) & (v >= value[0]) & (v <= value[1])
    return int((near & inside).sum())


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no chromium, chromium-browser or google-chrome here")
def test_the_page_shows_arm_bar_cup_and_slider(saved, free_port) -> None:
    space = space_throw(tp.read_plan(saved("near-cup")))
    marks = space.line.marks
    least = {"bar": 500, "cup": 2500, "arm": 10_000, "slider": 5000}
    # Not one colour over everything either.
    most = {"bar": 20_000, "cup": 40_000, "arm": 120_000, "slider": 40_000}
    with serving(space, free_port()) as (address, panel):
        panel.go((marks["detach"] + marks["landing"]) / 2)
        with browsing(address) as picture:
            end = time.monotonic() + 90
            found = dict.fromkeys(least, 0)
            while time.monotonic() < end and any(found[k] <= least[k] for k in least):
                time.sleep(0.5)
                found = amounts(picture())
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
