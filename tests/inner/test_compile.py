"""Compiled functions: the usual answers, and the same ones where there is no compiler."""

from __future__ import annotations

import ctypes
import hashlib
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from throwplan import core
from throwplan.core.compile import c_compiler, compiled

NAMES = ("f", "g")
ROOT = Path(__file__).parents[2]


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


def test_the_core_that_is_loaded_is_of_this_checkout() -> None:
    """A stale library would be tested instead of the sources: `make .venv/test` builds it anew."""
    files = sorted((ROOT / "core").glob("*.[ch]"))
    text = b"".join(f.read_bytes() for f in files)
    library = ctypes.CDLL(str(Path(core.__file__).with_name(f"_core{core.SUFFIX}")))
    library.core_sources.restype = ctypes.c_char_p
    assert library.core_sources().decode() == hashlib.sha256(text).hexdigest()


@pytest.mark.parametrize(
    "rows", [np.zeros((36, 2))[:, 0], np.zeros(36, np.float32), np.zeros(36, np.int64), [0.0] * 36]
)
def test_the_core_takes_contiguous_doubles_only(rows: object) -> None:
    library = core.library()
    with pytest.raises((TypeError, ctypes.ArgumentError)):
        library.quintics(core.SamplesC.of(1e-3, *np.zeros((3, 4, 2))), rows, np.zeros(16))


@pytest.mark.parametrize(
    ("curves", "kinks"), [(np.zeros(2), np.zeros(16)), (np.zeros(36), np.zeros(1))]
)
def test_the_core_writes_past_no_array(curves: np.ndarray, kinks: np.ndarray) -> None:
    samples = core.SamplesC.of(1e-3, *np.zeros((3, 4, 2)))
    assert core.library().quintics(samples, np.zeros(36), np.zeros(16)) == 0
    with pytest.raises(ValueError, match="the core takes at least"):
        core.library().quintics(samples, curves, kinks)


def test_the_core_reads_past_no_array() -> None:
    """Of what it is given, of what structures point to, and of rows within samples."""
    library, samples = core.library(), core.SamplesC.of(1e-3, *np.zeros((3, 4, 2)))
    for start in (np.zeros(5), np.zeros(7)):
        with pytest.raises(ValueError, match="start: the core takes 6 elements"):
            library.flight_time(start, 0.0, 9.81)
    with pytest.raises(ValueError, match=r"requires 0 < given and given <= s\.rows"):
        library.brake(core.LimitsC(), 5, samples)
    with pytest.raises(ValueError, match="at most 8 coordinates"):
        core.SamplesC.of(1e-3, np.zeros((4, 9)))
    path = core.PathC(n=2, powers=4, pieces=3)
    for name, wrong in {"breaks": np.zeros(3), "curves": np.zeros((4, 2, 2))}.items():
        with pytest.raises(ValueError, match=f"{name}: the core takes"):
            path.attach(**{name: wrong})
    with pytest.raises(TypeError, match="motion: the core takes PathC"):
        core.ThrowsC().attach(motion=core.SceneC())
    with pytest.raises(TypeError, match="around: the core takes SolidC_Array_2"):
        core.BodiesC(solids=2).attach(around=(core.SolidC * 3)())


def test_arrays_live_as_long_as_the_structures_that_point_to_them() -> None:
    """Also those of a copy, whose pointers are set anew without changing the first."""
    path = core.PathC(n=1, powers=1, pieces=1)
    path.attach(breaks=np.array([0.0, 1.0]), curves=np.ones((1, 1, 1)), kinks=np.zeros(0))
    copy = path.copy()
    copy.attach(breaks=np.array([0.0, 2.0]))
    assert copy.kept["breaks"][1] == 2.0 and path.kept["breaks"][1] == 1.0
    assert copy.curves == path.curves and copy.kept["curves"] is path.kept["curves"]


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["gcc", "clang", f"{sys.executable} -m ziglang cc"])
def test_the_sources_compile_without_a_warning(compiler: str, tmp_path) -> None:
    words = compiler.split()
    there = ["sh", "-c", f"{compiler} --version"]
    if subprocess.run(there, capture_output=True, check=False).returncode:
        pytest.skip(f"needs {words[-2] if 'ziglang' in words else compiler}")
    flags = ["-O1", "-std=gnu11", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    for source in sorted((ROOT / "core").glob("*.c")):
        subprocess.run([*words, *flags, "-c", source, "-o", tmp_path / "a.o"], check=True)
