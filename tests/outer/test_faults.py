"""Fails if a signal, a full disk or a closed stream leaves half a result, a process or a trace."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import resource
import shlex
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import throwplan as tp
from throwplan import pictures
from throwplan.planner.reach import MAP_FILES
from throwplan.planner.sweep import SWEEP_FILES
from throwplan.problems import InputError

ROOT = Path(__file__).parents[2]


def started(words: str, folder: Path, **more: object) -> subprocess.Popen[str]:
    """A command in a session of its own, whose cache and temporary files are in `folder`.

    words: of throwplan, or of another program after its name.
    """
    named = words.startswith("benchmarks")
    for name in ("tmp", "cache"):
        (folder / name).mkdir(exist_ok=True)
    own = {
        "PYTHONUNBUFFERED": "",
        "TMPDIR": str(folder / "tmp"),
        "THROWPLAN_CACHE": str(folder / "cache"),
    }
    own |= {"PYTHONPATH": str(ROOT)} if named else {}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | more
    return subprocess.Popen(
        [sys.executable, "-m", *([] if named else ["throwplan"]), *words.split()],
        cwd=folder,
        env=os.environ | own,
        text=True,
        start_new_session=True,
        **pipes,  # type: ignore[call-overload]
    )


def left(folder: Path) -> list[str]:
    """Processes that a command started in `folder`, compilers too, and that are alive after 10 s:
    Python's own tracker of what processes share ends after the program."""
    until = time.monotonic() + 10
    while (found := _alive(folder)) and time.monotonic() < until:
        time.sleep(0.1)
    return found


def _alive(folder: Path) -> list[str]:
    """Command lines of processes that have the folder in their environment."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"{folder}/".encode() in (path / "environ").read_bytes():
                found.append((path / "cmdline").read_text())
    return found


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_standard_output_is_one_line(tmp_path) -> None:
    words = "scenes --keys"
    with Path("/dev/full").open("w") as full:
        process = started(words, tmp_path, stdout=full)
        _, err = process.communicate(timeout=120)
    assert err.endswith("throwplan: standard output: No space left on device\n")
    assert err.count("\n") == 1, err
    assert process.returncode == 2


@pytest.mark.parametrize(
    ("words", "status"),
    [("scenes >&-", 0), ("plan nowhere 2>/dev/full", 2), ("plan hand-flip 2>&- --json", 0)],
)
def test_streams_that_are_closed_are_none_of_its_matters(words, status) -> None:
    """As of a daemon's job: it works, and its status says how it ended."""
    command = f"{shlex.quote(sys.executable)} -m throwplan {words}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert done.returncode == status and "Traceback" not in done.stderr
    if "--json" in words:
        assert json.loads(done.stdout)["status"] == "solved"


@pytest.mark.parametrize("most", [20_000, 100_000])
def test_a_full_disk_costs_no_earlier_file(most, plan_of, tmp_path) -> None:
    """The samples do not fit, or the picture does not; all stays as it was."""
    plan = plan_of("hand-flip")
    plan.save(tmp_path)
    pictures.save(plan, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert len(before) == 4 and len(before["throw.gif"]) > 200_000 > len(before["throw.png"])
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, limits[1]))
    try:
        with pytest.raises(InputError, match=r"^--out [^\n]*: File too large$"):
            plan.save(tmp_path) if most < 50_000 else pictures.save(plan, tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_reader_that_goes_away_is_no_error(tmp_path) -> None:
    with started("scenes --keys", tmp_path) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == "" and process.wait(timeout=120) == 0


@pytest.mark.parametrize("solver", ["ipopt", "fatrop"])
def test_ctrl_c_ends_a_plan_after_the_solve_under_way(solver, interruptible) -> None:
    """IPOPT itself takes it for an error of the problem, and goes on."""
    planner = tp.Planner("hand-box", library=False)
    for wait in (0.05, 0.1, 0.2, 0.4):
        threading.Timer(wait, os.kill, (os.getpid(), signal.SIGINT)).start()
        end = time.monotonic() + 30
        with pytest.raises(KeyboardInterrupt):
            while time.monotonic() < end:
                planner.plan(solver=solver)


#: Commands, the seconds within which they are interrupted, and the files that they write.
LONG = {
    "plan hand-flip --out out": (2.0, {"plan.json", "motion.csv", "throw.png", "throw.gif"}),
    "sweep hand-box --workers 2 --samples 200000 --out out": (3.0, set(SWEEP_FILES)),
    "prepare hand-box --throws 2000": (3.0, set()),
    "map hand-box --out out": (1.5, set(MAP_FILES)),
}


SLOW = [pytest.param(words, marks=pytest.mark.slow) for words in LONG if "plan" not in words]


@pytest.mark.parametrize("words", ["plan hand-flip --out out", *SLOW])
def test_an_interrupted_command_ends_with_one_line(words, tmp_path, interruptible) -> None:
    """Status 130, all of its files or none, and no process or scratch folder is left.

    At a random time in each part of its run, and once its first file is there.
    """
    (seconds, files), chance = LONG[words], random.Random(words)
    for number, part in enumerate([*range(2 if "plan" in words else 4), None]):
        folder = tmp_path / str(number)
        folder.mkdir()
        process = started(words, folder)
        _await_start(process)
        if part is None:
            # Without a pause: the next files follow in less than 1 ms.
            while process.poll() is None and not any((folder / "out" / f).exists() for f in files):
                pass
        else:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(seconds * (part + chance.random()) / 4)
        with contextlib.suppress(ProcessLookupError):
            # A terminal sends Ctrl-C to all processes of a command.
            if number % 2:
                os.killpg(process.pid, signal.SIGINT)
            else:
                os.kill(process.pid, signal.SIGTERM)
        _, err = process.communicate(timeout=60)
        assert (process.returncode, bool(err)) in ((0, False), (130, True)), err
        assert re.fullmatch(r"(throwplan: interrupted.*\n)?", err), err
        written = {path.name for path in folder.glob("out/*")}
        assert written in (set(), files), written
        assert not left(folder)
        assert not [*folder.rglob("tmp?*"), *(folder / "tmp").iterdir()]


def _await_start(process: subprocess.Popen[str]) -> None:
    """Until the process handles SIGTERM; before that, Python itself starts."""
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None:
        handled = re.findall(r"SigCgt:\s*(\w+)", status.read_text())
        if handled and int(handled[0], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.005)
