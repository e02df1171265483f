"""Compiled functions: the usual answers, and the same ones where there is no compiler."""

from __future__ import annotations

import gc
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from throwplan import core
from throwplan.planner.ocp.machine_code import c_compiler, compiled

NAMES = ("f", "g")
ROOT = Path(__file__).parents[2]
#: Packages beside the core.
PACKAGES = ("models", "problems", "planner", "cli", "cycles", "lab", "pictures", "robots")


def derived() -> dict[str, ca.Function]:
    x = ca.SX.sym("x", 2)
    parts = {"f": ca.sin(x) * x[1], "g": ca.dot(x, x)}
    return {name: ca.Function(name, [x], [value]) for name, value in parts.items()}


def answers(functions: dict[str, ca.Function]) -> list[float]:
    return [value for name in NAMES for value in functions[name]([0.3, 0.7]).nonzeros()]


@pytest.mark.skipif(c_compiler() is None, reason="no C compiler here")
def test_code_is_compiled_when_asked_for_and_found_again(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    usual = answers(derived())
    assert answers(compiled("key", NAMES, derived, make=False)) == pytest.approx(usual)
    assert not list(tmp_path.glob("*.so"))
    assert answers(compiled("key", NAMES, derived, make=True)) == pytest.approx(usual)
    # Found without being derived again, and not derived for another key's sake.
    assert answers(compiled("key", NAMES, dict, make=False)) == pytest.approx(usual)
    assert compiled("other", NAMES, dict, make=False) == {}


@pytest.mark.parametrize("variables", [{"CC": "broken"}, {"THROWPLAN_COMPILE": "0"}])
def test_without_a_compiler_that_works_nothing_is_compiled(
    variables, tmp_path, monkeypatch
) -> None:
    broken = tmp_path / "broken"
    broken.write_text("#!/bin/sh\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    usual = answers(derived())
    assert answers(compiled("key", NAMES, derived, make=True)) == pytest.approx(usual)
    assert not list(tmp_path.rglob("*.so"))


@pytest.mark.skipif(c_compiler() is None, reason="no C compiler here")
@pytest.mark.parametrize("what", ["folder", "file"])
def test_machine_code_that_others_could_have_written_is_not_loaded(
    what, tmp_path, monkeypatch
) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    compiled("key", NAMES, derived, make=True)
    (library,) = tmp_path.glob("*.so")
    (tmp_path if what == "folder" else library).chmod(0o777)
    assert compiled("key", NAMES, dict, make=False) == {}


# The compiled core and what Python takes it for.


def test_without_the_core_of_these_sources_a_command_ends_with_one_line(tmp_path) -> None:
    """A stale library would be tested instead of the sources: `make .venv/test` builds it anew."""
    assert core.library()
    package = tmp_path / "throwplan"
    shutil.copytree(ROOT / "core", package / "core")
    for item in [*ROOT.glob("*.py"), *(ROOT / name for name in PACKAGES)]:
        (package / item.name).symlink_to(item)
    for spoil in (
        lambda: (package / "core" / "new.h").write_text("\n"),
        (package / "core" / f"_core{core.SUFFIX}").unlink,
        (package / "core" / "_binding.py").unlink,
    ):
        spoil()
        command = [sys.executable, "-m", "throwplan", "plan", "cup"]
        done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
        (line,) = done.stderr.splitlines()
        assert done.returncode and "make core" in line


@pytest.mark.parametrize(
    "rows", [np.zeros((36, 2))[:, 0], np.zeros(36, np.float32), np.zeros(36, np.int64), [0.0] * 36]
)
def test_the_core_takes_contiguous_doubles_only(rows: object) -> None:
    library, samples = core.library(), core.sampled(1e-3, *np.zeros((3, 4, 2)))
    with pytest.raises((TypeError, ValueError)):
        library.quintics(samples, core.out(rows, 36), core.out(np.zeros(16), 16))
    with pytest.raises(TypeError):
        library.quintics(samples, rows, core.out(np.zeros(16), 16))


def test_the_core_reads_and_writes_past_no_array() -> None:
    for size in (5, 7):
        with pytest.raises(ValueError, match="the core takes"):
            core.array(np.zeros(size), 2, 3)
    with pytest.raises(ValueError, match="the core takes"):
        core.out(np.zeros(5), 2, 3)
    assert len(core.out(np.zeros(7), 2, 3)) >= 6
    with pytest.raises(ValueError, match="at most 8 coordinates"):
        core.sampled(1e-3, np.zeros((4, 9)))
    constant = np.zeros(3)
    constant.flags.writeable = False
    with pytest.raises((ValueError, BufferError)):
        core.out(constant, 3)


def test_the_core_takes_pointers_to_the_right_structures_only() -> None:
    scene = core.Structure("scene")
    with pytest.raises(TypeError):
        core.Structure("throws", motion=scene)
    with pytest.raises(TypeError):
        core.Structure("path", breaks=core.array(np.zeros(3, np.int64), 3))
    with pytest.raises(TypeError):
        core.library().pivot_track(scene, 0, None, None)


def test_what_structures_point_to_lives_as_long_as_they() -> None:
    """Also what a copy points to, which may be changed without the first."""

    def path() -> core.Structure:
        found = core.Structure("path", n=1, powers=1, pieces=1)
        found.attach(breaks=core.array(np.array([0.0, 1.0]), 2))
        return found

    throws = core.Structure("throws", motion=path())
    first = path()
    other = first.copy()
    other.breaks = core.array(np.array([0.0, 2.0]), 2)
    gc.collect()
    assert (throws.motion.breaks[1], first.breaks[1], other.breaks[1]) == (1.0, 1.0, 2.0)
    moved = core.Structure("moved")
    moved.sent = core.sampled(1e-3, np.ones((4, 2)))
    gc.collect()
    assert (moved.sent.rows, moved.sent.n, moved.sent.q[7]) == (4, 2, 1.0)


def test_structures_without_pointers_go_to_other_processes() -> None:
    limits = pickle.loads(pickle.dumps(core.Structure("limits", slows=1, dq=[1.0, 2.0])))
    assert limits.slows == 1 and list(limits.dq)[:3] == [1.0, 2.0, 0.0]
    with pytest.raises(TypeError):
        pickle.dumps(core.sampled(1e-3, np.zeros((4, 2))))


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["gcc", "clang", f"{sys.executable} -m ziglang cc"])
def test_the_sources_compile_without_a_warning(compiler: str, tmp_path) -> None:
    words = compiler.split()
    there = ["sh", "-c", f"{compiler} --version"]
    if subprocess.run(there, capture_output=True, check=False).returncode:
        pytest.skip(f"needs {words[-2] if 'ziglang' in words else compiler}")
    flags = ["-O1", "-std=gnu11", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    flags += ['-DCORE_SOURCES=""']
    for source in sorted((ROOT / "core").glob("*.c")):
        subprocess.run([*words, *flags, "-c", source, "-o", tmp_path / "a.o"], check=True)
