"""The user guide: generated parts are current, links and commands exist, messages are real."""

from __future__ import annotations

import argparse
import ast
import functools
import math
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import throwplan
from throwplan.planner import plan as planner
from throwplan.planner.cli import _parser, main
from throwplan.planner.ocp import numbers, solver, window
from throwplan.planner.reach import preparing
from throwplan.planner.robust import hardening
from throwplan.planner.search import correction, from_release, releases, table_search
from throwplan.problems import Mesh, scene_names, scene_reference, scene_text

ROOT = Path(__file__).parent.parent
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
page = pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))


def test_scene_reference_is_current(capsys):
    assert main(["scenes", "--reference"]) == 0
    printed = capsys.readouterr().out
    assert printed == (ROOT / "docs" / "scene-reference.md").read_text(encoding="utf-8")


def test_write_and_reference_do_not_go_together(capsys):
    assert main(["scenes", "--reference", "--write", "cup"]) == 2
    assert "give one of them" in capsys.readouterr().err


def keys_of(text: str, title: str) -> set[str]:
    """The keys in the table under a heading."""
    part = re.split(r"\n#+ ", text)
    (section,) = [words for words in part if words.splitlines()[0] == title]
    return set(re.findall(r"^\| `(\w+)` \|", section, flags=re.M))


@pytest.mark.parametrize("name", scene_names())
def test_reference_has_every_key_of_the_built_in_scenes(name):
    text = scene_reference()
    for key, value in tomllib.loads(scene_text(name)).items():
        if isinstance(value, dict):
            assert set(value) <= keys_of(text, f"[{key}]")
        else:
            assert key in keys_of(text, "Keys at the top")


def test_every_key_has_a_meaning():
    lines = re.findall(r"^\| `(\w+)` \|(.*)$", scene_reference(), flags=re.M)
    assert len(lines) > 100
    assert [name for name, rest in lines if not rest.rstrip("| ").split("|")[-1].strip()] == []


@page
def test_links_lead_somewhere(path):
    text = path.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"https?:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (path.parent / name) if name else path
        assert target.exists(), link
        if anchor:
            there = target.read_text(encoding="utf-8")
            titles = re.findall(r"^#+ (.*)$", there, flags=re.M)
            anchors = {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}
            anchors |= set(re.findall(r'<a id="(\w+)"></a>', there))
            assert anchor in anchors, link


def commands_of(text: str) -> list[list[str]]:
    """The words of every command line in code blocks that calls throwplan."""
    found, fenced = [], False
    for line in re.sub(r"\\\n\s*", "", text).splitlines():  # continued lines are one
        if line.startswith("```"):
            fenced = not fenced
        elif fenced or line.startswith("    "):
            match = re.match(r"(?:\$ )?(?:\S*/)?throwplan (.+)$", line.strip())
            if match:
                found.append(shlex.split(match[1], comments=True))
    return found


@page
def test_commands_exist(path):
    text = path.read_text(encoding="utf-8")
    for words in commands_of(text):
        options = _parser().parse_args(words)  # raises what a user would see
        assert callable(options.run)


@page
def test_commands_in_the_text_exist(path):
    text = path.read_text(encoding="utf-8")
    known = subcommands()
    for line in re.findall(r"`(?:\S*/)?throwplan ([^`]+)`", text):
        name, *words = line.split()
        if name == "COMMAND":
            continue
        assert name in known, line
        options = known[name]._option_string_actions
        for word in words:
            if word.startswith("--"):
                assert word in options, line


def subcommands() -> dict[str, argparse.ArgumentParser]:
    (found,) = [
        action for action in _parser()._actions if isinstance(action, argparse._SubParsersAction)
    ]
    return dict(found.choices)


def test_readme_has_commands():
    assert len(commands_of((ROOT / "README.md").read_text(encoding="utf-8"))) >= 5


def test_python_of_the_readme_runs(tmp_path, monkeypatch):
    """As it stands there, but for the number of prepared throws."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```", text, flags=re.M | re.S)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(preparing, "SAMPLES", 4000)
    few = functools.partialmethod(throwplan.Planner.prepare, 8)
    monkeypatch.setattr(throwplan.Planner, "prepare", few)
    found: dict[str, Any] = {}
    exec(compile(code, "README.md", "exec"), found)
    assert found["plan"].solved and found["again"].solved
    assert (tmp_path / "out" / "mine" / "plan.json").is_file()
    assert found["planner"].prepared > 0
    assert found["heavy"].object.mass == 0.3
    detach = found["result"].detach
    assert detach.shape == (10_000, 6) and np.isfinite(detach).all()


def source_texts() -> list[str]:
    """All texts of the package's source, with … for what is filled in."""
    texts = []
    for path in sorted(Path(throwplan.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                texts.append("".join(map(_part, node.values)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append(node.value)
    return texts


def _part(node: ast.expr) -> str:
    return node.value if isinstance(node, ast.Constant) else "…"


def test_messages_of_the_troubleshooting_page_are_the_program_s():
    text = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    lines = re.findall(r"^- (`.*)$", text, flags=re.M)
    messages = [message for line in lines for message in re.findall(r"`([^`]+)`", line)]
    assert len(messages) > 60
    texts = source_texts()
    for message in messages:
        for words in filter(None, map(str.strip, message.split("…"))):
            assert any(words in text for text in texts), (message, words)


def test_binding_names_of_the_troubleshooting_page_are_the_program_s():
    text = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    rows = re.findall(r"^  \| (`.*`) \|", text, flags=re.M)
    names = [name for row in rows for name in re.findall(r"`([^`]+)`", row)]
    assert len(names) > 12
    texts = source_texts()
    for name in names:
        for words in filter(None, map(str.strip, name.split("…"))):
            assert any(words in text for text in texts), name


def test_numbers_of_how_it_works_are_the_program_s():
    text = (ROOT / "docs" / "how-it-works.md").read_text(encoding="utf-8")
    text = " ".join(text.split())
    words = {4: "four", 6: "six", 8: "eight", 3: "three"}
    for sentence in (
        f"{planner.SAMPLES:,} random states",
        f"FATROP from up to {words[table_search.STARTS['fatrop']]} of them",
        f"IPOPT from up to {words[table_search.STARTS['ipopt']]}",
        f"up to {words[correction.MAX_CORRECTIONS]} times",
        f"under {1e3 * correction.AIM[0]:g} mm and {math.degrees(correction.AIM[1]):g}°",
        f"up to {words[from_release.TRIES]} problems from one start",
        f"farther than {table_search.FAR:g} m",
        f"stays farther than {table_search.STILL_FAR:g} m",
        f"{words[table_search.LIGHT_STARTS]} more starts with FATROP",
        f"as {releases.DETOUR:g} m farther",
        f"less than {1e3 * correction.SHALLOW:g} mm into floor or column",
        f"at most {solver.LATEST:g} s",
        f"a sweep of {hardening.SAMPLES} throws",
        f"up to {words[planner.MORE_SOURCES]} other throws",
        f"{words[len(window.SHARES)]} other openings",
        f"{Mesh().carry}, equal",
        f"{Mesh().opening}, shorter towards the end",
        f"at most $1 - {Mesh().sticking_margin:g}$",
        f"\\int {numbers.WEIGHTS[0]:g}\\sum_j",
        f"{numbers.WEIGHTS[2]:g}\\,T",
        f"{numbers.QUIET_WEIGHT:g}\\;\\overline",
    ):
        assert sentence in text, sentence
    assert numbers.WEIGHTS[1] == 1.0
    assert window.SLOWER == 0.2
