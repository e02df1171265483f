"""Compiled functions: the usual answers, and the same ones where there is no compiler."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import casadi as ca
import pytest
import throwplan as tp
from throwplan.planner.compile import c_compiler, compiled

NAMES = ("f", "g")


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


@pytest.mark.skipif(c_compiler() is None, reason="no C compiler here")
def test_a_damaged_library_is_made_again(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    compiled("key", NAMES, derived, make=True)
    (library,) = tmp_path.glob("*.so")
    whole = library.read_bytes()
    library.unlink()
    library.write_bytes(whole[:1000])
    assert compiled("key", NAMES, dict, make=False) == {}
    assert answers(compiled("key", NAMES, derived, make=True)) == pytest.approx(answers(derived()))
    assert library.stat().st_size == len(whole)


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
def test_another_function_s_library_is_not_taken(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    compiled("other", NAMES, derived, make=True)
    (other,) = tmp_path.glob("*.so")
    compiled("key", NAMES, derived, make=True)
    (library,) = set(tmp_path.glob("*.so")) - {other}
    library.unlink()
    shutil.copy(other, library)
    assert compiled("key", NAMES, dict, make=False) == {}


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


def _fifo(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def _device(path: Path) -> None:
    path.unlink()
    path.symlink_to("/dev/zero")


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize(
    "spoil",
    [
        _fifo,
        _device,
        _folder,
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(bytes(path.stat().st_size)),
        lambda path: path.write_bytes(path.read_bytes()[:-1000]),
        lambda path: path.write_bytes(path.read_bytes().replace(b"\x00" * 8, b"\x7f" * 8)),
    ],
)
def test_a_spoiled_table_is_drawn_again(spoil, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    usual = tp.Planner("hand-box").plan(patience=0.5)
    (table,) = tmp_path.glob("*.npz")
    spoil(table)
    again = tp.Planner("hand-box").plan(patience=0.5)
    assert again.status == usual.status == "solved"
    assert not list(tmp_path.glob("tmp*"))


def test_a_cache_that_cannot_be_written_costs_no_plan(monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", "/proc/none")
    assert tp.Planner("hand-box").plan().status == "solved"
