"""Machine code of the check's kernels: the same numbers, made once, left alone where not asked."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.check.kernel_code import KernelCode, check_kernels
from throwplan.planner.check.mover import make_mover
from throwplan.planner.compile import compiler

pytestmark = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler here"
)


Groups = list[dict]


@pytest.fixture
def groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Groups]:
    """Plain kernels of a Panda with a workspace, and afterwards again; an empty cache."""
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    monkeypatch.delenv("THROWPLAN_COMPILE", raising=False)
    compiler.compiler.cache_clear()
    found = groups_of("cup")
    make_plain(found)
    yield found
    make_plain(found)
    compiler.compiler.cache_clear()


def make_plain(groups: Groups) -> None:
    for some in groups:
        KernelCode(some, "no").take()


def groups_of(name: str) -> Groups:
    scene = tp.load_scene(name)
    return check_kernels(scene, make_mover(scene))


def coded(groups: Groups) -> list[bool]:
    """Which kernels are machine code."""
    return [kernel.function.name() == name for some in groups for name, kernel in some.items()]


def outputs(groups: Groups) -> list[np.ndarray]:
    """What the kernels make of the same random numbers."""
    rng, made = np.random.default_rng(0), []
    for kernel in [kernel for some in groups for kernel in some.values()]:
        function = kernel.function
        shapes = [(function.size2_in(i), function.size1_in(i)) for i in range(function.n_in())]
        made += kernel(*(rng.uniform(0.1, 1.0, shape) for shape in shapes))
    return made


def test_machine_code_gives_the_same_numbers(groups: Groups, tmp_path: Path) -> None:
    assert [set(some) for some in groups] == [{"pivot_kernel"}, {"hand_kernel", "outline_kernel"}]
    before = outputs(groups)
    for mode in ("no", "cached"):
        for some in groups:
            KernelCode(some, mode).take()
    assert not list(tmp_path.iterdir()) and not any(coded(groups))
    for some in groups:
        KernelCode(some, "wait").take()
    assert all(coded(groups))
    for one, other in zip(outputs(groups), before, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11)
    assert len(list(tmp_path.glob("*.so"))) == 2


def test_the_release_is_compiled_once_for_all_scenes(groups: Groups, tmp_path: Path) -> None:
    for some in groups:
        KernelCode(some, "wait").take()
    made = {path.name for path in tmp_path.iterdir()}
    others = groups_of("hand-flip")
    make_plain(others[1:])
    assert [set(some) for some in others] == [{"pivot_kernel"}, {"hand_kernel"}]
    assert coded(others) == [True, False]
    KernelCode(others[0], "wait").take()
    assert {path.name for path in tmp_path.iterdir()} == made


def test_the_background_makes_it_for_later(groups: Groups) -> None:
    codes = [KernelCode(some, "background") for some in groups]
    assert not any(coded(groups))
    until = time.monotonic() + 60
    while not all(coded(groups)):
        assert time.monotonic() < until
        time.sleep(0.1)
        for code in codes:
            code.take()


def test_a_planner_takes_it_if_it_may(groups: Groups) -> None:
    scene = tp.load_scene("cup")
    planner = tp.Planner(scene, compiling="no")
    for some in groups:
        KernelCode(some, "wait").take()
    plain = planner.plan()
    assert not any(coded(check_kernels(scene, planner.mover)))
    planner = tp.Planner(scene, compiling="cached")
    fast = planner.plan()
    assert all(coded(check_kernels(scene, planner.mover)))
    assert plain.solved and fast.solved
    np.testing.assert_allclose(fast.error_sent(), plain.error_sent(), atol=1e-9)
