"""The report: what is written where; its judge and its converged answers."""

from __future__ import annotations

import csv
import dataclasses
import math
import os
import re
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import loud
from PIL import Image
from throwplan.models.release import SlidingPivotRelease, SteppedRelease
from throwplan.pictures import Table, new_figure

from benchmarks import (
    FROZEN,
    SECTIONS,
    Picture,
    ReportSection,
    extremes,
    make_report,
    measure,
    parts,
    processes,
)
from benchmarks import reference_releases as laws
from benchmarks.__main__ import main
from benchmarks.judge import judge
from benchmarks.page import parts_of, write_page
from benchmarks.summary import write_summary

ROWS = [
    {"name": "a | b", "x": 1 / 3, "n": 7, "why": None},
    {"name": "c", "x": math.nan, "n": 123456.789, "why": "<why>"},
]
ORDER = ("parts", "reach")
#: The report that is kept.
REPORT = Path(__file__).parents[2] / "docs" / "report"


def section(key: str, figure: str) -> ReportSection:
    table = Table(f"{key}-sizes", "Sizes", ROWS, short=True)
    dots = Table(f"{key}-dots", "Dots", [{"x": 1, "y": 2.5}])
    picture = Picture(key, "All of it", new_figure(2.0, 1.0))
    return ReportSection(key, f"About {key}", [figure], [table, dots], [picture], 1.0, "made here.")


def test_a_section_is_its_figures_a_short_table_pictures_and_links(tmp_path) -> None:
    one = section("parts", "It takes 3 ms.")
    one.write(tmp_path)
    write_page(tmp_path, {"parts": one.markdown()}, ORDER)
    assert {path.name for path in tmp_path.iterdir()} == {*one.files, "appendix.md"}
    text = (tmp_path / "appendix.md").read_text()
    assert "- It takes 3 ms." in text and "`python -m benchmarks --only parts`" in text
    assert "| a \\| b | 0.333 |      7 | –     |" in text
    assert "[Dots](parts-dots.csv)" in text and "2.5" not in text and "parts.png" in text
    with (tmp_path / "parts-sizes.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[:2] == [["name", "x", "n", "why"], ["a | b", str(1 / 3), "7", ""]]
    with Image.open(tmp_path / "parts.png") as picture:
        assert picture.mode == "P" and picture.width > picture.height


def test_a_mean_has_its_spread_beside_it_and_in_columns_of_its_own(tmp_path) -> None:
    table = Table(
        "t", "Spreads", [{"x": (0.5, 0.125), "y": (1.0, 0.5, 2.0)}, {"x": None, "y": 3.0}]
    )
    assert table.markdown()[2:] == [
        "| 0.5 ± 0.125 | 1 (0.5 to 2) |",
        "|           – |            3 |",
    ]
    table.write(tmp_path)
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert lines == ["x,x std,y,y low,y high", "0.5,0.125,1.0,0.5,2.0", ",,3.0,,"]


def test_a_section_measured_again_replaces_its_own_part_of_the_page(tmp_path) -> None:
    assert parts_of(tmp_path) == {}
    one, two = section("parts", "Old."), section("reach", "Kept.")
    write_page(tmp_path, {s.key: s.markdown() for s in (two, one)}, ORDER)
    before = (tmp_path / "appendix.md").read_text()
    assert before.index("Old.") < before.index("Kept.")
    page = parts_of(tmp_path)
    write_page(tmp_path, page, ORDER)
    assert (tmp_path / "appendix.md").read_text() == before
    write_page(tmp_path, page | {"parts": section("parts", "New.").markdown()}, ORDER)
    assert (tmp_path / "appendix.md").read_text() == before.replace("Old.", "New.")


def test_the_first_page_is_made_of_the_tables_that_are_there(tmp_path) -> None:
    """Without tables nothing is said of them."""
    shutil.copytree(REPORT, tmp_path / "report")
    write_summary(tmp_path / "report", parts_of(REPORT))
    page = (tmp_path / "report" / "index.md").read_text()
    assert len(page.splitlines()) < 120 and page.count("*Measured ") == 5
    write_summary(tmp_path, {})
    empty = (tmp_path / "index.md").read_text()
    assert "## What is not validated" in empty and empty.count("\n## ") == 1


def test_a_frozen_section_names_its_commit_and_stays_when_others_are_measured(tmp_path) -> None:
    page = parts_of(REPORT)
    assert page.keys() <= {*SECTIONS, *FROZEN} and {*FROZEN} <= page.keys()
    for key in FROZEN:
        assert re.search(r"^`python -m .*` at commit [0-9a-f]{8}, ", page[key], flags=re.M), key
        for name in re.findall(r"\]\((\S+\.csv)\)", page[key]):
            assert (REPORT / name).is_file(), name
    write_page(tmp_path, page | {"parts": "New."}, (*SECTIONS, *FROZEN))
    assert {key: parts_of(tmp_path)[key] for key in FROZEN} == {key: page[key] for key in FROZEN}


@pytest.mark.slow
def test_a_quick_section_is_made(tmp_path) -> None:
    heard: list[tuple[int, int]] = []
    made = make_report(tmp_path, ["robust"], True, lambda key: lambda *done: heard.append(done))
    assert [one.key for one in made] == ["robust"] and heard[-1] == (3, 3)
    assert {path.name for path in tmp_path.iterdir()} == {*made[0].files, "appendix.md", "index.md"}
    with (tmp_path / "robust.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 and all(int(row["worse"]) == 0 for row in rows)
    assert all(float(row["times less, least"]) > 0.9 for row in rows)


@pytest.mark.slow
def test_the_first_page_takes_what_the_section_on_reach_measures(tmp_path) -> None:
    make_report(tmp_path, ["reach"], True)
    page = (tmp_path / "index.md").read_text()
    assert len(re.findall(r"^\| \S+ +\| \d+ random ", page, flags=re.M)) == 4
    assert len(re.findall(r"^\| hand-box +\| 10 over the map ", page, flags=re.M)) == 2


@pytest.mark.parametrize("figures", [2, 3])
def test_pareto_set_by_comparing_all_pairs(figures: int) -> None:
    rng = np.random.default_rng(1)
    for columns in rng.integers(1, 9, (40, figures, 12)):
        points = list(zip(*columns.tolist(), strict=True))
        best = {p for p in points if not any(q != p and all(map(int.__le__, q, p)) for q in points)}
        found = measure.pareto(*columns)
        assert {points[i] for i in found} == best and len(found) == len(best)


def test_what_differs_by_chance_decides_nothing() -> None:
    alike = measure.pareto([10, 10.5], [1.0, 0.99], margins=(0.1, 0.1))
    beaten = measure.pareto([10, 40], [1.0, 0.99], margins=(0.1, 0.1))
    assert alike == [0, 1] and beaten == [0]


def test_a_judgement_is_of_what_the_plan_says(cup_plan) -> None:
    """The oracle's own tests say what it finds."""
    assert cup_plan.throw is not None
    good = judge(cup_plan)
    assert good.broken == () and good.error + good.doubt < cup_plan.scene.tolerance.position
    aside = dataclasses.replace(cup_plan.target, x=cup_plan.target.x + 0.0025)
    assert "position" in judge(dataclasses.replace(cup_plan, target=aside)).broken


def test_there_are_332_cases_that_differ() -> None:
    found = extremes.cases()
    assert len(found) == len({case.name for case in found}) == 332
    h = np.array([case.scene.com_offset for case in found])
    assert (h == 0).sum() > 20 and h.max() >= 0.5


@pytest.mark.slow
def test_a_few_extreme_cases_are_finite_true_or_say_why() -> None:
    chosen = [case for case in extremes.some(40) if case.scene.robot is None][::12]
    found = [extremes.run(case) for case in chosen]
    assert all(one.finite and not one.false for one in found)
    assert sum(one.status == "solved" for one in found) >= len(found) // 2
    assert all(one.cause for one in found if one.status != "solved")


def work(kind: str) -> str:
    if kind == "sleep":
        time.sleep(60)
    if kind == "die":
        os.kill(os.getpid(), 9)
    return kind


@pytest.mark.slow
def test_work_that_hangs_or_dies_is_told_and_the_rest_goes_on() -> None:
    jobs = [("a",), ("sleep",), ("b",), ("die",), ("c",)]
    found = list(processes.in_processes(work, jobs, patience=20.0))
    assert found == ["a", "hang", "b", "crash", "c"]


THROW = laws.four_throws()[1]


@pytest.mark.parametrize(
    ("law", "run", "close"),
    [
        ("sp", SlidingPivotRelease(steps=32).release, 1e-8),
        ("ls", lambda case: laws.extrapolated(SteppedRelease(), 4000, case), 2e-6),
    ],
)
def test_converged_answers_agree_with_other_methods(law, run, close) -> None:
    truth = laws.TRUTHS[law](THROW.case)
    assert laws.off(THROW, run(THROW.case).end, truth) < close


@pytest.mark.slow
def test_each_part_adds_its_own_and_is_solved() -> None:
    """A pivot has an angle and a rate at each node of the opening; θ is one row more."""
    found = [
        parts.measured(scene, 1) for _, scene in list(parts.ladder(loud("hand-box")))[: parts.HAND]
    ]
    assert all(one["status"] == "solved" for one in found)
    sizes = np.array([(one["variables"], one["constraints"]) for one in found])
    pivot, angle, landing, cup = np.diff(sizes, axis=0).tolist()
    assert pivot[0] == pivot[1] > 0 and angle == [0, 1] and landing == [0, 3] and cup[0] > 0


def test_what_a_part_costs_does_not_depend_on_a_prepared_library(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    scene = tp.load_scene("hand-box")
    assert tp.Planner(scene).prepare(40) and tp.Planner(scene).plan().iterations == 0
    cost = parts.measured(scene, 1)
    assert cost["iterations"] > 0 and cost[parts.SOLVE] > 0


def test_unknown_sections_and_folders_are_refused(tmp_path, capsys) -> None:
    assert main(["--only", "maths", "--out", str(tmp_path / "r")]) == 2
    words = capsys.readouterr().err
    assert "--only maths: must be one of example, models, planner" in words
    assert not (tmp_path / "r").exists()
    (tmp_path / "file").write_text("")
    assert main(["--out", str(tmp_path / "file" / "r")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
