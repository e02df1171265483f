"""Fails if a block of a page does not run as it stands, plans nothing, or names no key."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
import throwplan as tp
from job_lists import TWO
from throwplan import cycles, robots

ROOT = Path(__file__).parent.parent.parent
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
#: Lag [s] of the stand-in for a UR, and how often its joints are integrated in a cycle of 2 ms.
LAG, STEPS = 0.034, 20
#: Pages whose blocks go on from each other, which test_documents.py runs; and one of excerpts.
TOGETHER, EXCERPTS = ("README.md", "models.md"), "contributing.md"


def blocks_of(page: Path, kind: str = "python") -> list[str]:
    """The blocks of a language on a page."""
    return re.findall(rf"^```{kind}\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)


def run_program(page: str, number: int) -> SimpleNamespace:
    """The variables that a program of a page leaves."""
    found = dict[str, Any]()
    code = blocks_of(ROOT / "docs" / page)[number]
    exec(compile(code, f"{page}, program {number + 1}", "exec"), found)
    return SimpleNamespace(**{name: value for name, value in found.items() if name[0] != "_"})


#: Programs that run by themselves; those that plan by a law of one's own or a cycle take long.
ALONE = [
    pytest.param(
        page.name,
        number,
        marks=[pytest.mark.slow] * ("SlidingPivot)" in code or "plan_cycle(" in code),
    )
    for page in PAGES
    if page.name not in (*TOGETHER, EXCERPTS, "stacks.md")
    for number, code in enumerate(blocks_of(page))
]


@pytest.mark.parametrize(("page", "number"), ALONE)
def test_a_program_runs_by_itself_and_plans_what_it_says(page, number, tmp_path, monkeypatch):
    """Each in variables and a folder of its own, where the files are that it names."""
    monkeypatch.chdir(tmp_path)
    Path("grip").mkdir()
    recorded = "times = [0.0, 0.02, 0.03, 0.05]\nforces = [50.0, 50.0, 20.0, 0.0]"
    text = re.sub(r"\[gripper\][^\[]*", f"[gripper]\n{recorded}\n\n", tp.scene_text("hand-flip"))
    Path("my.toml").write_text(text)
    jobs, load = tmp_path / "two.toml", cycles.load_jobs
    jobs.write_text(TWO)
    monkeypatch.setattr(cycles, "load_jobs", lambda name: load(jobs))
    found = vars(run_program(page, number))
    lists = (value if isinstance(value, list) else [value] for value in found.values())
    left = [one for some in lists for one in some]
    plans = [one for one in left if isinstance(one, tp.Plan)]
    scenes = [one for one in left if isinstance(one, tp.Scene) and one.motion is None]
    for plan in plans or map(tp.plan, scenes):
        off, tolerance = plan.error_sent(), plan.scene.tolerance
        assert plan.solved and off[0] <= tolerance.position and off[1] <= tolerance.angle


def test_excerpts_are_python() -> None:
    for code in blocks_of(ROOT / "docs" / EXCERPTS):
        compile(re.sub(r"(?m)^    ", "", code) if code[0] == " " else code, EXCERPTS, "exec")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_sections_on_a_page_have_keys_that_a_scene_has(page, run) -> None:
    """Job files and data sets, which begin with keys of their own, only are TOML."""
    parts = re.split(r"\n#+ ", run("scenes --keys").out)
    known = {part.splitlines()[0]: set(re.findall(r"^\| `(\w+)` \|", part, re.M)) for part in parts}
    for text in blocks_of(page, "toml"):
        table = tomllib.loads(text)
        if not all(isinstance(value, dict) for value in table.values()):
            continue
        for name, keys in table.items():
            assert set(keys) <= known[f"[{name}]"], (name, keys)


@pytest.fixture
def modules(monkeypatch) -> Any:
    """Takes stand-ins for modules that tests do not have."""

    def replace(**known: Any) -> None:
        for name, module in known.items():
            monkeypatch.setitem(sys.modules, name, module)

    return replace


@pytest.mark.slow
def test_franky_moves_to_the_start_of_a_plan(saved, modules, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("out").mkdir()
    Path("out/fr3").symlink_to(saved("fr3"))
    franky = MagicMock()
    modules(franky=franky)
    run_program("stacks.md", 0)
    np.testing.assert_allclose(franky.JointMotion.call_args[0][0], tp.read_motion("out/fr3").q[0])


class Ur:
    """A UR whose joints lag behind what `servoJ` sends, and all of ur_rtde's interfaces to it."""

    def __init__(self, *_: Any) -> None:
        self.q, self.sent = np.zeros(6), np.zeros(6)
        self.cycle = self.opened = self.stopped = 0

    def moveJ(self, q: list[float], *_: float) -> None:  # noqa: N802
        self.q = self.sent = np.array(q)

    def initPeriod(self) -> float:  # noqa: N802
        return 0.0

    def servoJ(self, q: list[float], *_: float) -> None:  # noqa: N802
        self.sent = np.array(q)

    def waitPeriod(self, _: float) -> None:  # noqa: N802
        self.cycle += 1
        for _ in range(STEPS):
            self.q = self.q + 0.002 / STEPS / LAG * (self.sent - self.q)

    def servoStop(self) -> None:  # noqa: N802
        self.stopped = self.cycle

    def getActualQ(self) -> list[float]:  # noqa: N802
        return self.q.tolist()

    def setToolDigitalOut(self, *_: Any) -> None:  # noqa: N802
        self.opened = self.cycle


@pytest.mark.slow
def test_the_lag_of_servoj_is_learnt(saved, modules, run, tmp_path, monkeypatch) -> None:
    """The program records a throw that misses, and sends the corrected motion in its place."""
    monkeypatch.chdir(tmp_path)
    Path("out").mkdir()
    Path("out/ur5e").symlink_to(saved("ur5e"))

    def thrown() -> Any:
        ur = Ur()
        interfaces = {"control": "RTDEControlInterface", "receive": "RTDEReceiveInterface"}
        for name, face in (interfaces | {"io": "RTDEIOInterface"}).items():
            modules(**{f"rtde_{name}": SimpleNamespace(**{face: lambda *_: ur})})
        found = run_program("stacks.md", 1)
        assert 2 * ur.opened <= found.opening.cycle < 2 * ur.opened + 2 <= 2 * ur.stopped
        np.testing.assert_allclose(ur.q, found.motion.q[-1], atol=1e-4)
        return run("correct", "out/ur5e", "run.csv", "--out", "out/next", "--json").json

    said, tolerance = thrown(), tp.load_scene("ur5e").tolerance
    assert said["recorded"]["lag"] == pytest.approx(LAG, rel=0.05)
    assert not said["recorded"]["succeeds"]
    assert said["expected"]["position"] < tolerance.position

    joints = np.genfromtxt("out/next/joints.csv", delimiter=",", names=True)
    command = np.genfromtxt("out/next/gripper.csv", delimiter=",", names=True, dtype=None)
    q = np.column_stack([joints[f"q{joint}"] for joint in range(1, 7)])
    monkeypatch.setattr(robots, "joint_motion", lambda _: SimpleNamespace(q=q))
    opening = SimpleNamespace(time=command["t"], cycle=command["cycle"])
    monkeypatch.setattr(robots, "commands_of", lambda _: [opening])
    assert thrown()["recorded"]["succeeds"]
