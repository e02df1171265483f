"""Compiled functions: the usual answers, and the same ones where there is no compiler."""

from __future__ import annotations

import ctypes
import hashlib
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from throwplan import core
from throwplan.core.compile import c_compiler, compiled, compiled_later, machine_code
from throwplan.planner.ocp import Request, build_nlp
from throwplan.planner.throw import make_manipulator

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


@pytest.mark.skipif(c_compiler() is None, reason="no C compiler here")
def test_one_library_at_a_time_is_compiled_beside_other_work(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    # Another test's compilation may be under way.
    monkeypatch.setattr(machine_code, "_ONE_LATER", threading.Lock())
    first = compiled_later("key", derived())
    assert first is not None and compiled_later("other", derived()) is None
    assert first.result(60)
    second = compiled_later("other", derived())
    assert second is not None
    assert answers(compiled("key", NAMES, dict, make=False)) == pytest.approx(answers(derived()))
    assert second.result(60) and len(list(tmp_path.iterdir())) == 2
    again = compiled_later("key", {})
    assert again is not None and again.done() and again.result()


@pytest.mark.parametrize("variables", [{"CC": "none"}, {"THROWPLAN_CACHE": ""}])
def test_nothing_is_compiled_later_without_compiler_or_folder(
    variables, tmp_path, monkeypatch
) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    # Another test's compilation may be under way.
    monkeypatch.setattr(machine_code, "_ONE_LATER", threading.Lock())
    for name, value in {"PATH": str(tmp_path), **variables}.items():
        monkeypatch.setenv(name, value)
    found = compiled_later("key", derived())
    assert found is not None and found.done() and not found.result()


@pytest.mark.skipif(c_compiler() is None, reason="no C compiler here")
def test_functions_that_many_solves_use_become_machine_code(tmp_path, monkeypatch) -> None:
    """Plans are the same before and after."""
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    monkeypatch.setattr("throwplan.planner.ocp.stage_functions.WORTH", 0.0)
    monkeypatch.setattr(machine_code, "_ONE_LATER", threading.Lock())
    loaded = list[str]()
    external = ca.external
    monkeypatch.setattr(ca, "external", lambda *a: loaded.append(a[0]) or external(*a))
    planner = tp.Planner("hand-flip", library=False)
    target = planner.scene.target
    before = planner.plan(target.shifted(0.01, 0.0))
    assert before.solved and not loaded
    for _ in range(600):
        after = planner.plan(target.shifted(0.01, 0.0))
        if loaded:
            break
        time.sleep(0.1)
    assert after.solved and loaded
    assert after.to_dict()["release"] == pytest.approx(before.to_dict()["release"], rel=1e-6)


@pytest.mark.skipif(c_compiler() is None, reason="no C compiler here")
def test_machine_code_serves_refinements_and_scenes(tmp_path, monkeypatch) -> None:
    """It is that of a kind of stages, which are the same in other NLPs."""
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))

    def compiled_kinds(name: str, elastic: float = 0.0) -> list[bool]:
        scene = tp.load_scene(name)
        request = Request(scene, make_manipulator(scene), scene.target, elastic=elastic)
        return [kind.is_compiled for kind in build_nlp(request).kinds]

    assert compiled_kinds("cup") == [False] * 6
    scene = tp.load_scene("cup")
    build_nlp(Request(scene, make_manipulator(scene), scene.target)).kinds[0].compile()
    for found in (compiled_kinds("cup", elastic=100.0), compiled_kinds("box")):
        assert found == [True, *[False] * 5]


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


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: (path.unlink(), os.mkfifo(path)),
        lambda path: (path.unlink(), path.symlink_to("/dev/zero")),
        lambda path: (path.unlink(), path.mkdir()),
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


# The compiled core and what Python takes it for.


def test_the_core_that_is_loaded_is_of_this_checkout() -> None:
    """A stale library would be tested instead of the sources: `make .venv/test` builds it anew."""
    files = sorted((ROOT / "core").glob("*.[ch]"))
    text = b"".join(f.read_bytes() for f in files)
    library = ctypes.CDLL(str(Path(core.__file__).with_name(f"_core{core.SUFFIX}")))
    library.core_sources.restype = ctypes.c_char_p
    assert library.core_sources().decode() == hashlib.sha256(text).hexdigest()


@pytest.mark.parametrize("change", ["missing", "damaged", "stale"])
def test_without_its_core_throwplan_says_what_to_run(change: str, tmp_path) -> None:
    """One line from the command line, with machine code for NLPs switched off or not."""
    copy = tmp_path / "throwplan"
    folders = {"core", "models", "planner", "problems"}

    def others(folder: str, names: list[str]) -> list[str]:
        top = Path(folder) == ROOT
        return [name for name in names if name == "__pycache__" or (top and name not in folders)]

    shutil.copytree(ROOT, copy, ignore=others)
    for file in ROOT.glob("*.py"):
        shutil.copy(file, copy)
    (library,) = (copy / "core").glob(f"_core{core.SUFFIX}")
    if change == "missing":
        library.unlink()
    elif change == "damaged":
        library.write_bytes(b"no library")
    else:
        with (copy / "core" / "compatibility.c").open("a") as source:
            source.write("/* A change. */")
    command = [sys.executable, "-m", "throwplan", "plan", "hand-flip"]
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "THROWPLAN_COMPILE": "0"}
    done = subprocess.run(
        command, check=False, cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 2 and not done.stdout
    (line,) = done.stderr.splitlines()
    why = {"missing": "is missing", "damaged": "cannot be loaded", "stale": "other sources"}[change]
    assert "compiled core" in line and why in line
    assert "`make core`" in line and "`pip install .`" in line


def test_structures_that_differ_are_seen() -> None:
    """Other sizes, and fields of the same size that changed places."""
    same = core.layout()
    assert core.differing(same) == []
    for changed in ({"throw": (0, 8)}, {"contact": (0, 48)}, {"later": (0, 8)}):
        assert core.differing(same | changed) == [*changed]
    swapped = {"scene.mass": same["scene.inertia"], "scene.inertia": same["scene.mass"]}
    assert core.differing(same | swapped) == ["scene.inertia", "scene.mass"]
    del same["scene"]
    assert core.differing(same) == ["scene"]


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
        core.ThrowC().attach(motion=core.SceneC())
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


def test_functions_of_the_header_are_all_that_the_core_exports() -> None:
    """And all arrays that are declared have their lengths in the comment beside them."""
    header = (ROOT / "core" / "functions.h").read_text("utf-8")
    declared = set(re.findall(r"EXPORT \w+ (\w+)\(", header))
    sources = "".join(f.read_text("utf-8") for f in sorted((ROOT / "core").glob("*.c")))
    defined = set(re.findall(r"EXPORT [\w ]+?\**(\w+)\(", sources)) - {
        "core_layout",
        "core_sources",
    }
    assert declared == defined == set(vars(core.library()))
    assert not re.findall(r"(?:double|int64_t|char) \*\w+\b(?!,? */\* \[)", header)


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
