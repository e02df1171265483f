"""The command `throwplan prepare`: its object, its library, and why there are fewer throws."""

from __future__ import annotations

from pathlib import Path

import throwplan as tp

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
