"""The command `view`: serving, its answers, films, refused input."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from throwplan.planner.cli import main
from view_plans import cup_plan, free_port, hand_plan


@pytest.fixture(autouse=True)
def interruptible() -> Iterator[None]:
    """A shell's background job ignores interrupts, and would hand that on."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def cup(tmp_path_factory) -> Path:
    return cup_plan(tmp_path_factory)


@pytest.fixture(scope="module")
def hand(tmp_path_factory) -> Path:
    return hand_plan(tmp_path_factory)


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
    from throwplan.planner.show import view_film

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
    from throwplan.planner.show import view_film

    assert "must end in .mp4" in refusal(capsys, hand, "--mp4", tmp_path / "throw.gif")

    def breaks(*_: Any) -> None:
        raise subprocess.CalledProcessError(1, "ffmpeg")

    monkeypatch.setattr(view_film, "encode", breaks)
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    path = tmp_path / "throw.mp4"
    path.write_text("earlier")
    assert "ffmpeg failed with status 1" in refusal(capsys, hand, "--mp4", path)
    assert os.listdir(tmp_path) == ["throw.mp4"] and path.read_text() == "earlier"
    assert "below.mp4: File exists" in refusal(capsys, hand, "--mp4", path / "below.mp4")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert "needs ffmpeg, which is not installed" in refusal(capsys, hand, "--mp4", path)
