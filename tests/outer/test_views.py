"""Fails if a page is not served or does not end, or a picture or film lacks its throw."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request
from ctypes.util import find_library
from importlib.util import find_spec

import numpy as np
import pytest
from PIL import Image

#: VTK draws by one of these, without a display.
needs_opengl = pytest.mark.skipif(
    find_spec("pyvista") is None or not any(map(find_library, ("EGL", "OSMesa"))),
    reason="no PyVista or no OpenGL here",
)


def viewing(*words: object) -> subprocess.Popen[str]:
    """A command in a process of its own, without a browser."""
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    return subprocess.Popen(
        [sys.executable, "-m", "throwplan", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={name: value for name, value in os.environ.items() if name not in hidden},
    )


@pytest.mark.parametrize("command", [pytest.param("view", marks=pytest.mark.slow), "play"])
def test_it_serves_until_interrupted(saved, interruptible, free_port, command) -> None:
    port = free_port()
    what = saved("hand-flip") if command == "view" else "hand-flip"
    process = viewing(command, what, "--port", port)
    try:
        address = process.stdout.readline().strip()
        assert address == f"http://127.0.0.1:{port}"
        with urllib.request.urlopen(address, timeout=60) as page:
            assert b"<html" in page.read()
        # It looks for a browser while it serves.
        found = process.stderr.readline()
        assert found == "throwplan: found no browser; open the address in one\n"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert (process.returncode, out, err) == (0, "", "")


def test_a_taken_port_is_named(saved, refused) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        for words in (("view", saved("hand-flip")), ("play", "hand-flip")):
            said = refused(*words, "--no-browser", "--port", port)
            assert f"--port {port}" in said


def test_wrong_options(saved, refused, tmp_path) -> None:
    assert "--port web: must be a whole number, 1 to 65535" in refused("view x --port=web")
    for kind in ("mp4", "png"):
        said = refused("view", saved("hand-flip"), f"--{kind}", tmp_path / "throw.gif")
        assert f"must end in .{kind}" in said


@needs_opengl
def test_a_picture_has_the_arm_and_the_bar_in_it(saved, run, tmp_path) -> None:
    """In their colours: the bar is red before detach and green in flight; none is cut off."""
    path = tmp_path / "pictures" / "throw.png"
    assert run("view", saved("near-cup"), "--png", path, "--json").json == {"png": str(path)}
    picture = np.asarray(Image.open(path).convert("RGB")).astype(int)
    red, green, blue = picture.transpose(2, 0, 1)
    arm = (blue > red + 10) & (blue > green) & (green < 180)
    for there, least in ((arm, 5000), (red > blue + 60, 300), (green > red + 25, 300)):
        places = np.argwhere(there)
        assert len(places) > least
        assert places.min() > 0 and (places.max(axis=0) < np.array(there.shape) - 1).all()
    assert os.listdir(path.parent) == ["throw.png"]


@pytest.mark.slow
@needs_opengl
def test_a_film_is_five_times_as_long_as_the_throw(saved, run, refused, tmp_path) -> None:
    path = tmp_path / "films" / "throw.mp4"
    assert run("view", saved("hand-flip"), "--mp4", path, "--json").json == {"mp4": str(path)}
    assert os.listdir(path.parent) == ["throw.mp4"]
    landing = json.loads((saved("hand-flip") / "plan.json").read_text())["release"]["landing_time"]
    with pytest.importorskip("av").open(path) as film:
        # And half a second more for the last frame.
        assert film.duration / 1e6 == pytest.approx(5 * landing + 0.5, abs=0.1)


@needs_opengl
def test_a_cycle_is_served_and_painted(cycled, run, free_port, tmp_path) -> None:
    """The page's facts are its phases, each object's in order; a picture has the size of all."""
    done = run("view", cycled, "--port", free_port(), "--no-browser", "--hold", "0.05", "--json")
    assert done.status == 0
    steps = json.loads((cycled / "cycle.json").read_text())["steps"]
    phases = done.json["phases"]
    assert list(phases) == [step["pick"] for step in steps]
    for own, step in zip(phases.values(), steps, strict=True):
        assert list(own.values()) == sorted(own.values())
        for name, moment in (("carry", "held"), ("stick", "opening"), ("landing", "landing")):
            assert own[name] == pytest.approx(step[f"{moment}_time"], abs=1e-9)
    assert run("view", cycled, "--png", tmp_path / "cycle.png").status == 0
    with Image.open(tmp_path / "cycle.png") as picture:
        assert picture.size == (960, 720) and picture.getextrema() != ((255, 255),) * 3
