"""The 3-D view: where things are drawn, the panel, the command, and a look at the page."""

from __future__ import annotations

import base64
import io
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import rgb_to_hsv
from PIL import Image
from throwplan import Planner, Pose, load_scene
from throwplan.planner.cli import main
from throwplan.planner.files import save_plan
from throwplan.planner.sent import read_plan
from throwplan.planner.view import View
from throwplan.planner.view_poses import SpaceThrow, in_space, link_pieces, placed, space_throw
from throwplan.planner.view_server import serving
from websockets.sync.client import connect

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
AZIMUTH = 0.5


@pytest.fixture(scope="module")
def cup(tmp_path_factory) -> Path:
    """The folder of a plan out of the plane y = 0."""
    target = Pose(x=0.92 * np.cos(AZIMUTH), y=0.92 * np.sin(AZIMUTH), z=0.22, theta=-np.pi / 2)
    return saved(tmp_path_factory, "cup", target)


@pytest.fixture(scope="module")
def hand(tmp_path_factory) -> Path:
    return saved(tmp_path_factory, "hand-flip", None)


def saved(tmp_path_factory, name: str, target: Pose | None) -> Path:
    folder = tmp_path_factory.mktemp(name)
    save_plan(Planner(load_scene(name)).plan(target), folder, draw=False)
    return folder


@pytest.fixture(scope="module")
def space(cup: Path) -> SpaceThrow:
    return space_throw(read_plan(cup))


@pytest.fixture(scope="module")
def panel(space: SpaceThrow):
    with serving(space, free_port()) as (_, panel):
        yield panel


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Recorder:
    """Stands for a viser scene: keeps what is added, by name."""

    def __init__(self) -> None:
        self.nodes: dict[str, SimpleNamespace] = {}

    def __getattr__(self, kind: str) -> Any:
        def add(name: Any, *values: Any, **options: Any) -> SimpleNamespace:
            node = SimpleNamespace(name=name, kind=kind, values=values, **options)
            self.nodes[str(name)] = node
            return node

        return add


def drawn(space: SpaceThrow) -> tuple[View, dict[str, SimpleNamespace]]:
    scene = Recorder()
    server = SimpleNamespace(
        scene=scene, atomic=nullcontext, initial_camera=SimpleNamespace(), gui=None
    )
    return View(server, space), scene.nodes


def test_the_drawn_arm_ends_where_the_hand_is(space: SpaceThrow) -> None:
    """3-D kinematics of all joints against the planar chain of the throw."""
    expected = placed(space.line.hand, AZIMUTH)
    assert np.abs(space.hand - expected).max() < 1e-9
    arm = space.scene.arm
    assert arm is not None and space.joints is not None
    view, _ = drawn(space)
    for moment in (0.0, 0.3, space.throw.opening_time, space.throw.landing_time):
        i = view.show(moment)
        frames = [np.eye(4), *space.joints[i]]
        places = [frame[:3, 3] for frame in frames[1:]]
        ends = [
            f[:3, :3] @ row[-1][1] + f[:3, 3] if row else f[:3, 3]
            for f, row in zip(frames, link_pieces(arm), strict=True)
        ]
        # Each link ends at the next joint, the last one at the flange.
        np.testing.assert_allclose(ends[:-1], places, atol=1e-12)
        tcp = ends[-1] + arm.tool.tcp * space.joints[i][-1][:3, 2]
        np.testing.assert_allclose(tcp, in_space(*space.line.hand[:2, i], AZIMUTH), atol=1e-9)
        np.testing.assert_allclose(view.hand.position, tcp, atol=1e-9)


def test_the_bar_is_held_and_lands_at_the_target(space: SpaceThrow) -> None:
    held = space.bar[0, :3, 3] - space.hand[0, :3, 3]
    assert np.linalg.norm(held) == pytest.approx(space.scene.com_offset, abs=1e-12)
    target, times = space.throw.target, space.line.times
    late = space.throw.landing_time - times[-1]
    rate = (space.bar[-1, :3, 3] - space.bar[-2, :3, 3]) / (times[-1] - times[-2])
    landed = space.bar[-1, :3, 3] + late * rate
    place = np.array([target.x, target.y, target.z])
    assert np.linalg.norm(landed - place) < 1e-4
    np.testing.assert_allclose(space.target()[:3, 3], place, atol=1e-12)
    np.testing.assert_allclose(space.target()[:3, 0], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(space.bar[-1, :3, 0], [0, 0, -1], atol=0.02)


def test_the_cup_is_where_the_scene_has_it(space: SpaceThrow) -> None:
    _, nodes = drawn(space)
    cup = space.scene.cup
    assert cup is not None
    wall, rim = nodes["/cup/wall"], nodes["/cup/rim"]
    middle = [cup.x * np.cos(AZIMUTH), cup.x * np.sin(AZIMUTH), cup.rim]
    for node in (wall, rim):
        np.testing.assert_allclose(node.position, middle, atol=1e-12)
    vertices = wall.values[0]
    assert np.hypot(vertices[:, 0], vertices[:, 1]).max() == pytest.approx(cup.radius)
    assert (vertices[:, 2].min(), vertices[:, 2].max()) == pytest.approx((-cup.depth, 0.0))
    inner = np.hypot(rim.values[0][:, 0], rim.values[0][:, 1]).min()
    assert inner == pytest.approx(cup.radius)


def test_a_hand_scene_draws_a_hand_and_nothing_it_has_not(hand: Path) -> None:
    space = space_throw(read_plan(hand))
    view, nodes = drawn(space)
    assert space.joints is None
    assert not [n for n in nodes if n.startswith(("/arm", "/cup", "/column"))]
    view.show(0.2)
    i = space.index(0.2)
    np.testing.assert_allclose(nodes["/hand"].position, in_space(*space.line.hand[:2, i], 0.0))


def test_the_pads_hold_until_detach_and_then_open(space: SpaceThrow) -> None:
    view, nodes = drawn(space)
    for moment, opens in ((space.throw.opening_time, False), (space.throw.landing_time, True)):
        view.show(moment)
        thickness = nodes["/hand/pad1"].dimensions[2]
        gap = abs(nodes["/hand/pad1"].position[2]) - thickness / 2 - space.scene.object.width / 2
        assert (gap > 0.01) if opens else (abs(gap) < 1e-12)


def test_the_camera_sees_the_whole_throw(space: SpaceThrow) -> None:
    view, _ = drawn(space)
    camera = view.server.initial_camera
    forward = camera.look_at - camera.position
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    points = np.vstack([space.bar[:, :3, 3], space.joints.reshape(-1, 4, 4)[:, :3, 3]])
    away = points - camera.position
    depth = away @ forward
    half = np.tan(camera.fov / 2)
    assert depth.min() > 0.1
    assert np.abs(away @ up / depth).max() < half
    assert np.abs(away @ right / depth).max() < 1.15 * half


def test_the_slider_moves_and_colours_the_bar(panel: Any) -> None:
    throw, view = panel.throw, panel.view
    for name, colour in (("command", (138, 143, 152)), ("landing", (42, 157, 111))):
        moment = throw.line.marks[name]
        panel.slider.value = round(1e3 * moment)
        pose = throw.bar[throw.index(moment)]
        np.testing.assert_allclose(view.bar.position, pose[:3, 3], atol=1e-12)
        assert tuple(view.box.color) == colour
        assert f"{1e3 * moment:.0f} ms" in panel.words.content


def test_playing_takes_real_time_times_the_speed(panel: Any) -> None:
    panel.go(0.0)
    panel.play(True)
    for speed, factor in (("1", 1.0), ("1/5", 0.2), ("1/20", 0.05)):
        panel.speed.value = speed
        before = panel.time
        for _ in range(10):
            panel.advance(0.013)
        assert panel.time - before == pytest.approx(0.13 * factor, abs=1e-12)
    panel.play(False)
    panel.advance(1.0)
    assert panel.time == pytest.approx(0.13 * 1.25)
    panel.play(True)
    panel.speed.value = "1"
    panel.advance(100.0)
    assert panel.time == panel.end and not panel.playing
    panel.play(True)
    assert panel.time == 0.0
    panel.play(False)


def test_the_button_goes_to_the_release(panel: Any) -> None:
    panel.go(0.0)
    panel.release.value = True
    assert panel.time == panel.throw.throw.opening_time
    assert "**stick**" in panel.words.content


def view_process(arguments: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "throwplan", "view", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={
            k: v
            for k, v in os.environ.items()
            if k not in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
        },
    )


def test_it_serves_until_interrupted(hand: Path) -> None:
    port = free_port()
    process = view_process([str(hand), "--port", str(port)])
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address == f"http://127.0.0.1:{port}"
        with urllib.request.urlopen(address, timeout=20) as page:
            assert b"<html" in page.read()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
        process.wait()
    assert (process.returncode, out) == (0, "")
    assert err == "throwplan: no browser to open here; open the address\n"


def test_json_is_one_object_with_the_phases(cup: Path) -> None:
    port = free_port()
    process = view_process(
        [str(cup / "plan.json"), "--port", str(port), "--no-browser", "--hold", "0.1", "--json"]
    )
    out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    answer = json.loads(out)
    assert answer["address"] == f"http://127.0.0.1:{port}"
    assert list(answer["phases"]) == ["carry", "stick", "pivot", "slide", "flight", "landing"]
    times = list(answer["phases"].values())
    assert times == sorted(times) and times[0] == 0.0


def refusal(capsys, *arguments: Any) -> str:
    """The one line that the command says to wrong input."""
    assert main(["view", *map(str, arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    return err


def test_a_taken_port_is_named(capsys, hand: Path) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        said = refusal(capsys, hand, "--no-browser", "--port", port)
    assert f"--port {port}: address already in use; choose another with --port" in said


@pytest.mark.parametrize("port", ["0", "65536", "web", "-1", "80.5"])
def test_a_port_that_is_none(capsys, port: str) -> None:
    said = refusal(capsys, "x", f"--port={port}")
    assert f"--port {port}: must be a whole number, 1 to 65535" in said


def test_wrong_plans(capsys, tmp_path: Path, hand: Path) -> None:
    plan = json.loads((hand / "plan.json").read_text())
    path = tmp_path / "plan.json"
    assert f"{path}" in refusal(capsys, path)
    for text, words in (
        ("[1, 2", "is not JSON"),
        ("[1, 2]", "is not a plan file"),
        (json.dumps(plan | {"format": 99}), "a plan file of version 99"),
        (json.dumps(plan | {"status": "out_of_reach"}), "it holds no throw"),
    ):
        path.write_text(text)
        for more in ([], ["--mp4", tmp_path / "throw.mp4"]):
            assert words in refusal(capsys, tmp_path, *more)
    for hold in ("0", "-1", "soon", "inf"):
        assert f"--hold {hold}: must be" in refusal(capsys, hand, f"--hold={hold}")


def run_python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_without_viser_the_extra_is_named(hand: Path) -> None:
    code = (
        "import sys; sys.modules['viser'] = None; from throwplan.planner.cli import main; "
        "sys.exit(main(['view', sys.argv[1], '--no-browser']))"
    )
    done = run_python(code, str(hand))
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == "throwplan: view needs viser: pip install 'throwplan[view]'\n"


def test_planning_imports_no_viser() -> None:
    code = (
        "import sys, throwplan; from throwplan.planner.cli import main; "
        "main(['plan', 'hand-box', '--json']); "
        "sys.exit(any(m.split('.')[0] in ('viser', 'matplotlib') for m in sys.modules))"
    )
    assert run_python(code).returncode == 0


def test_a_film(capsys, monkeypatch, tmp_path: Path, hand: Path) -> None:
    if shutil.which("ffmpeg") is None:
        pytest.skip("no ffmpeg here")
    from throwplan.planner import view_film

    monkeypatch.setattr(view_film, "FPS", 5)
    path = tmp_path / "films" / "throw.mp4"
    assert main(["view", str(hand), "--mp4", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"mp4": str(path)}
    assert os.listdir(path.parent) == ["throw.mp4"]
    probe = ["ffprobe", "-v", "error", "-show_entries", "format=duration", "-of", "csv=p=0"]
    length = float(subprocess.run([*probe, path], capture_output=True, check=True).stdout)
    landing = json.loads((hand / "plan.json").read_text())["release"]["landing_time"]
    # A fifth of the speed, and the last frame for two more.
    assert length == pytest.approx(5 * landing + 2 / 5, abs=2 / 5)


def test_a_film_that_cannot_be(capsys, monkeypatch, tmp_path: Path, hand: Path) -> None:
    from throwplan.planner import view_film

    assert "must end in .mp4" in refusal(capsys, hand, "--mp4", tmp_path / "throw.gif")

    def breaks(*_: Any) -> None:
        raise subprocess.CalledProcessError(1, "ffmpeg")

    monkeypatch.setattr(view_film, "animate", breaks)
    monkeypatch.setattr(view_film.FFMpegWriter, "isAvailable", lambda: True)
    path = tmp_path / "throw.mp4"
    path.write_text("earlier")
    assert "ffmpeg failed with status 1" in refusal(capsys, hand, "--mp4", path)
    assert os.listdir(tmp_path) == ["throw.mp4"] and path.read_text() == "earlier"
    assert "below.mp4: File exists" in refusal(capsys, hand, "--mp4", path / "below.mp4")
    monkeypatch.setattr(view_film.FFMpegWriter, "isAvailable", lambda: False)
    assert "needs ffmpeg, which is not installed" in refusal(capsys, hand, "--mp4", path)


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


@pytest.mark.skipif(BROWSER is None, reason="no chromium, chromium-browser or google-chrome here")
def test_the_page_shows_arm_bar_cup_and_slider(space: SpaceThrow) -> None:
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
