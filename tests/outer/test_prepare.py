"""The command `throwplan prepare`: its object, its library, Ctrl-C and bad input."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import throwplan as tp
from throwplan.problems import load_scene

KEYS = {"scene", "throws", "edge", "bytes", "folder", "time"}


def test_it_says_what_there_is_and_plans_use_it(
    run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    said = run("prepare hand-box --throws 40 --json")
    assert said.status == 0 and said.json.keys() == KEYS
    found = said.json
    assert found["throws"] >= 20 and Path(found["folder"]).is_dir()
    # Again: they are there already.
    assert run("prepare hand-box --throws 40 --json").json["throws"] == found["throws"]
    answer = run("plan hand-box --json").json
    assert answer["status"] == "solved" and answer["solver"]["name"] == "corrector"
    said = run("prepare hand-box --throws 40")
    assert said.status == 0 and "solved throws" in said.out


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("prepare hand-box --throws 0", "--throws 0: must be a whole number, 1 to 10000"),
        ("prepare hand-box --throws many", "--throws many: must be a whole number"),
        ("prepare nowhere", "nowhere"),
        ("prepare drop", "no [hand] or [robot]"),
        ("prepare hand-box --out there", "--out"),
    ],
)
def test_refused(line: str, words: str, refused) -> None:
    assert words in refused(line)


@pytest.mark.slow
@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_an_end_loses_nothing_that_was_solved(by: int, tmp_path: Path, interruptible: None) -> None:
    """Of the command, with the processes that it starts."""
    environment = os.environ | {"THROWPLAN_CACHE": str(tmp_path)}
    command = [sys.executable, "-m", "throwplan", "prepare", "hand-flip", "--throws", "5000"]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 300
    while not list(tmp_path.glob("throws-*/*.npy")) and time.monotonic() < until:
        time.sleep(0.2)
    process.send_signal(by)
    _, words = process.communicate(timeout=60)
    assert process.returncode == 130 and words.strip() == "throwplan: interrupted"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THROWPLAN_CACHE", str(tmp_path))
        assert tp.Planner(load_scene("hand-flip")).prepared > 0
    assert not [path for path in tmp_path.glob("throws-*/*") if path.suffix != ".npy"]
