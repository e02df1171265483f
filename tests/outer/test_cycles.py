"""Cycles: many picks and bins as one motion, by their files and judged by code of its own."""

from __future__ import annotations

import json
import shutil
import statistics
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from job_lists import ONE, write_random_jobs
from throwplan.planner.cli import main
from throwplan.planner.cycle import plan_cycle, read_cycle, save_cycle
from throwplan.problems import jobs_names, load_jobs

from oracle import broken_limits


def test_a_cycle_breaks_no_limit(cycled: Path) -> None:
    assert broken_limits(cycled) == []


def test_it_is_faster_than_with_stops_and_returns(cycled: Path) -> None:
    cycle = json.loads((cycled / "cycle.json").read_text())
    assert cycle["duration"] < cycle["with_stops"]
    q = read_cycle(cycled).samples.q
    assert np.array_equal(q[0], q[-1])


def test_a_cycle_is_read_back_and_judged_again(cycled: Path, tmp_path: Path) -> None:
    cycle = read_cycle(cycled)
    assert cycle.solved
    save_cycle(cycle, tmp_path)
    assert (tmp_path / "motion.csv").read_text() == (cycled / "motion.csv").read_text()


def test_an_edited_motion_is_refused_by_the_verdict(cycled: Path, tmp_path: Path) -> None:
    """A joint that jumps at one sample breaks limits of velocity, acceleration or jerk."""
    shutil.copy(cycled / "cycle.json", tmp_path)
    lines = (cycled / "motion.csv").read_text().splitlines()
    cells = lines[200].split(",")
    cells[1] = str(float(cells[1]) + 0.01)
    lines[200] = ",".join(cells)
    (tmp_path / "motion.csv").write_text("\n".join(lines) + "\n")
    cycle = read_cycle(tmp_path)
    assert not cycle.solved
    assert "joint 1" in cycle.verdict.words


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({'scene = "pose"': 'scene = "poze"'}, "did you mean 'pose'"),
        ({'scene = "pose"': 'scene = "drop"'}, "has no [robot]"),
        ({'scene = "pose"': 'scene = "pose"\norder = "any"'}, "order = 'any'"),
        ({'scene = "pose"': 'scene = "pose"\nhome_deg = [0.0]'}, "must be a list of 7 angles"),
        ({"z = 0.35": ""}, "pick 1: give 'joints_deg', or all of 'x', 'y' and 'z'"),
        ({"z = 0.35": "z = 0.35\nbins = ['bn']"}, "pick 1: bins: no bin 'bn', did you mean 'bin'?"),
        ({"z = 0.35": "z = 0.35\ngrasp_time = -1"}, "pick 1: grasp_time = -1"),
        ({"z = 0.35": "z = 0.35\nobject = { mass = -1 }"}, "pick 1: [object] mass = -1"),
        ({"z = 0.2,": ""}, "bin 1: [target] key 'z' is missing"),
        ({"target = {": "goal = {"}, "section [bin.target] is missing"),
        ({"theta_deg = -90.0 }": "theta_deg = -90.0 }\ncup = { radius = 1 }"}, "bin 1: [cup]"),
        ({"x = 0.45": "x = 2.45"}, "pick 1: hand pose x = 2.45"),
        ({"[[pick]]": "[[pck]]"}, "unknown key 'pck'"),
    ],
)
def test_mistakes_are_lines(
    changes: dict[str, str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = ONE
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    assert main(["cycle", str(file), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert all(line.startswith("throwplan: ") for line in error.splitlines())
    assert not (tmp_path / "out").exists()


def test_each_mistake_has_a_line(tmp_path: Path) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(
        ONE.replace("z = 0.35", "z = 'up'\nbins = []").replace("z = 0.2,", "z = 'low',")
    )
    with pytest.raises(tp.InputError) as error:
        load_jobs(file)
    assert "pick 1: z = 'up'" in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("name", jobs_names())
def test_shipped_jobs_are_solved(name: str, tmp_path: Path) -> None:
    cycle = plan_cycle(load_jobs(name))
    assert cycle.solved, cycle.message
    save_cycle(cycle, tmp_path)
    assert broken_limits(tmp_path) == []


@pytest.mark.slow
def test_random_job_lists_break_no_limit(tmp_path: Path) -> None:
    """Lists of 8 objects and 3 bins; in the median well below the time with stops."""
    ratios = []
    # For an object of the last two, no motion leads into the swing without a stop.
    for seed in (0, 3, 5, 7):
        cycle = plan_cycle(load_jobs(write_random_jobs(tmp_path, seed)))
        assert cycle.solved, (seed, cycle.message)
        save_cycle(cycle, tmp_path)
        assert broken_limits(tmp_path) == [], seed
        ratios.append(cycle.duration / cycle.stops)
    assert max(ratios) < 1.0 and statistics.median(ratios) < 0.9


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "plan.json: no such file"),
        ("{", "cycle.json: is not JSON"),
        ('{"status": "solved"}', "cycle.json: is not a cycle file"),
        ('{"steps": [], "format": 0}', "a cycle file of version 0, must be 1"),
    ],
)
def test_folders_without_a_cycle_are_named(text, words, tmp_path, refused) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    if text is not None:
        (folder / "cycle.json").write_text(text)
    commands = ("export", folder, "--ros", tmp_path / "bag"), ("replay", folder), ("view", folder)
    for command in commands:
        said = refused(*command)
        assert words in said and str(folder) in said
