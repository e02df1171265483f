"""Fails if the report lacks a section, or has empty tables, NaN, dead links or mixed commits."""

from __future__ import annotations

import csv
import dataclasses
import os
import re
import time
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from throwplan.models.release import SlidingPivotRelease, SteppedRelease

from benchmarks import PAGE, SECTIONS, extremes, make_report, processes, releases, report
from benchmarks.__main__ import main
from benchmarks.judge import judge

KEPT = Path(__file__).parents[2] / "docs" / PAGE


def check_page(path: Path) -> None:
    """Tables have rows of one length, numbers are finite, links lead to files; no solved plan is
    wrong, and none ends as it must not."""
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"\b(nan|inf|None)\b", text)
    parts = re.split(r"^## ", text, flags=re.M)
    assert re.search(r"commit [0-9a-f]{8}\b", parts[0]) and "nothing here was thrown" in parts[0]
    for part in parts[1:]:
        tables = re.findall(r"(?:^\|.*\|\n)+", part + "\n", flags=re.M)
        assert tables, part
        for table in tables:
            lines = [re.split(r"(?<!\\)\|", line)[1:-1] for line in table.splitlines()]
            assert len(lines) > 2 and len({len(cells) for cells in lines}) == 1
            assert all(re.fullmatch(r" -+:? ", cell) for cell in lines[1])
            for column in zip(*lines, strict=True):
                if column[0].strip() in ("defects", "wrong"):
                    assert {cell.split()[0] for cell in column[2:]} == {"0"}, table
    links = re.findall(r"\]\(([^)]+)\)", text)
    for link in links:
        assert (path.parent / link).is_file(), link
        if link.endswith(".csv"):
            with (path.parent / link).open(newline="", encoding="utf-8") as file:
                rows = list(csv.reader(file))
            assert len(rows) > 1 and len({len(row) for row in rows}) == 1
    assert sum(link.endswith(".png") for link in links) <= 2


@pytest.mark.slow
def test_a_quick_run_writes_a_page_of_all_sections(tmp_path) -> None:
    done = list[tuple[int, int]]()
    seconds = make_report(tmp_path, quick=True, show=lambda key: lambda *step: done.append(step))
    assert seconds.keys() == SECTIONS.keys() and sum(a == b for a, b in done) == len(SECTIONS)
    check_page(tmp_path / PAGE)
    titles = re.findall(r"^## (.*)$", (tmp_path / PAGE).read_text(encoding="utf-8"), flags=re.M)
    assert titles == re.findall(r"^## (.*)$", KEPT.read_text(encoding="utf-8"), flags=re.M)
    assert len(titles) == len(SECTIONS)


def test_the_kept_page_is_short_and_whole() -> None:
    check_page(KEPT)
    page = KEPT.read_text(encoding="utf-8")
    assert "`make report`, commit" in page
    assert len(page.splitlines()) <= 250


def test_a_page_has_sections_of_one_commit_only(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(report, "commit_of_checkout", iter(["1234abcd", "5678abcd"]).__next__)
    with pytest.raises(tp.InputError, match="1234abcd became 5678abcd"):
        make_report(tmp_path, ["parts"], quick=True)
    assert not (tmp_path / PAGE).exists()


def test_unknown_sections_and_folders_are_refused(tmp_path, capsys) -> None:
    assert main(["--only", "maths", "--out", str(tmp_path / "r")]) == 2
    assert "--only maths: must be one of scenes, models" in capsys.readouterr().err
    assert not (tmp_path / "r").exists()
    (tmp_path / "file").write_text("")
    assert main(["--out", str(tmp_path / "file" / "r")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_judgement_is_of_what_the_plan_says(cup_plan) -> None:
    """The oracle's own tests say what it finds."""
    good = judge(cup_plan)
    assert good.broken == () and good.error + good.doubt < cup_plan.scene.tolerance.position
    aside = dataclasses.replace(cup_plan.target, x=cup_plan.target.x + 0.0025)
    assert "position" in judge(dataclasses.replace(cup_plan, target=aside)).broken


def test_extreme_cases_differ() -> None:
    found = extremes.cases()
    assert len(found) == len({case.name for case in found}) > 250
    assert max(case.scene.com_offset for case in found) >= 0.5


@pytest.mark.parametrize(
    ("law", "run", "close"),
    [("sp", SlidingPivotRelease(steps=32), 1e-7), ("ls", SteppedRelease(steps=20_000), 2e-4)],
)
def test_converged_answers_agree_with_other_methods(law, run, close) -> None:
    throws = releases.random_throws(2, 0)
    case = releases.case_of(throws, 1, tp.load_scene("drop").patch)
    found, truth = (np.array([end]) for end in (run.release(case).end, releases.TRUTHS[law](case)))
    assert releases.pose_errors(found, truth)[0] < close


def work(kind: str) -> str:
    if kind == "sleep":
        time.sleep(60)
    if kind == "die":
        os.kill(os.getpid(), 9)
    return kind


@pytest.mark.slow
def test_work_that_hangs_or_dies_is_told_and_the_rest_goes_on() -> None:
    jobs = [(word,) for word in ("a", "sleep", "b", "die", "c")]
    found = list(processes.in_processes(work, jobs, patience=20.0))
    assert found == ["a", "hang", "b", "crash", "c"]
