"""Compiled batches: NumPy's answers, and NumPy where there is no compiled code."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from test_batch import DROP, throws
from test_extreme import batch_of, extremes
from throwplan.models import Path as Motion
from throwplan.models import ReleaseBatch, TableRelease, throw_limit_surface, throw_sliding_pivot
from throwplan.planner.check.simulate_batch import _batch
from throwplan.planner.compile.compiled_batch import compiled_steps
from throwplan.planner.compile.compiler import compiler
from throwplan.planner.compile.lane_code import lane_function

RUNS = {"sp": throw_sliding_pivot, "ls-step": throw_limit_surface}


@pytest.fixture(scope="module", autouse=True)
def compiler_there(compiling_all: None) -> None:
    """All of this file needs a C compiler."""
    if compiler() is None:
        pytest.skip("no C compiler")


def many(count: int, seed: int = 0) -> ReleaseBatch:
    values = throws(count, seed)
    return _batch(DROP, values["hand"], values["contact"], values["object"], values["gripper"])


def sampled(batch: ReleaseBatch, shared: bool) -> ReleaseBatch:
    """The same hands by splines; or the first one's for all, each started a little later."""
    hands, t = batch.hands, np.linspace(-0.01, 0.15, 60)
    poses = np.array([hands.at(np.full(batch.count, time)).pose for time in t]).transpose(2, 0, 1)
    if not shared:
        return replace(batch, hands=Motion.through(t, poses))
    delays = np.linspace(-0.009, 0.04, batch.count)
    return replace(batch, hands=Motion.through(t, poses[:1], delays))


def measured(batch: ReleaseBatch) -> ReleaseBatch:
    times = [0.0, 0.01, 0.02, 0.04, 0.06]
    return replace(batch, grip=TableRelease(times, [80.0, 80.0, 50.0, 30.0, 0.0]))


@pytest.mark.parametrize("model", RUNS)
@pytest.mark.parametrize("kind", ["plain", "sampled", "shared", "measured grip", "turned grasp"])
def test_compiled_throws_are_numpys(model: str, kind: str) -> None:
    batch = many(501)
    batch = {
        "plain": lambda: batch,
        "sampled": lambda: sampled(batch, False),
        "shared": lambda: sampled(batch, True),
        "measured grip": lambda: measured(batch),
        "turned grasp": lambda: replace(batch, grasp_angle=0.7, gravity=3.0),
    }[kind]()
    run, even = RUNS[model], compiled_steps(model, batch.hands)
    assert even is not None
    plain, fast = run(batch), run(batch, even=even)
    np.testing.assert_allclose(fast.detach, plain.detach, rtol=0, atol=1e-9)
    assert np.array_equal(fast.lost, plain.lost)


@pytest.mark.parametrize("model", RUNS)
def test_extreme_throws_are_finite_and_mostly_agree(model: str) -> None:
    """Some of them swing so fast that rounding alone moves them."""
    batch = batch_of(extremes(2000, 1))
    run, even = RUNS[model], compiled_steps(model, batch.hands)
    assert np.isfinite(run(batch, even=even).detach).all()
    few = batch.part(np.flatnonzero(batch.opening < 0.1)[:300])
    plain, fast = run(few), run(few, even=even)
    assert np.array_equal(fast.lost, plain.lost) and fast.lost.any() == (model == "sp")
    off = np.abs(fast.detach - plain.detach) / (1 + np.abs(plain.detach))
    assert np.percentile(off.max(axis=1), 98) < 1e-9


@pytest.mark.parametrize("model", RUNS)
def test_neighbours_do_not_change_a_digit(model: str) -> None:
    batch = many(100)
    even, order = compiled_steps(model, batch.hands), np.random.default_rng(1).permutation(100)[:37]
    whole = RUNS[model](batch, even=even).detach
    assert np.array_equal(RUNS[model](batch.part(order), even=even).detach, whole[order])


def test_workers_do_not_change_a_digit() -> None:
    values = throws(9000)
    alone = tp.simulate_batch(DROP, **values).detach
    assert compiled_steps("sp", many(1).hands) is not None
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2) as processes:
        for executor in (threads, processes):
            spread = tp.simulate_batch(DROP, **values, executor=executor).detach
            assert np.array_equal(spread, alone)


def test_an_operation_without_c_is_refused() -> None:
    x = ca.SX.sym("x")
    with pytest.raises(ValueError, match="f: no C expression"):
        lane_function(ca.Function("f", [x], [ca.tan(x)], ["x"], ["y"]))


SCRIPT = """
import sys, numpy as np, throwplan as tp
from throwplan.planner.compile import compiled_batch
result = tp.simulate_batch(
    tp.load_scene("drop"), sys.argv[1], contact={"friction": np.linspace(0.3, 1.0, 2500)}
)
assert compiled_batch._library.cache_info().misses == 1, "compiled code was not asked for"
print(compiled_batch._library() is not None)
np.save(sys.argv[2], result.detach)
"""


def run_apart(folder: Path, model: str, **variables: str) -> tuple[bool, np.ndarray]:
    """2500 drops in a process of their own: whether they were compiled, and detach states."""
    environment = os.environ | {"THROWPLAN_CACHE": str(folder / "cache")} | variables
    command = [sys.executable, "-c", SCRIPT, model, str(folder / "detach.npy")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout == "True\n", np.load(folder / "detach.npy")


def test_without_or_with_a_damaged_library_the_answer_is_the_same(tmp_path: Path) -> None:
    compiled, plain = run_apart(tmp_path, "sp", THROWPLAN_COMPILE="0")
    assert not compiled and not list(tmp_path.glob("cache/*"))
    compiled, fast = run_apart(tmp_path, "sp")
    assert compiled
    np.testing.assert_allclose(fast, plain, rtol=0, atol=1e-9)
    (library,) = tmp_path.glob("cache/*.so")
    whole = library.read_bytes()
    library.write_bytes(whole[:1000])
    compiled, again = run_apart(tmp_path, "sp")
    assert compiled and np.array_equal(again, fast)
    assert library.stat().st_size == len(whole)


def test_a_compiler_that_fails_is_done_without(tmp_path: Path) -> None:
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\nexit 1\n")
    broken.chmod(0o755)
    compiled, detach = run_apart(tmp_path, "ls-step", CC=str(broken))
    assert not compiled and np.isfinite(detach).all()
