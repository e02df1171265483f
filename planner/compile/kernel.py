"""CasADi functions called with NumPy arrays in place.

Called the usual way a function spends most of its time on turning arrays into CasADi
matrices and back: some 40 ns a number, ten times what its operations take. CasADi's
buffers read and write the arrays' own memory. Its matrices lie column by column in
memory, so that a matrix of (rows, columns) is a C-ordered array (columns, rows).
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Columns that a mapped function takes at once; steps that a step kernel takes at once.
BLOCK, STEPS = 96, 40


class Kernel:
    """A CasADi function of whole matrices, each given as its transpose (columns, rows).

    plain: as made; function: what is called, another one of the same dense shapes perhaps.
    """

    def __init__(self, function: ca.Function) -> None:
        self.plain = self.function = _dense(function)
        self._inputs = [_shape(function, i, True) for i in range(function.n_in())]
        self._outputs = [_shape(function, i, False) for i in range(function.n_out())]

    def __call__(self, *arguments: Array) -> list[Array]:
        """The outputs; ValueError for arguments of another shape than the function's."""
        given = [np.ascontiguousarray(value, dtype=float) for value in arguments]
        if [value.shape for value in given] != self._inputs:
            raise ValueError(f"shapes {[v.shape for v in given]}: must be {self._inputs}")
        results = [np.empty(shape) for shape in self._outputs]
        # A buffer of its own for each call: threads share nothing.
        buffer, run = _buffer(self.function)
        for i, value in enumerate(given):
            buffer.set_arg(i, value.data)
        for i, value in enumerate(results):
            buffer.set_res(i, value.data)
        run()
        return results


class MappedKernel:
    """A CasADi function of columns, for any number of them: arrays (N, rows) to (N, rows).

    plain, function: of one block, as for `Kernel`.
    """

    def __init__(self, function: ca.Function) -> None:
        self.plain = self.function = _dense(function).map(BLOCK)
        self._inputs = [function.size1_in(i) for i in range(function.n_in())]
        self._outputs = [function.size1_out(i) for i in range(function.n_out())]

    def __call__(self, *arguments: Array) -> list[Array]:
        """The outputs; ValueError for arguments of another shape than (N, rows)."""
        count = len(arguments[0])
        given = [np.ascontiguousarray(value, dtype=float) for value in arguments]
        if [value.shape for value in given] != [(count, rows) for rows in self._inputs]:
            raise ValueError(
                f"shapes {[v.shape for v in given]}: must be (N, rows), rows {self._inputs}"
            )
        if count < BLOCK:
            # Zeros fill the block; what they give is cut off again.
            given = [np.vstack([v, np.zeros((BLOCK - count, v.shape[1]))]) for v in given]
        results = [np.empty((max(count, BLOCK), rows)) for rows in self._outputs]
        buffer, run = _buffer(self.function)
        slots = [(buffer.set_arg, i, v) for i, v in enumerate(given)]
        slots += [(buffer.set_res, i, v) for i, v in enumerate(results)]
        views = [(put, i, v.reshape(-1).data, v.shape[1]) for put, i, v in slots]
        last = max(count, BLOCK) - BLOCK
        # The last block overlaps the one before it rather than reaching over the end.
        for first in [*range(0, last, BLOCK), last]:
            for put, i, view, rows in views:
                put(i, view[first * rows : (first + BLOCK) * rows])
            run()
        return [value[:count] for value in results]


class StepKernel:
    """A step taken many times in a row, as (state, numbers of the step) -> (state, others).

    steps: the kernel of one block of them.
    """

    def __init__(self, inputs: list[Any], outputs: list[Any]) -> None:
        ends = np.cumsum([0, *(value.numel() for value in outputs)])
        shared = ca.cse(ca.vertcat(*outputs))
        parts = [shared[low:high] for low, high in pairwise(ends)]
        self.steps = Kernel(ca.Function("step", inputs, parts).mapaccum("steps", STEPS, 1))

    def __call__(self, start: Array, columns: Array) -> list[Array]:
        """State and others after each of K steps from `start` (n,); columns (K, numbers)."""
        count = len(columns)
        if count % STEPS:
            # Steps of nothing fill the last block: they are cut off again.
            filling = np.zeros((STEPS - count % STEPS, columns.shape[1]))
            columns = np.vstack([columns, filling])
        parts = []
        for first in range(0, count, STEPS):
            parts.append(self.steps(start[None], columns[first : first + STEPS]))
            start = parts[-1][0][-1]
        return [np.concatenate(values)[:count] for values in zip(*parts, strict=True)]


@lru_cache(maxsize=16)
def mapped(function: ca.Function) -> MappedKernel:
    """The function's kernel, made once."""
    return MappedKernel(function)


def _shape(function: ca.Function, i: int, of_input: bool) -> tuple[int, int]:
    if of_input:
        return function.size2_in(i), function.size1_in(i)
    return function.size2_out(i), function.size1_out(i)


def _dense(function: ca.Function) -> ca.Function:
    """The function with every entry stored: a buffer holds the stored entries only."""
    sides = [function.sparsity_in(i) for i in range(function.n_in())]
    sides += [function.sparsity_out(i) for i in range(function.n_out())]
    if all(side.is_dense() for side in sides):
        return function
    inputs = [ca.SX.sym(f"i{i}", *function.size_in(i)) for i in range(function.n_in())]
    outputs = [ca.densify(value) for value in function.call(inputs)]
    return ca.Function(function.name(), inputs, outputs)


def _buffer(function: ca.Function) -> tuple[Any, Any]:
    return function.buffer()
