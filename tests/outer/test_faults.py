"""Faults around a run: signals at any instant, full disks, readers that go away, settings."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import random
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import process
from pathlib import Path

import pytest
from builders import MADE_THROWS
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
@pytest.mark.parametrize("words", ["scenes --reference", "plan --help", "plan nowhere --json"])
def test_a_full_standard_output_is_one_line(words, tmp_path) -> None:
    with Path("/dev/full").open("w") as full:
        process = started(words, tmp_path, stdout=full)
        _, err = process.communicate(timeout=120)
    assert err.endswith("throwplan: standard output: No space left on device\n")
    assert err.count("\n") == 1 + ("nowhere" in words), err
    assert process.returncode == 2


@pytest.mark.parametrize(
    ("words", "status"),
    [
        ("scenes >&-", 0),
        ("scenes 2>&-", 0),
        ("plan --help >&-", 0),
        ("plan nowhere 2>&-", 2),
        ("plan nowhere 2>/dev/full", 2),
        ("plan hand-flip 2>&- --json", 0),
    ],
)
def test_streams_that_are_closed_are_none_of_its_matters(words, status) -> None:
    """As of a daemon's job: it works, and its status says how it ended."""
    command = f"{shlex.quote(sys.executable)} -m throwplan {words}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert done.returncode == status and "Traceback" not in done.stderr
    if "--json" in words:
        assert json.loads(done.stdout)["status"] == "solved"


def test_what_does_not_fit_leaves_no_folder(tmp_path) -> None:
    def little() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    process = started("simulate drop --out deep/out", tmp_path, preexec_fn=little)
    _, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (2, "throwplan: --out deep/out: File too large\n")
    assert not (tmp_path / "deep").exists()


@pytest.mark.parametrize(
    "most", [100_000, *(pytest.param(m, marks=pytest.mark.slow) for m in (20_000, 200_000))]
)
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
        # A shell's job in the background ignores it.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
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


def test_a_user_s_matplotlibrc_breaks_no_picture(tmp_path) -> None:
    """LaTeX where there is none; a file that is no text is refused."""
    (tmp_path / "matplotlibrc").write_bytes(b"text.usetex: True\n")
    process = started("plan hand-box --out out", tmp_path)
    assert process.communicate(timeout=300)[1] == "" and process.returncode == 0
    assert (tmp_path / "out/throw.png").is_file() and (tmp_path / "out/throw.gif").is_file()
    (tmp_path / "matplotlibrc").write_bytes(b"font.size: \xff\xfe\n")
    process = started("simulate drop --out more", tmp_path)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 2 and err.startswith("throwplan: matplotlibrc: "), err
    assert err.count("\n") == 1 and not (tmp_path / "more").exists()


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


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_the_imports_is_one_line(
    kind, tmp_path, interruptible, monkeypatch
) -> None:
    # A file in the place of a package that every command imports.
    (tmp_path / "casadi.py").write_text(f"import os\nos.kill(os.getpid(), {kind:d})\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    process = started("scenes", tmp_path)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (130, "", "throwplan: interrupted\n")


#: CasADi loses a signal that meets the Python code of an argument while it converts that.
LOSING = """
import os, signal, sys
import casadi as ca
from throwplan import Planner
from throwplan.interrupts import INTERRUPTS
from throwplan.planner.cli import main
from throwplan.planner.show import run_panel

class Argument:
    def __DM__(self):
        os.kill(os.getpid(), signal.SIGINT)

def lose(*_):
    try:
        ca.Function("sine", [x], [ca.sin(x)])(Argument())
    except NotImplementedError:
        print("lost", flush=True)

x = ca.SX.sym("x")
INTERRUPTS.listen("throwplan")
INTERRUPTS.working = True
"""
#: Work that loses it, and then solves, shows the next instant of a page, or writes its result.
LATER = {
    "search": "planner = Planner('hand-box'); lose(); planner.plan()",
    "page": "Panel = type('Panel', (), {'advance': lose}); run_panel(Panel(), 60.0)",
    "simulate": "import throwplan.planner.cli.scenes as s; s.draw_releases = lose\n"
    "sys.argv[1:] = 'simulate drop --out out'.split(); main()",
}


@pytest.mark.parametrize("work", LATER)
def test_what_casadi_loses_is_seen_at_the_next_step(work, tmp_path, interruptible) -> None:
    words = [sys.executable, "-c", LOSING + LATER[work]]
    ended = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.stdout == "lost\n", ended.stderr
    assert ended.stderr.splitlines()[-1] in ("KeyboardInterrupt", "throwplan: interrupted")
    assert not list(tmp_path.iterdir())


#: It has a process pool and runs a compiler.
PARENT = """
import casadi as ca
from throwplan.core.compile import compiled
from throwplan.planner.workers import executor_of

if __name__ == "__main__":
    x = ca.SX.sym("x")
    with executor_of(2, None) as pool:
        list(pool.map(abs, range(2)))
        compiled("sine", ["f"], lambda: {"f": ca.Function("f", [x], [ca.sin(x)])}, make=True)
"""


@pytest.mark.parametrize(
    "kind", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)]
)
def test_no_worker_or_compiler_outlives_its_parent(
    kind, tmp_path, interruptible, monkeypatch
) -> None:
    (tmp_path / "cc").write_text("#!/bin/sh\nsleep 300 &\nsleep 300\n")
    (tmp_path / "cc").chmod(0o700)
    (tmp_path / "parent.py").write_text(PARENT)
    folder = tmp_path / "cache"
    monkeypatch.setenv("THROWPLAN_CACHE", str(folder))
    monkeypatch.setenv("CC", str(tmp_path / "cc"))
    process = subprocess.Popen(
        [sys.executable, "parent.py"], cwd=tmp_path, stderr=subprocess.PIPE, start_new_session=True
    )
    until = time.monotonic() + 60
    while not any(line.startswith("sleep") for line in _alive(tmp_path)):
        assert process.poll() is None and time.monotonic() < until
        time.sleep(0.02)
    process.send_signal(kind)
    process.communicate(timeout=60)
    assert not left(tmp_path)
    # What a killed process leaves goes at the next start.
    assert bool(list(folder.iterdir())) == (kind == signal.SIGKILL)
    cache.cache_folder()
    assert not list(folder.iterdir())


#: A program that ends while a compiler works beside it.
ENDING = """
import pathlib, time
import casadi as ca
from throwplan.core.compile import compiled_later

x = ca.SX.sym("x")
compiled_later("sine", {"f": ca.Function("f", [x], [ca.sin(x)])})
while not pathlib.Path("begun").exists():
    time.sleep(0.01)
"""


def test_a_compiler_beside_other_work_ends_with_it_and_leaves_nothing(
    tmp_path, monkeypatch
) -> None:
    (tmp_path / "cc").write_text(f"#!/bin/sh\ntouch {tmp_path}/begun\nsleep 300\n")
    (tmp_path / "cc").chmod(0o700)
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("CC", str(tmp_path / "cc"))
    subprocess.run([sys.executable, "-c", ENDING], cwd=tmp_path, check=True, timeout=60)
    assert not left(tmp_path)
    assert not list((tmp_path / "cache").iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("after", [1.5, 3.0, 5.0])
def test_a_killed_prepare_leaves_nothing_behind_the_next_start(after, tmp_path) -> None:
    process = started("prepare hand-box --throws 3000 --workers 2", tmp_path)
    time.sleep(after)
    process.kill()
    process.communicate(timeout=60)
    assert not left(tmp_path)
    again = started("prepare hand-box --throws 20 --json", tmp_path)
    out, error = again.communicate(timeout=120)
    assert again.returncode == 0 and json.loads(out)["throws"] >= 20, error
    assert not list((tmp_path / "cache").rglob("tmp-*"))
    assert not list((tmp_path / "tmp").iterdir()) and not left(tmp_path)


def test_the_end_of_a_process_flushes_its_output() -> None:
    code = "from throwplan.interrupts import leave; print('printed'); leave(3)"
    environment = os.environ | {"PYTHONUNBUFFERED": ""}
    order = [sys.executable, "-c", code]
    found = subprocess.run(order, capture_output=True, env=environment, check=False)
    assert (found.returncode, found.stdout) == (3, b"printed\n")


#: Long commands, and the seconds in which each is interrupted five times.
LONG = {
    "plan cup --out out": 3.0,
    "plan delay --robust auto --out out": 3.0,
    "prepare hand-box --throws 2000": 4.0,
    "sweep delay --workers 2 --samples 200000 --out out": 4.0,
    "map hand-box --out out": 2.0,
    "play hand-flip --port {port} --no-browser": 3.0,
    "view {plan} --port {port} --no-browser": 2.0,
    "replay {plan} --out out": 2.0,
    "identify {throws} --throws 18 --out out": 2.5,
    "calibrate {landings} --scene near-cup --out out": 1.5,
    "simulate drop --out out": 2.0,
    "export {plan} --franka out": 1.2,
    "benchmarks --quick --only robust --out out": 3.0,
}


@pytest.fixture(scope="module")
def inputs(saved, tmp_path_factory) -> dict[str, Path]:
    """A plan, recorded throws, and landings of the plan."""
    folder, plan = tmp_path_factory.mktemp("inputs"), saved("near-cup")
    landing = json.loads((plan / "plan.json").read_text())["landing"]["limit_surface"]
    rows = [f"{plan},{landing['x'] + i / 1e4},{landing['theta'] + i / 1e3}" for i in range(20)]
    (folder / "landings.csv").write_text("\n".join(["plan,x,theta", *rows, ""]))
    return {"plan": plan, "throws": MADE_THROWS, "landings": folder / "landings.csv"}


@pytest.mark.slow
@pytest.mark.parametrize("words", LONG)
def test_a_signal_at_any_instant_ends_it(words, tmp_path, inputs, free_port, interruptible) -> None:
    chance, kinds = random.Random(words), (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    whole = words.format(port=free_port(), **inputs)
    for number in range(5):
        kind, folder = kinds[number % 3], tmp_path / str(number)
        folder.mkdir()
        process = started(whole, folder)
        _await_start(process)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(LONG[words] * (number + chance.random()) / 5)
        # Every other one to all its processes, as a terminal does.
        send = os.killpg if number % 2 else os.kill
        with contextlib.suppress(ProcessLookupError):
            send(process.pid, kind)
        _, err = process.communicate(timeout=60)
        assert process.returncode in (0, 130), (process.returncode, err)
        said = re.fullmatch(r"(throwplan|benchmarks): interrupted.*\n", err)
        assert bool(said) == (process.returncode == 130) and (said or not err), err
        assert not left(folder)
        leftover = [*folder.rglob("tmp?*"), *(folder / "tmp").iterdir()]
        assert not leftover, leftover


def _await_start(process: subprocess.Popen[str]) -> None:
    """Until the process handles SIGTERM; before that, Python itself starts."""
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None:
        handled = re.findall(r"SigCgt:\s*(\w+)", status.read_text())
        if handled and int(handled[0], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.005)


@pytest.mark.skipif(
    hasattr(process._ExecutorManagerThread, "_terminate_broken"),
    reason="newer Pythons start no worker while a pool breaks: both take its lock",
)
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
    assert not left(tmp_path)
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
