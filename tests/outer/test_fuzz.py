"""Fails if a file or words, whatever they hold, get a traceback, a NaN or no answer.

Each class of input has a strategy, each command words. A case fails where the exit status is none
of the four, a line on stderr is not the program's, JSON or text hold a NaN that nobody gave, or
30 s of processor time bring no answer. Warnings are errors in tests.
"""

from __future__ import annotations

import json
import re
import signal
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

import hostile
import pytest
import throwplan as tp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from job_lists import ONE
from planar_urdf import ODD_OPTIONS, planar_urdf
from throwplan.cli import COMMANDS

#: Files by name, and the words of the command that reads them.
Case = tuple[dict[str, bytes], list[str]]
STATUSES, LONGEST = (0, 2, 3, 130), 30.0


class Shown(tuple):
    """A case that prints in short: hypothesis warns of a long one, and that hides the failure."""

    def __repr__(self) -> str:
        return f"{super().__repr__():.20000}"


#: More sections of each manipulator's scene, in which a wrong value may stand.
MORE = """
[landing]
speed_min = 1.0
speed_max = 9.0
rate_max = 8.0
[nlp]
carry = 10
opening = 10
epsilon = 0.03
[cost]
time = 5.0
"""
ARM_SECTIONS = """
[grasp]
offset = 0.01
angle_deg = 5.0
[torque]
limits = [80.0, 80.0, 10.0]
margin = 0.1
"""
SCENES = {
    "near-cup": tomllib.loads(tp.scene_text("near-cup") + MORE + ARM_SECTIONS),
    "hand-flip": tomllib.loads(tp.scene_text("hand-flip") + MORE),
    "drop": tomllib.loads(tp.scene_text("drop")),
}
ARM = tomllib.loads((resources.files(tp) / "problems" / "arms" / "panda.toml").read_text("utf-8"))
PLAN = ["plan", "scene.toml", "--patience", "0.001"]
REFUSED = ["sweep", "scene.toml", "--samples", "0"]

#: A data set of two throws.
DATA = {
    "landing_height": -0.8,
    "objects": {"bar": {"mass": 0.24, "inertia": 0.000535, "length": 0.26, "com": 0.1}},
    "truth": {"friction": 0.8},
}
THROWS = """throw,object,command,x,z,theta,motion,grip,grasp_offset,surface
1,bar,0.1001,1.0,-0.8,7.5,motion.csv,grip.csv,0.0,wood
2,bar,0.1,1.1,-0.8,7.2,motion.csv,grip.csv,0.001,wood
"""
MOTION = "t,x,z,theta\n" + "".join(f"{t / 100},{t / 50},{t / 100},{-t / 9}\n" for t in range(40))
GRIP = "t,f_N\n0,100\n0.05,100\n0.08,40\n0.115,0\n"
CHAIN = ["--joints", "turn", "lift", "bend", "flick"]

#: Of each command what it is about, and its options with how many values each takes.
WORDS: dict[str, tuple[str, dict[str, int]]] = {
    "plan": (
        "hand-box --patience 0.001",
        {"--target": 3, "--azimuth": 1, "--alternatives": 1, "--solver": 1, "--robust": 1}
        | {"--turns": 1, "--out": 1, "--json": 0},
    ),
    "simulate": ("drop", {"--model": 1, "--out": 1, "--json": 0, "--x": 0}),
    "sweep": ("drop", {"--samples": 1, "--seed": 1, "--workers": 1, "--target": 3, "--out": 1}),
    "map": ("drop", {"--z": 1, "--samples": 1, "--out": 1, "--json": 0}),
    "prepare": ("drop", {"--throws": 1, "--json": 0}),
    "scenes": ("", {"--write": 1, "--draw": 1, "--keys": 0, "--json": 0}),
    "cycle": ("nothing", {"--patience": 1, "--out": 1, "--json": 0}),
    "view": ("nothing", {"--port": 1, "--hold": 1, "--mp4": 1}),
    "play": ("drop", {"--port": 1, "--hold": 1, "--no-browser": 0}),
    "run": ("nothing", {"--robot": 1, "--repeat": 1, "--after": 1, "--dry": 0}),
    "correct": ("nothing run.csv", {"--out": 1, "--json": 0}),
    "export": ("nothing", {"--franka": 1, "--ros": 1, "--joint-names": 2, "--open-width": 1}),
    "import-robot": ("nothing.urdf", {"--out": 1, "--joints": 2, "--tcp": 1, "--jerk": 2}),
    "import-object": ("nothing.stl", {"--out": 1, "--grasp": 3, "--mass": 1, "--unit": 1}),
    "replay": ("nothing", {"--restitution": 1, "--out": 1, "--json": 0}),
    "identify": ("nothing", {"--model": 1, "--throws": 1, "--only": 1, "--prior": 1}),
    "calibrate": ("nothing", {"--scene": 1, "--level": 1, "--throws": 1, "--fit": 0}),
}


@st.composite
def scene_cases(draw: st.DrawFn) -> Case:
    """Scene files; one in ten of those for planning is planned."""
    name = draw(st.sampled_from(sorted(SCENES)))
    files = {"scene.toml": draw(hostile.toml_file(SCENES[name]))}
    if name == "drop":
        return files, ["simulate", "scene.toml"]
    return files, REFUSED if draw(st.integers(0, 9)) else PLAN


@st.composite
def arm_cases(draw: st.DrawFn) -> Case:
    """Arm data files in the scene `pose`."""
    scene = tomllib.loads(tp.scene_text("pose"))
    scene["robot"] = {"arm": "arm.toml"}
    files = {"arm.toml": draw(hostile.toml_file(ARM)), "scene.toml": hostile.toml(scene).encode()}
    return files, REFUSED if draw(st.integers(0, 9)) else PLAN


@st.composite
def data_cases(draw: st.DrawFn) -> Case:
    """Data sets of throws: one of their files is wrong."""
    wrong = draw(st.sampled_from(["dataset.toml", "throws.csv", "motion.csv", "grip.csv"]))
    files = {"dataset.toml": hostile.toml(DATA).encode()}
    for name, text in (("throws.csv", THROWS), ("motion.csv", MOTION), ("grip.csv", GRIP)):
        files[name] = draw(hostile.csv_file(text)) if name == wrong else text.encode()
    if wrong == "dataset.toml":
        files[wrong] = draw(hostile.toml_file(DATA))
    return files, ["identify", "."]


@st.composite
def urdf_cases(draw: st.DrawFn) -> Case:
    """URDF files of a planar arm."""
    chain = draw(st.sampled_from([CHAIN, []]))
    words = ["import-robot", "odd.urdf", "--out", "arm.toml", *chain, *ODD_OPTIONS]
    return {"odd.urdf": draw(hostile.xml_file(planar_urdf()))}, words


@st.composite
def job_cases(draw: st.DrawFn) -> Case:
    """Job files of a cycle, which is given no time to be planned."""
    file = draw(hostile.toml_file(tomllib.loads(ONE)))
    return {"jobs.toml": file}, ["cycle", "jobs.toml", "--patience", "0.001"]


@st.composite
def line_cases(draw: st.DrawFn, name: str) -> Case:
    """Words of a command; what it does, if they are right, is short."""
    about, options = WORDS[name]
    return {}, draw(hostile.command_line(options, [name, *about.split()]))


@st.composite
def plan_cases(draw: st.DrawFn, folder: Path) -> Case:
    """A saved plan: plan.json or motion.csv is wrong."""
    plan = json.loads((folder / "plan.json").read_text())
    motion = (folder / "motion.csv").read_text()
    files = {"plan.json": json.dumps(plan).encode(), "motion.csv": motion.encode()}
    if draw(st.integers(0, 3)):
        files["plan.json"] = draw(hostile.json_file(plan))
    else:
        files["motion.csv"] = draw(hostile.csv_file(motion))
    commands = [["export", ".", "--ros", "ros"], ["replay", "."], ["view", ".", "--mp4", "a.txt"]]
    return files, draw(st.sampled_from(commands))


STRATEGIES: dict[str, Callable[..., st.SearchStrategy[Case]]] = {
    "scenes": scene_cases,
    "arms": arm_cases,
    "throw data": data_cases,
    "urdf": urdf_cases,
    "jobs": job_cases,
    "plans": plan_cases,
}


class TooLong(BaseException):
    """No answer in time; no `except Exception` catches it."""


@contextmanager
def in_time() -> Iterator[None]:
    """Raises TooLong after LONGEST seconds of processor time."""

    def stop(*_: object) -> None:
        raise TooLong

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def judge(run: Callable[..., Any], case: Case, folder: Path) -> None:
    """Run a case in `folder`, which is the working directory, and assert what holds for all."""
    files, words = case
    for name, content in files.items():
        (folder / name).write_bytes(content)
    with in_time():
        try:
            said = run("", *words)
        except SystemExit as exit:  # --help, --version
            assert exit.code == 0
            return
    assert said.status in STATUSES
    for line in said.err.splitlines():
        assert line.startswith("throwplan: ") and len(line) < 3000, said.err
    assert said.status != 2 or said.err, said
    given = b"".join(files.values()).decode("utf-8", "replace") + " ".join(words)
    if "nan" not in given.lower():
        assert not re.search(r"\bnan\b", said.out, re.I), said.out
    if "--json" in words:
        said.json  # noqa: B018


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """The working directory, a folder deep, for paths that go up."""
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    return folder


def judge_all(cases: st.SearchStrategy[Case], count: int, run, here) -> None:
    """A few are the same ones each time."""

    @settings(
        max_examples=count,
        derandomize=count < 50,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(case=cases.map(Shown))
    def judged(case: Case) -> None:
        judge(run, case, here)

    judged()


@pytest.mark.parametrize("count", [20, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", STRATEGIES)
def test_hostile_files_are_answered(kind, count, run, here, saved) -> None:
    folder = [saved("pose")] if kind == "plans" else []
    judge_all(STRATEGIES[kind](*folder), count, run, here)


@pytest.mark.parametrize("count", [6, pytest.param(50, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", COMMANDS)
def test_hostile_words_are_answered(name, count, run, here) -> None:
    judge_all(line_cases(name), count, run, here)
