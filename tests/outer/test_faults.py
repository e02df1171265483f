"""Faults around a run: signals at any instant, full disks, readers that go away, settings."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from throwplan.core.compile import cache
from throwplan.planner.cli import Progress
from throwplan.problems import InputError, files

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


def left(session: int) -> list[str]:
    """Processes of a session that are alive after 10 s: Python's own tracker of what processes
    share ends after the program, and a process that is ending is seen without a command line."""
    until = time.monotonic() + 10
    while (found := _alive(session)) and time.monotonic() < until:
        time.sleep(0.1)
    return found


def _alive(session: int) -> list[str]:
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            words = (path / "stat").read_text().rsplit(")", 1)[1].split()
            if int(words[3]) == session and words[0] != "Z":
                found.append((path / "cmdline").read_text())
        except (OSError, IndexError):
            continue
    return found


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("words", ["scenes --reference", "plan --help", "plan nowhere --json"])
def test_a_full_standard_output_is_one_line(words, tmp_path) -> None:
    with Path("/dev/full").open("w") as full:
        process = started(words, tmp_path, stdout=full)
        _, err = process.communicate(timeout=120)
    assert err.endswith("throwplan: standard output: No space left on device\n")
    assert err.count("\n") == 1 + ("nowhere" in words), err
    assert process.returncode == 2


def test_what_does_not_fit_leaves_no_folder(tmp_path) -> None:
    def little() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    process = started("simulate drop --out deep/out", tmp_path, preexec_fn=little)
    _, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (2, "throwplan: --out deep/out: File too large\n")
    assert not (tmp_path / "deep").exists()


@pytest.mark.parametrize("most", [20_000, 100_000, 200_000])
def test_a_full_disk_costs_no_earlier_picture(most, plan_of, tmp_path) -> None:
    """The samples do not fit, the picture does not, the film does not; all stays as it was."""
    plan_of("hand-flip").save(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert len(before) == 4 and len(before["throw.gif"]) > 200_000 > len(before["throw.png"])
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, limits[1]))
    try:
        with pytest.raises(InputError, match=r"^--out [^\n]*: File too large$"):
            plan_of("hand-flip").save(tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.filterwarnings("ignore:unclosed file")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("task", ["fill", "keep", "cache"])
def test_a_signal_at_any_line_leaves_no_scratch_folder(task, tmp_path, monkeypatch) -> None:
    left_to_run = 0
    watched = {files.__file__, cache.__file__, shutil.__file__, contextlib.__file__}

    def work(folder: Path) -> None:
        if task == "fill":
            with files.filling(folder, ("one.txt",)) as scratch:
                (scratch / "one.txt").write_text("1")
        elif task == "keep":
            cache.keep(folder, "one.txt", b"1")
        else:
            monkeypatch.setenv("THROWPLAN_CACHE", str(folder))
            cache.cache_folder()

    def interrupt(frame, event, arg):
        nonlocal left_to_run
        if frame.f_code.co_filename not in watched:
            return None
        left_to_run -= event == "line"
        if left_to_run == 0 and event == "line":
            raise KeyboardInterrupt
        return interrupt

    for line in range(1, 1000):
        left_to_run, folder = line, tmp_path / str(line)
        folder.mkdir()
        sys.settrace(interrupt)
        try:
            work(folder)
        except (KeyboardInterrupt, InputError):
            # `shutil` closes a folder twice if it is interrupted between: an error of its own.
            pass
        finally:
            sys.settrace(None)
        assert {path.name for path in folder.iterdir()} <= {"one.txt"}, line
        if left_to_run > 0:
            break
    assert 30 < line < 999


def test_a_signal_that_another_thread_takes_waits_for_the_start_of_processes(tmp_path) -> None:
    code = (
        "import os, signal, threading, time\n"
        "from throwplan.planner.workers import signals_deferred\n"
        "threading.Thread(target=time.sleep, args=(0.5,)).start()\n"
        "try:\n"
        "    with signals_deferred():\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "        time.sleep(0.2)\n"
        "        print('started')\n"
        "    print('never')\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted')\n"
    )
    words = [sys.executable, "-c", code]
    ended = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ended.stdout, ended.stderr) == ("started\ninterrupted\n", "")


def test_a_reader_that_goes_away_is_no_error(tmp_path) -> None:
    with started("scenes --reference", tmp_path) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == "" and process.wait(timeout=120) == 0


def test_a_broken_matplotlibrc_costs_pictures_only(tmp_path) -> None:
    (tmp_path / "matplotlibrc").write_bytes(b"font.size: \xff\xfe\n")
    process = started("plan hand-box --out out", tmp_path)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 2 and err.count("\n") == 1, err
    assert err.startswith("throwplan: --out out: the plan is written, its pictures are not: ")
    assert json.loads((tmp_path / "out/plan.json").read_text())["status"] == "solved"
    assert (tmp_path / "out/motion.csv").is_file()


def test_an_error_in_the_place_of_a_signal_is_a_signal(tmp_path) -> None:
    # As C code does that finds an error set: it raises its own.
    code = (
        "import os, signal, sys\n"
        "from matplotlib.figure import Figure\n"
        "from throwplan.planner.cli import main\n"
        "def savefig(*_, **__):\n"
        "    try:\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "    except KeyboardInterrupt:\n"
        "        raise ValueError('Invalid matrix') from None\n"
        "Figure.savefig = savefig\n"
        "sys.argv = ['throwplan', *'simulate drop --out out'.split()]\n"
        "sys.exit(main())\n"
    )
    words = [sys.executable, "-c", code]
    ended = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (130, "throwplan: interrupted\n")


#: Long commands, and about how many seconds they take.
LONG = [
    ("plan cup --out out", 6),
    ("prepare hand-box --throws 2000", 8),
    ("sweep delay --workers 2 --samples 200000 --out out", 10),
    ("map hand-box --out out", 8),
    ("replay {plan} --out out", 4),
    ("benchmarks --quick --only robust --out out", 12),
    ("benchmarks --quick --only stability --out out", 20),
]


@pytest.mark.slow
@pytest.mark.parametrize(("words", "seconds"), LONG)
@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_at_any_instant_ends_it(
    words, seconds, kind, tmp_path, saved, interruptible
) -> None:
    chance = random.Random(f"{words} {kind}")
    for instant in (chance.uniform(0.5, 1.5), chance.uniform(1.5, seconds)):
        process = started(words.format(plan=saved("cup")), tmp_path)
        try:
            process.communicate(timeout=instant)
        except subprocess.TimeoutExpired:
            process.send_signal(kind)
        _, err = process.communicate(timeout=60)
        _judge_end(process, err, kind)
        leftover = [path.name for path in tmp_path.rglob("tmp?*")]
        assert not leftover and not list((tmp_path / "tmp").iterdir()), leftover


def _judge_end(process: subprocess.Popen[str], err: str, kind: signal.Signals) -> None:
    """Ended by the signal, in one line and alone, or on its own."""
    lines = err.splitlines()
    if process.returncode == -kind:
        # Before the command began, while Python still read the package.
        return
    # Python ends itself by SIGINT, 130 to a shell, where the signal met code that it executes.
    interrupted = (130, -signal.SIGINT)
    assert process.returncode in (0, *interrupted), (process.returncode, err)
    if process.returncode in interrupted:
        said = all(line.startswith(("throwplan: ", "benchmarks: ")) for line in lines)
        assert len(lines) <= 1 and said, err
    assert not left(process.pid)


def test_a_worker_that_starts_while_the_pool_breaks_is_ended(tmp_path) -> None:
    # Python's own pool waits for it forever.
    code = (
        "import os, signal, time\n"
        "from concurrent.futures import ProcessPoolExecutor as Pool\n"
        "from throwplan.planner.workers import executor_of\n"
        "from concurrent.futures import process\n"
        "def late(self):\n"
        "    first = list(self._processes)\n"
        "    words = self._call_queue, self._result_queue, self._initializer, (), None\n"
        "    new = self._mp_context.Process(target=process._process_worker, args=words)\n"
        "    new.start()\n"
        "    for pid in first:\n"
        "        os.kill(pid, signal.SIGKILL)\n"
        "    while first and not self._broken:\n"
        "        time.sleep(0.01)\n"
        "    time.sleep(0.2)\n"
        "    self._processes[new.pid] = new\n"
        "if __name__ == '__main__':\n"
        "    Pool._spawn_process = late\n"
        "    with executor_of(2, None) as pool:\n"
        "        print(pool._broken)\n"
    )
    (tmp_path / "late.py").write_text(code)
    words = [sys.executable, "late.py"]
    ended = subprocess.run(
        words, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 0 and "terminated abruptly" in ended.stdout, ended.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "status"),
    [
        ("prepare hand-box --throws 1000", 0),
        ("sweep delay --workers 2 --samples 300000", 2),
        ("benchmarks --only reach --out out", 2),
    ],
)
def test_a_killed_worker_is_said_or_replaced(words, status, tmp_path) -> None:
    process = started(words, tmp_path)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    found: list[str] = []
    until = time.monotonic() + 60
    while len(found) < 2 + (status == 2) and time.monotonic() < until:
        time.sleep(0.1)
        # Of a compiler on the way nothing is wanted.
        found = [
            child
            for child in children.read_text().split()
            if b"cc" not in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")[0]
        ]
    os.kill(int(found[-1]), signal.SIGKILL)
    out, err = process.communicate(timeout=300)
    assert process.returncode == status and err.count("\n") == (status == 2), err
    assert not left(process.pid)
    assert status or int(out.split("solved throws")[0].split()[-1].replace(",", "")) > 0


def test_a_step_that_takes_longer_counts_its_seconds_on_a_terminal(monkeypatch) -> None:
    ours, theirs = pty.openpty()
    said = b""
    with os.fdopen(theirs, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        with Progress("planning"):
            while b"planning (2 s)" not in said:
                said += os.read(ours, 4096)
        # The line goes again.
        while not said.endswith(b"\r\x1b[K"):
            said += os.read(ours, 4096)
    os.close(ours)
    assert said.startswith(b"\r\x1b[Kplanning")
