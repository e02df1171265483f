"""Fails if prepared throws are not kept, not used, or lost by an interrupt."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import throwplan as tp
from throwplan import load_scene

KEYS = {"scene", "throws", "added", "edge", "bytes", "folder", "time"}


def test_it_says_what_there_is_and_plans_use_it(run, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    said = run("prepare hand-box --throws 40 --json")
    assert said.status == 0 and said.json.keys() == KEYS
    found = said.json
    assert found["throws"] == found["added"] >= 40 and Path(found["folder"]).is_dir()
    # Again: they are there already.
    again = run("prepare hand-box --throws 40 --json").json
    assert again["throws"] == found["throws"] and again["added"] == 0
    answer = run("plan hand-box --json").json
    assert answer["status"] == "solved" and answer["solver"]["name"] == "corrector"
    said = run("prepare hand-box --throws 40")
    assert said.status == 0 and "solved throws, none of them new" in said.out


def test_it_says_why_there_are_fewer_than_asked_for(run, tmp_path, monkeypatch) -> None:
    """A hand so slow that its reach has no room for as many."""
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    text = tp.scene_text("hand-box")
    assert "\nspeed = 3.0" in text
    slow = tmp_path / "slow.toml"
    slow.write_text(text.replace("\nspeed = 3.0", "\nspeed = 0.3"))
    said = run("prepare --throws 300", slow)
    assert said.status == 0 and "fewer than the 300 requested: no places are left" in said.out


@pytest.mark.slow
def test_an_end_loses_nothing_that_was_solved(tmp_path: Path, interruptible: None) -> None:
    """Of the command, with the processes that it starts."""
    environment = os.environ | {"THROWPLAN_CACHE": str(tmp_path)}
    command = [sys.executable, "-m", "throwplan", "prepare", "hand-flip", "--throws", "5000"]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 300
    while not list(tmp_path.glob("throws-*/*.npy")) and time.monotonic() < until:
        time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    _, words = process.communicate(timeout=60)
    assert process.returncode == 130
    kept = r"throwplan: interrupted: ([\d,]+) throws are kept; run the command again .*\n"
    said = re.fullmatch(kept, words)
    assert said, words
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THROWPLAN_CACHE", str(tmp_path))
        kept = tp.Planner(load_scene("hand-flip")).prepared
    assert kept == int(said[1].replace(",", "")) > 0
    assert not [path for path in tmp_path.glob("throws-*/*") if path.suffix != ".npy"]
