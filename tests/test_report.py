"""The report's frame: what is written where, and what is refused; and its reach study's parts."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from PIL import Image
from throwplan.planner.cli import main
from throwplan.planner.report import throws
from throwplan.planner.report.kept import kept
from throwplan.planner.report.page import Effort, Picture, Section, Table
from throwplan.planner.report.planner import variants
from throwplan.planner.report.planner_points import best_of, points
from throwplan.planner.report.planner_runs import Measured
from throwplan.planner.report.reach import FAR, outside
from throwplan.planner.report.run import SECTIONS, make_report, write
from throwplan.planner.report.single_shooting import SingleShooting

ROWS = [["a | b", 1 / 3, 7, None], ["c", math.nan, 123456.789, "<why>"]]


def draw(path: Path) -> None:
    """Two colours and all shades between them, more than a palette holds."""
    shades = np.linspace(0, 255, 40 * 300).reshape(40, 300, 1)
    Image.fromarray(np.concatenate([shades, 0 * shades, 255 - shades], axis=2).astype("u1")).save(
        path, "PNG"
    )


def test_a_section_is_written_as_markdown_html_csv_and_pictures(tmp_path: Path) -> None:
    section = Section("parts", "What < that", seconds=1.0)
    section.add("Words with `code`.", Table("sizes", "Sizes", ("name", "x", "n", "why"), ROWS))
    dots = Table("dots", "", ("x", "y"), [[1, 2.5]])
    section.add(Picture("drawn", "A & B", draw, dots))
    write(tmp_path, ["made here"], section, [section])
    assert {path.name for path in tmp_path.iterdir()} == {
        *("index.md", "index.html", "report.json", "sizes.csv", "drawn.png", "dots.csv")
    }
    assert (tmp_path / "dots.csv").read_text().split() == ["x,y", "1,2.5"]
    text = (tmp_path / "index.md").read_text()
    assert "| a \\| b | 0.333 | 7 | – |" in text and "| c | – | 123457 | <why> |" in text
    assert "throwplan report --only parts" in text and "](sizes.csv)" in text
    assert "*A & B* ([dots.csv](dots.csv))" in text
    page = (tmp_path / "index.html").read_text()
    assert "&lt;why&gt;" in page and "<code>code</code>" in page and "A &amp; B" in page
    # Self-contained: no file beside it, nothing from elsewhere.
    assert "data:image/png;base64," in page and 'src="http' not in page and ".png" not in page
    with Image.open(tmp_path / "drawn.png") as picture:
        drawn, shown = tmp_path / "whole.png", np.asarray(picture.convert("RGB"), float)
        assert picture.mode == "P"
    draw(drawn)
    with Image.open(drawn) as picture:
        assert np.abs(np.asarray(picture, float) - shown).max() < 8
    with (tmp_path / "sizes.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["name", "x", "n", "why"] and rows[1] == ["a | b", str(1 / 3), "7", ""]


def test_a_second_section_stands_beside_the_first(tmp_path: Path) -> None:
    one = Section("parts", "One", [Table("first", "First", ("a",), [[1]])], 1.0)
    two = Section("reach", "Two", [Table("second", "Second", ("a",), [[2]])], 1.0)
    write(tmp_path, [], one, [one])
    write(tmp_path, [], two, [two, one])
    text = (tmp_path / "index.md").read_text()
    assert text.index("## One") < text.index("## Two")
    assert (tmp_path / "first.csv").exists() and (tmp_path / "second.csv").exists()


def test_one_section_measured_again_leaves_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is kept is read back to the digit; a section whose files are gone is not shown."""
    one = Section(
        "parts", "One", ["Words.", Table("first", "First", ("a", "b", "c", "d"), ROWS)], 1.0, "then"
    )
    one.short.append("Take that.")
    one.add(Picture("drawn", "A", draw, Table("dots", "", ("x",), [[1]])))
    write(tmp_path, ["now", "here"], one, [one])
    (found,) = kept(tmp_path)
    assert found.parts[0] == "Words." and found.made == "then" and found.short == one.short
    assert isinstance(found.parts[1], Table) and str(found.parts[1].rows) == str(ROWS)

    def make(effort: Effort) -> Section:
        return Section("reach", "Two", [Table("second", "Second", ("a",), [[2]])])

    monkeypatch.setattr("throwplan.planner.report.reach.make", make)
    make_report(tmp_path, ["reach"])
    text = (tmp_path / "index.md").read_text()
    assert text.index("## One") < text.index("then") < text.index("## Two")
    assert text.index("Put together from sections") < text.index("## One")
    assert text.index("- Take that. ([One](#parts))") < text.index('<a id="parts"></a>')
    (tmp_path / "first.csv").unlink()
    assert [section.key for section in kept(tmp_path)] == ["reach"]


def test_unknown_sections_and_folders_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", "--only", "maths", "--out", str(tmp_path / "r")]) == 2
    words = capsys.readouterr().err
    assert "--only maths: must be one of" in words and all(key in words for key in SECTIONS)
    assert not (tmp_path / "r").exists()
    (tmp_path / "file").write_text("")
    assert main(["report", "--out", str(tmp_path / "file" / "r")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def measured(
    milliseconds: float, millimetres: float, solved: int = 10, cost: float = 2.0
) -> Measured:
    # Targets differ more than settings do; the first solve of each fails.
    target = np.array([math.nan, 1.0, 9.0, 1.0, 4.0, 0.1, 1.0, 2.0, 0.3, 1.0])
    errors = np.outer(target, [1e-3 * millimetres, 0.0])
    times, none = 1e-3 * milliseconds * np.nan_to_num(target, nan=5.0), np.zeros((0, 2))
    return Measured(solved, errors, errors, cost * target, times, times, 10, times, none, "")


def best(*found: Measured) -> list[bool]:
    return best_of(points(list(found)))


def test_the_pareto_set_is_what_nothing_beats() -> None:
    found = [measured(10, 1.0), measured(20, 0.1), measured(20, 1.0), measured(1, 0.01, solved=5)]
    # The last is best in both, but half of its solves fail.
    assert best(*found) == [True, True, False, False]
    # What differs by less than rows do by chance decides nothing.
    assert best(measured(10, 1.0), measured(10.5, 0.99)) == [True, True]
    assert best(measured(10, 1.0), measured(40, 0.99)) == [True, False]
    # A slower one stays if its throws cost less; the effort does not differ by chance.
    assert best(measured(10, 1.0), measured(40, 1.0, cost=1.98)) == [True, True]
    assert best(measured(10, 1.0), measured(40, 1.0, cost=1.999)) == [True, False]
    assert best(measured(10, 1.0), measured(10, 1.0, cost=2.01)) == [True, False]
    # Other targets' errors do not hide a setting that is nearer for each.
    assert points([measured(10, 1.0), measured(10, 0.5)])[:, 1] == pytest.approx([1.0, 0.5])


def test_variants_differ_and_the_usual_comes_first() -> None:
    for quick in (True, False):
        found = variants(Effort(quick))
        assert found[0].mesh == () and len(set(found)) == len(found)
        usual = tp.load_scene("cup").mesh
        for variant in found[2:]:
            changed = any(getattr(usual, name) != value for name, value in variant.mesh)
            assert changed or variant.compiling == "wait"


def test_targets_outside_are_far_from_every_landing() -> None:
    scene = tp.load_scene("pose")
    targets = outside(scene, 20, seed=3)
    x, theta, _ = tp.Planner(scene).releases().landings(scene.target.z, scene.gravity)
    for target in targets:
        near = (np.abs(x - target.plane_x) < FAR[0]) & (np.abs(theta - target.theta) < FAR[1])
        # The planner's own table is none of those that were looked at: few, if any, are near.
        assert near.mean() < 1e-3


@pytest.mark.usefixtures("compiling")
def test_the_throws_section_has_its_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(throws, "LEARNERS", ("sp",))
    section = throws.make(Effort(quick=True))
    tables = {part.name: part for part in section.parts if isinstance(part, Table)}
    rows = [
        dict(zip(tables["identified"].columns, r, strict=True)) for r in tables["identified"].rows
    ]
    found = {row["model"]: row for row in rows}
    assert list(found) == ["ls", "sp", "ls-step"]
    for model in ("sp", "ls-step"):
        # One throw a condition: the fit is nearer the truth than a cell of the grid is wide.
        assert found[model]["fit, μ r_p / truth"] == pytest.approx(1.0, abs=0.1)
        assert found[model]["grid, least error [mm]"] < found["ls"]["grid, least error [mm]"] / 4
    for model, count, error, *_ in tables["learning"].rows:
        assert model in ("sp", "ls-step") and count == 3 and 0 < error < 25
    for part in section.parts:
        if not isinstance(part, str):
            part.write(tmp_path)
    assert (tmp_path / "throws-grid-ls-step.png").stat().st_size > 20_000


def test_single_shooting_reaches_what_the_planner_reaches() -> None:
    """SciPy's SLSQP on the same rows: an independent optimiser of the planner's NLP."""
    scene = tp.load_scene("hand-box")
    planner, target = tp.Planner(scene, compiling="no"), scene.target
    assert target is not None
    releases = planner.releases()
    index = planner.starts(target)[0][0]
    flight = releases.flight_time(index, target.z, scene.gravity)
    solved, _ = SingleShooting(scene).solve(scene, target, releases, index, flight)
    assert solved
