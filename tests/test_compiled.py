"""Compiled functions: the same numbers, found again, made again when damaged, done without."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.check.mover import make_mover
from throwplan.planner.compile import compiled, compiler
from throwplan.planner.compile.compiled import NAMES, compiled_functions
from throwplan.planner.compile.compiler import shared_library
from throwplan.planner.ocp.derivatives import nlp_functions, nlp_key
from throwplan.planner.ocp.nlp import ThrowNlp, build_nlp
from throwplan.planner.ocp.numbers import structure_of

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler here"
)
SOURCE = "double twice(double x) { return 2 * x; }\n"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache folder, and compiling allowed."""
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    monkeypatch.delenv("THROWPLAN_COMPILE")
    compiler.compiler.cache_clear()
    yield tmp_path
    compiler.compiler.cache_clear()


def small_nlp() -> ThrowNlp:
    scene = tp.load_scene("hand-box")
    mover = make_mover(scene)
    return build_nlp(structure_of(scene, mover, False), mover)


@needs_compiler
def test_compiled_functions_give_the_same_numbers_and_are_found_again(cache: Path) -> None:
    nlp = small_nlp()
    key, plain = nlp_key(nlp, "fatrop"), nlp_functions(nlp, "fatrop")
    assert compiled_functions(key, lambda: plain, "cached") is None
    found = compiled_functions(key, lambda: plain, "wait")
    assert found is not None
    rng = np.random.default_rng(0)
    x, p = rng.uniform(0.1, 0.5, nlp.size[0]), np.ones(nlp.problem["p"].numel())
    multipliers = [1.3, rng.standard_normal(nlp.size[1])]
    for name in NAMES:
        more = multipliers if plain[name].n_in() == 4 else []
        ours, theirs = found[name](x, p, *more), plain[name](x, p, *more)
        pairs = zip(ours, theirs, strict=True) if isinstance(ours, tuple) else [(ours, theirs)]
        for one, other in pairs:
            assert one.sparsity() == other.sparsity()
            assert np.abs(one.full() - other.full()).max() <= 1e-9 * (
                1 + np.abs(other.full()).max()
            )

    def derive() -> dict:
        raise AssertionError("derived again although the code is cached")

    assert compiled_functions(nlp_key(small_nlp(), "fatrop"), derive, "cached") is not None


@needs_compiler
@pytest.mark.parametrize("damage", ["cut", "garbage", "sum"])
def test_a_damaged_library_is_made_again(cache: Path, damage: str) -> None:
    path = shared_library(SOURCE)
    assert path is not None
    whole = path.read_bytes()
    if damage == "cut":
        path.unlink()
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "garbage":
        path.unlink()
        path.write_bytes(b"nothing")
    else:
        path.with_suffix(".sum").unlink()
    again = shared_library(SOURCE)
    assert again == path and len(path.read_bytes()) > 1000


def test_without_a_compiler_or_a_cache_there_is_no_library(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("THROWPLAN_COMPILE", "0")
    compiler.compiler.cache_clear()
    assert shared_library(SOURCE) is None
    monkeypatch.delenv("THROWPLAN_COMPILE")
    monkeypatch.setenv("PATH", str(cache))
    compiler.compiler.cache_clear()
    assert shared_library(SOURCE) is None
    monkeypatch.undo()
    monkeypatch.setenv("THROWPLAN_CACHE", "")
    assert shared_library(SOURCE) is None


@needs_compiler
def test_code_that_is_too_large_is_not_made_again(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nlp, derived = small_nlp(), []
    monkeypatch.setattr(compiled, "LARGEST", 1000)

    def derive() -> dict:
        derived.append(1)
        return nlp_functions(nlp, "fatrop")

    for mode in ("background", "wait", "cached"):
        assert compiled_functions(nlp_key(nlp, "fatrop"), derive, mode) is None
    assert len(derived) == 1
    assert not list(cache.glob("*.so")) and not list(cache.glob("*.busy"))
    assert sum(path.stat().st_size for path in cache.iterdir()) < 1000


@needs_compiler
def test_only_libraries_are_kept(cache: Path) -> None:
    assert shared_library(SOURCE) is not None
    assert sorted(path.suffix for path in cache.iterdir()) == [".so", ".sum"]


@needs_compiler
def test_broken_code_is_no_error(cache: Path) -> None:
    assert shared_library("this is no C\n") is None


@needs_compiler
def test_processes_may_share_the_cache(cache: Path) -> None:
    code = (
        "from throwplan.planner.compile.compiler import shared_library\n"
        f"assert shared_library({SOURCE!r}) is not None\n"
    )
    running = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(3)]
    assert [process.wait(60) for process in running] == [0, 0, 0]
    assert len(list(cache.glob("*.so"))) == 1


@needs_compiler
def test_background_compiling_serves_this_planner_and_the_next(cache: Path) -> None:
    scene = tp.load_scene("hand-box")
    first = tp.Planner(scene)
    before = first.plan()
    assert before.solved and not first.compiled
    until = time.time() + 60
    # The NLP's, the hand's and the release's.
    while len(list(cache.glob("*.so"))) < 3 and time.time() < until:
        time.sleep(0.05)
    after = first.plan()
    assert after.solved and first.compiled
    assert after.throw.solution.x == pytest.approx(before.throw.solution.x, abs=1e-6)
    planner = tp.Planner(scene, compiling="cached")
    assert planner.plan().solved
    assert planner.compiled


def test_unknown_way_of_compiling() -> None:
    with pytest.raises(tp.InputError, match="compiling = 'perhaps': must be one of no, cached"):
        tp.Planner(tp.load_scene("hand-box"), compiling="perhaps")
