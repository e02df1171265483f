"""The programs of docs/python.md and docs/stacks.md: each runs by itself and does what it says."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
import throwplan as tp
from throwplan import robots

ROOT = Path(__file__).parent.parent.parent
#: Lag [s] of the stand-in for a UR, and how often its joints are integrated in a cycle of 2 ms.
LAG, STEPS = 0.034, 20


def programs_of(page: str) -> list[str]:
    """The Python of a page, block by block."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```", text, flags=re.M | re.S)


def run_program(page: str, number: int) -> SimpleNamespace:
    """The variables that a program of a page leaves."""
    found = dict[str, Any]()
    exec(compile(programs_of(page)[number], f"{page}, program {number + 1}", "exec"), found)
    return SimpleNamespace(**{name: value for name, value in found.items() if name[0] != "_"})


def draws(found: Any) -> bool:
    files = {path.name for path in Path("out/throw").iterdir()}
    return found.plan.solved and files == {"plan.json", "motion.csv", "throw.png"}


def has_joints(found: Any) -> bool:
    """The joints' rates are the slopes of the joints."""
    slopes = np.gradient(found.q, found.sent.times, axis=0)
    opens = found.release["opening_time"]
    known = np.allclose(slopes, found.dq, atol=0.02) and found.q.shape[1] == 7
    return known and found.sent.times[0] < opens < found.sent.times[-1]


def plans_all(found: Any) -> bool:
    allowed = found.planner.scene.tolerance.position
    plans = found.plans
    return len(plans) == 50 and all(one.solved and one.error_sent()[0] < allowed for one in plans)


def counts_landings(found: Any) -> bool:
    """Throws near the expected friction and delay land."""
    middle = np.hypot(found.late, found.other) < 0.3
    return found.plan.solved and found.lands[middle].all() and not found.lands.all()


def shows_what_quiet_does(found: Any) -> bool:
    """The program leaves the loud throw's landings; the quiet one is thrown again."""
    plan = tp.Planner(found.quiet).plan()
    x = tp.simulate_batch(plan, found.model, friction=found.friction).landing[:, 0]
    return bool(10 * np.ptp(x) < np.ptp(found.x))


def detaches(found: Any) -> bool:
    """As the exact model does, but for the smoothing."""
    scene = tp.load_scene("drop").replace(
        object=tp.Object(mass=0.24, inertia=535e-6, length=0.26, com=0.10),
        contact=tp.Contact(friction=1.0, patch_radius=0.0025),
        gripper=tp.Gripper(force=found.force, opening=found.opening),
    )
    exact = tp.simulate(scene, "sp")["sp"].release.detach
    values = {"normal_force": 0, "friction": 1.0, **found.hand, **found.bar}
    state = found.dynamics(state=found.end[:6], **values)["object"].full()[:, 0]
    return np.allclose(state[3:], [exact.v_x, exact.v_z, exact.omega], atol=5e-3)


def has_exact_slopes(found: Any) -> bool:
    """Those of central differences."""
    middle, steps = np.array([1.0, 0.24]), np.diag([1e-3, 1e-4])
    up, down = ([float(found.slope(middle + sign * s)[0]) for s in steps] for sign in (1, -1))
    differences = (np.array(up) - down) / (2 * np.diag(steps))
    return np.allclose(found.slope(middle)[1].full()[0], differences, rtol=1e-3)


def keeps_below(found: Any) -> bool:
    return found.plan.solved and found.top(found.plan.sent_throw()) <= found.ceiling.high


def takes_the_other_arm(found: Any) -> bool:
    return found.plan.solved and found.plan.path().joints.shape[1] == 6


def sends_all_rows(found: Any) -> bool:
    """From rest to rest, which controllers of trajectories ask for."""
    rates = np.array([dq for _, dq in found.sent])
    rests = not rates[0].any() and not rates[-1].any()
    return rests and len(rates) == len(found.motion.q) and 0 < found.opening.cycle < len(rates)


def plans_by_its_law(found: Any) -> bool:
    return found.plan.solved and found.plan.to_dict()["decides"] == "own"


def lands(found: Any) -> bool:
    return found.plan.solved and found.plan.error_sent()[0] < 1e-6


def plans_with_the_force(found: Any) -> bool:
    return tp.Planner(found.scene).plan().solved and found.force[50] == pytest.approx(25.0)


#: What each program of docs/python.md must have done.
CHECKS = (
    draws,
    has_joints,
    plans_all,
    counts_landings,
    shows_what_quiet_does,
    detaches,
    has_exact_slopes,
    keeps_below,
    takes_the_other_arm,
    sends_all_rows,
    plans_by_its_law,
    lands,
    plans_with_the_force,
)
#: Programs that plan for long.
SLOW = {plans_by_its_law}


def test_each_program_of_the_page_of_python_has_a_check() -> None:
    assert len(programs_of("docs/python.md")) == len(CHECKS)


@pytest.mark.parametrize(
    ("number", "check"),
    [
        pytest.param(number, check, marks=[pytest.mark.slow] * (check in SLOW), id=check.__name__)
        for number, check in enumerate(CHECKS)
    ],
)
def test_a_program_of_the_page_of_python_runs(number, check, tmp_path, monkeypatch) -> None:
    """Each in variables and a folder of its own."""
    monkeypatch.chdir(tmp_path)
    assert check(run_program("docs/python.md", number))


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
    run_program("docs/stacks.md", 0)
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
        found = run_program("docs/stacks.md", 1)
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
