"""CasADi functions called in place give what they give the usual way."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest
from throwplan.models import PlanarHand, hand_motion
from throwplan.planner.compile.kernel import BLOCK, STEPS, Kernel, MappedKernel, StepKernel, mapped


def two_outputs() -> ca.Function:
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b", 2)
    return ca.Function("f", [a, b], [ca.vertcat(a[0] * b, ca.sin(a)), ca.dot(a, a)])


@pytest.mark.parametrize("count", [1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK, 3 * BLOCK + 7])
def test_any_number_of_columns(count: int) -> None:
    rng = np.random.default_rng(count)
    a, b = rng.normal(size=(count, 3)), rng.normal(size=(count, 2))
    function = two_outputs()
    for mine, usual in zip(MappedKernel(function)(a, b), function(a.T, b.T), strict=True):
        assert (mine == np.array(usual).T).all()


def test_arrays_in_any_memory_order_are_taken() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(3, 40)), np.asfortranarray(rng.normal(size=(40, 2)))
    function = two_outputs()
    mine = MappedKernel(function)(a.T, b)
    assert (mine[0] == np.array(function(a, b.T)[0]).T).all()


def test_outputs_with_structural_zeros_are_filled_in() -> None:
    function = hand_motion(PlanarHand(False, 0.3))
    q = np.array([[1.0, 2.0], [3.0, 4.0]])
    pose, twist, acceleration = MappedKernel(function)(q, q, q)
    assert pose.tolist() == [[1.0, 2.0, 0.3], [3.0, 4.0, 0.3]]
    assert twist.tolist() == acceleration.tolist() == [[1.0, 2.0, 0.0], [3.0, 4.0, 0.0]]
    x = ca.SX.sym("x", 2)
    sparse = ca.Function("s", [x], [ca.vertcat(ca.SX(1, 1), x[0])])
    assert MappedKernel(sparse)(q)[0].tolist() == [[0.0, 1.0], [0.0, 3.0]]


def test_whole_matrices_and_wrong_shapes() -> None:
    x = ca.SX.sym("x", 2)
    steps = ca.Function("f", [x], [2 * x]).mapaccum("f", 3)
    kernel = Kernel(steps)
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


def test_a_kernel_is_made_once() -> None:
    function = two_outputs()
    assert mapped(function) is mapped(function)


def test_threads_do_not_disturb_each_other() -> None:
    rng = np.random.default_rng(1)
    arguments = [(rng.normal(size=(300, 3)), rng.normal(size=(300, 2))) for _ in range(40)]
    kernel = MappedKernel(two_outputs())
    alone = [kernel(*pair) for pair in arguments]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda pair: kernel(*pair), arguments))
    for one, other in zip(alone, together, strict=True):
        assert all((a == b).all() for a, b in zip(one, other, strict=True))
