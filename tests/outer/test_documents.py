"""Fails if a page has a dead link, a command that is none, or code that does not run."""

from __future__ import annotations

import ast
import pydoc
import re
import shlex
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import throwplan as tp
from throwplan.cli import main
from throwplan.models import HandMotion
from throwplan.models.release import MODELS, SlidingPivot

from benchmarks import SECTIONS

ROOT = Path(__file__).parent.parent.parent
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
page = pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))


def test_every_key_of_a_scene_is_explained(run, refused) -> None:
    printed = run("scenes --keys").out
    titles = {part.splitlines()[0]: part for part in re.split(r"\n#+ ", printed)}
    for name in tp.scene_names():
        for key, value in tomllib.loads(tp.scene_text(name)).items():
            section = titles[f"[{key}]" if isinstance(value, dict) else "Keys at the top"]
            known = set(re.findall(r"^\| `(\w+)` \|", section, flags=re.M))
            assert set(value if isinstance(value, dict) else [key]) <= known
    # Every key has a meaning.
    rows = re.findall(r"^\| `\w+` \|(.*)$", printed, flags=re.M)
    assert len(rows) > 60
    assert all(row.rstrip("| ").split("|")[-1].strip() for row in rows)
    assert "give one of them" in refused("scenes --keys --write cup")


def test_the_page_of_python_has_every_name_once() -> None:
    """The site puts their docstrings there."""
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    lists = re.findall(r"^(?:`[\w.]+`,?\s)+", text, flags=re.M)
    names = re.findall(r"[\w.]+\b", "".join(lists).replace(",", ""))
    assert sorted(name for name in names if "." not in name) == sorted(tp.__all__)
    assert len(set(names)) == len(names)
    assert all(pydoc.locate(f"throwplan.{name}") for name in names)


@page
def test_links_lead_somewhere(path) -> None:
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
            assert anchor in anchors, link


def commands_of(text: str) -> list[list[str]]:
    """The words of every command line in code blocks and in the text that calls throwplan."""
    found, fenced = [], False
    for line in re.sub(r"\\\n\s*", "", text).splitlines():  # continued lines are one
        if line.startswith("```"):
            fenced = not fenced
        elif fenced or line.startswith("    "):
            match = re.match(r"(?:\$ )?(?:\S*/)?throwplan (.+)$", line.strip())
            if match:
                found.append(shlex.split(match[1], comments=True))
    return found + [line.split() for line in re.findall(r"`(?:\S*/)?throwplan ([^`]+)`", text)]


@page
def test_commands_and_their_options_exist(path, capsys) -> None:
    @cache
    def options_of(name: str) -> set[str]:
        with pytest.raises(SystemExit) as stopped:
            main([name, "--help"])
        assert stopped.value.code == 0, name
        return set(re.findall(r"--[a-z][\w-]*", capsys.readouterr().out))

    for name, *words in commands_of(path.read_text(encoding="utf-8")):
        if name == "COMMAND" or name.startswith("--"):
            continue
        options = options_of(name)
        for word in words:
            if word.startswith("--"):
                assert word.partition("=")[0] in options, (name, word)


def test_the_map_of_the_paper_names_what_exists() -> None:
    """A name in backticks after a file's, in one cell or line, is defined in that file."""
    text, found = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8"), 0
    for part in re.split(r"[|\n]", text):
        source = ""
        for word in re.findall(r"`([^`]+)`", part):
            if re.fullmatch(r"\w+(?:/\w+)+\.(?:py|h)", word):
                source = (ROOT / word).read_text(encoding="utf-8")
            elif source and re.fullmatch(r"\w+", word):
                defined = rf"^\s*(?:(?:def|class) {word}\b|{word}(?::| =))"
                assert re.search(defined, source, flags=re.M), word
                found += 1
    assert found > 35
    assert set(re.findall(r"python -m benchmarks --only (\w+)", text)) <= SECTIONS.keys()


def test_the_drops_of_the_map_of_the_paper_are_the_program_s() -> None:
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w-]+)` ((?:\| −[\d.]+ ){4})\|$", text, flags=re.M)
    assert len(rows) == 6
    for name, cells in rows:
        ends = [tp.simulate(scene, name)[name].release.detach for scene in ("drop", "drop-2cm")]
        values = [f"{value:.4f}" for end in ends for value in (end.omega, end.v_z)]
        assert cells.replace("−", "-").strip("| ").split(" | ") == values, name


def test_python_of_the_readme_runs(tmp_path, monkeypatch) -> None:
    """As it stands there."""
    monkeypatch.chdir(tmp_path)
    assert variables_of("README.md")["plan"].status == "solved"
    assert len(commands_of((ROOT / "README.md").read_text(encoding="utf-8"))) >= 5


def test_python_of_the_page_of_models_runs() -> None:
    found = variables_of("docs/models.md")
    _, _, _, down_x, down_z, turning = np.array(found["now"]["rates"]).ravel()
    assert turning < -1.0 and abs(down_x) + abs(down_z) < 1e-3
    assert np.array(found["now"]["excess"]).ravel() == pytest.approx([0.22, -7.6], abs=0.05)
    assert found["slope"](1.0) > 0.0 and found["many"]["rates"].shape == (6, 50)
    body, contact = found["case"].body, found["case"].contact
    at_rest = HandMotion(theta=0.0, omega=0.0, a_x=0.0, a_z=0.0, alpha=0.0)
    exact = SlidingPivot(body, contact).rates(np.zeros(6), at_rest, 5.0)
    assert turning == pytest.approx(exact[5], rel=1e-3)
    exact = MODELS["ls-step"].release(found["case"]).end
    assert found["path"][:, -1] == pytest.approx(exact, rel=0.01, abs=1e-5)
    assert np.isfinite(found["result"].landing).all()


def test_messages_that_need_an_explanation_are_the_program_s() -> None:
    said = [path.read_text(encoding="utf-8") for path in (ROOT / "core").glob("*.c")]
    for path in Path(tp.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                said.append(node.value)
    words, found = re.sub(r"\s+", " ", "\n".join(said)), 0
    text = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    for row in re.findall(r"^\| (`.*?) \|", text, flags=re.M):
        for message in re.findall("`([^`]+)`", row):
            for part in re.split(r"\s*[…;,:%]\s*", message):
                assert len(part) < 10 or part in words, (message, part)
                found += len(part) >= 10
    assert found > 100


def variables_of(page: str) -> dict[str, Any]:
    """What the Python of a page leaves, run as it stands there."""
    text, found = (ROOT / page).read_text(encoding="utf-8"), dict[str, Any]()
    for code in re.findall(r"^```python\n(.*?)^```", text, flags=re.M | re.S):
        exec(compile(code, page, "exec"), found)
    return found
