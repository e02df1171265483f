"""The tests have a cache folder of their own, and share plans of the built-in scenes."""

from __future__ import annotations

import itertools
import math
import os
import socket
import tempfile
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
import throwplan as tp
from builders import loud
from job_lists import TWO
from throwplan import cycles

# The processes of one run share their cache.
if "PYTEST_XDIST_WORKER" not in os.environ:
    _FOLDER = tempfile.TemporaryDirectory(prefix="throwplan-tests-")
    os.environ["THROWPLAN_CACHE"] = _FOLDER.name
    # Compiling costs more than a few plans gain; tests/inner/test_compile.py does it.
    os.environ["THROWPLAN_COMPILE"] = "0"


def pytest_terminal_summary(terminalreporter) -> None:
    """Prints how long the tests of each file took."""
    seconds: Counter[str] = Counter()
    for report in itertools.chain(*terminalreporter.stats.values()):
        if isinstance(report, pytest.TestReport):
            seconds[report.nodeid.split("::")[0]] += report.duration
    if len(seconds) > 1:
        terminalreporter.section("seconds in each file")
        for file, time in seconds.most_common():
            terminalreporter.write_line(f"{time:8.1f}  {file}")


@pytest.fixture(scope="session")
def planner_of() -> Callable[[str], tp.Planner]:
    """The planner of a built-in scene, made once; it keeps the nearest throws that it named."""
    return cache(tp.Planner)


@pytest.fixture(scope="session")
def pose_planner(planner_of) -> tp.Planner:
    """The planner of the scene `pose`."""
    return planner_of("pose")


@pytest.fixture(scope="session")
def plan_of(planner_of) -> Callable[[str], tp.Plan]:
    """The plan of a built-in scene, made once."""
    return cache(lambda name: planner_of(name).plan())


@pytest.fixture(scope="session")
def loud_planner_of() -> Callable[[str], tp.Planner]:
    """The planner of a built-in scene where the load on the pads costs nothing."""
    return cache(lambda name: tp.Planner(loud(name)))


@pytest.fixture(scope="session")
def loud_plan_of(loud_planner_of) -> Callable[[str], tp.Plan]:
    """Its plan."""
    return cache(lambda name: loud_planner_of(name).plan())


@pytest.fixture(scope="session")
def cup_plan(plan_of: Callable[[str], tp.Plan]) -> tp.Plan:
    """The plan of the scene `near-cup`."""
    return plan_of("near-cup")


@pytest.fixture(scope="session")
def saved(plan_of, tmp_path_factory) -> Callable[[str], Path]:
    """The folder of a built-in scene's plan without its pictures; not to be changed."""

    @cache
    def folder_of(name: str) -> Path:
        folder = tmp_path_factory.mktemp(name)
        plan_of(name).save(folder)
        return folder

    return folder_of


@pytest.fixture(scope="session")
def turned(loud_planner_of, tmp_path_factory) -> tuple[tp.Plan, Path]:
    """A plan of the cup in a plane turned by 20 degrees, and its folder; not to be changed."""
    turn, folder = math.radians(20.0), tmp_path_factory.mktemp("plans") / "cup"
    target = tp.Pose(x=0.92 * math.cos(turn), y=0.92 * math.sin(turn), z=0.22, theta=-math.pi / 2)
    plan = loud_planner_of("near-cup").plan(target)
    assert plan.status == "solved", plan.message
    plan.save(folder)
    return plan, folder


@pytest.fixture(scope="session")
def cycled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a cycle with two parts; not to be changed."""
    folder = tmp_path_factory.mktemp("cycle")
    jobs = folder / "two.toml"
    jobs.write_text(TWO)
    cycles.plan_cycle(cycles.load_jobs(jobs), patience=30).save(folder / "out")
    return folder / "out"


@pytest.fixture(scope="session")
def free_port() -> Callable[[], int]:
    """Finds a port of this machine that nobody has."""

    def found() -> int:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            return int(probe.getsockname()[1])

    return found
