"""Kernels and machine code: the usual answers, and the same ones where there is no compiler."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.compile import STEPS, Kernel, MappedKernel, StepKernel, mapped

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler here"
)


# CasADi functions called in place.


def two_outputs() -> ca.Function:
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b", 2)
    return ca.Function("f", [a, b], [ca.vertcat(a[0] * b, ca.sin(a)), ca.dot(a, a)])


@pytest.mark.parametrize("count", [1, 63, 64, 65, 199, 1031])
def test_any_number_of_columns(count: int) -> None:
    rng = np.random.default_rng(count)
    a, b = rng.normal(size=(count, 3)), rng.normal(size=(count, 2))
    function = two_outputs()
    usual = function(a.T, b.T)
    for mine, theirs in zip(MappedKernel(function)(a, b), usual, strict=True):
        assert (mine == np.array(theirs).T).all()
    # In any order in memory.
    turned = MappedKernel(function)(np.asfortranarray(a), b.T.copy().T)
    assert (turned[0] == np.array(usual[0]).T).all()


def test_whole_matrices_and_wrong_shapes() -> None:
    x = ca.SX.sym("x", 2)
    kernel = Kernel(ca.Function("f", [x], [2 * x]).mapaccum("f", 3))
    assert kernel(np.array([[1.0, 2.0]]))[0].tolist() == [[2.0, 4.0], [4.0, 8.0], [8.0, 16.0]]
    with pytest.raises(ValueError, match="must be"):
        kernel(np.ones((2, 2)))
    with pytest.raises(ValueError, match=r"rows \[3, 2\]"):
        mapped(two_outputs())(np.ones((5, 3)), np.ones((4, 2)))


@pytest.mark.parametrize("count", [1, STEPS - 1, STEPS, 2 * STEPS + 3])
def test_steps_in_a_row(count: int) -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 3)
    kernel = StepKernel([x, u], [x * u[0] + u[1], ca.sum1(x) + u[2]])
    start, numbers = np.array([0.5, -0.3]), np.random.default_rng(0).normal(size=(count, 3))
    states, sums = kernel(start, numbers)
    for k in range(count):
        assert sums[k, 0] == pytest.approx(start.sum() + numbers[k, 2], rel=1e-12)
        start = start * numbers[k, 0] + numbers[k, 1]
        assert states[k] == pytest.approx(start, rel=1e-12)
    assert states.shape == (count, 2) and sums.shape == (count, 1)


def test_a_kernel_is_made_once_and_threads_do_not_disturb_each_other() -> None:
    function, rng = two_outputs(), np.random.default_rng(1)
    assert mapped(function) is mapped(function)
    arguments = [(rng.normal(size=(300, 3)), rng.normal(size=(300, 2))) for _ in range(40)]
    kernel = MappedKernel(function)
    alone = [kernel(*pair) for pair in arguments]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda pair: kernel(*pair), arguments))
    for one, other in zip(alone, together, strict=True):
        assert all((a == b).all() for a, b in zip(one, other, strict=True))


def test_unknown_way_of_compiling() -> None:
    with pytest.raises(tp.InputError, match="compiling = 'perhaps': must be one of no, cached"):
        tp.Planner(tp.load_scene("hand-box"), compiling="perhaps")


# Compiled, in a process and with a cache folder of its own.

PLANS = """
import json, time, sys, throwplan as tp
scene, found = tp.load_scene("hand-box"), []
for compiling in sys.argv[2:]:
    planner = tp.Planner(scene, compiling=compiling)
    answer = planner.plan().to_dict()
    until = time.monotonic() + 300
    while compiling == "background" and not planner.compiled and time.monotonic() < until:
        time.sleep(0.2)
        answer = planner.plan().to_dict()
    found.append([compiling, planner.compiled, answer["status"], answer["landing"]["exact"]["x"]])
print(json.dumps(found))
"""


@needs_compiler
@pytest.mark.slow
def test_the_background_compiles_for_this_planner_and_the_next(tmp_path) -> None:
    environment = os.environ | {"THROWPLAN_CACHE": str(tmp_path), "THROWPLAN_COMPILE": "1"}
    command = [sys.executable, "-c", PLANS, str(tmp_path), "no", "background", "cached"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    (_, none, *one), (_, later, *two), (_, at_once, *three) = json.loads(done.stdout)
    assert (none, later, at_once) == (False, True, True)
    for status, x in (one, two, three):
        assert status == "solved" and x == pytest.approx(one[1], abs=1e-6)
