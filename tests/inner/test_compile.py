"""Fails if compiled functions change an answer, are loaded though others may have written them, or
if Python hands the core memory that it does not take."""

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
    monkeypatch.delenv("THROWPLAN_COMPILE")
    usual = answers(derived())
    assert answers(compiled("key", NAMES, derived, make=False)) == pytest.approx(usual)
    assert not list(tmp_path.glob("*.so"))
    assert answers(compiled("key", NAMES, derived, make=True)) == pytest.approx(usual)
    # Found without being derived again, and not derived for another key's sake.
    assert answers(compiled("key", NAMES, dict, make=False)) == pytest.approx(usual)
    assert compiled("other", NAMES, dict, make=False) == {}
    # Not where others could have written it.
    for path in (tmp_path, *tmp_path.glob("*.so")):
        mode = path.stat().st_mode
        path.chmod(0o777)
        assert compiled("key", NAMES, dict, make=False) == {}
        path.chmod(mode)


@pytest.mark.parametrize("variables", [{"CC": "broken"}, {"THROWPLAN_COMPILE": "0"}])
def test_without_a_compiler_that_works_nothing_is_compiled(
    variables, tmp_path, monkeypatch
) -> None:
    broken = tmp_path / "broken"
    broken.write_text("#!/bin/sh\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    monkeypatch.delenv("THROWPLAN_COMPILE")
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    usual = answers(derived())
    assert answers(compiled("key", NAMES, derived, make=True)) == pytest.approx(usual)
    assert not list(tmp_path.rglob("*.so"))


# The compiled core and what Python takes it for.


def test_without_the_core_of_these_sources_a_command_ends_with_one_line(tmp_path) -> None:
    """A stale library would be tested instead of the sources: `make .venv/test` builds it anew."""
    assert core.library()
    package = tmp_path / "throwplan"
    shutil.copytree(ROOT / "core", package / "core")
    for item in [*ROOT.glob("*.py"), *(ROOT / name for name in PACKAGES)]:
        (package / item.name).symlink_to(item)
    (package / "core" / "new.h").write_text("\n")
    command = [sys.executable, "-m", "throwplan", "plan", "cup"]
    done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    (line,) = done.stderr.splitlines()
    assert done.returncode and "make core" in line


def test_the_core_takes_arrays_of_its_kind_and_size_only() -> None:
    library, samples = core.library(), core.sampled(1e-3, *np.zeros((3, 4, 2)))
    for rows in (np.zeros((36, 2))[:, 0], np.zeros(36, np.float32), [0.0] * 36, np.zeros(5)):
        with pytest.raises((TypeError, ValueError)):
            library.quintics(samples, core.out(rows, 36), core.out(np.zeros(16), 16))
    for size in (5, 7):
        with pytest.raises(ValueError):
            core.array(np.zeros(size), 2, 3)
    with pytest.raises(ValueError):
        core.sampled(1e-3, np.zeros((4, 9)))
    constant = np.zeros(3)
    constant.flags.writeable = False
    with pytest.raises((ValueError, BufferError)):
        core.out(constant, 3)
    with pytest.raises(TypeError):
        core.Structure("throws", motion=core.Structure("scene"))


def test_what_structures_point_to_lives_as_long_as_they() -> None:
    moved = core.Structure("moved")
    moved.sent = core.sampled(1e-3, np.ones((4, 2)))
    gc.collect()
    assert (moved.sent.rows, moved.sent.n, moved.sent.q[7]) == (4, 2, 1.0)
    with pytest.raises(TypeError):
        pickle.dumps(moved.sent)


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
