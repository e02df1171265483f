"""Machine code for the kernels that a planner's checks call.

A plan calls them some twenty times: as machine code they take a third of the time that
CasADi's virtual machine takes for them.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from ..compile import Code, Compile, Kernel, MappedKernel
from .exact_release import pivot_kernel, surface_kernel

Kernels = Mapping[str, Kernel | MappedKernel]


def check_kernels() -> list[Kernels]:
    """What the check of throws calls: the releases, the same for all scenes."""
    return [{"pivot_kernel": pivot_kernel().steps, "surface_kernel": surface_kernel().steps}]


class KernelCode:
    """Kernels by name, and their machine code once it is there.

    Planners of a process share kernels: each takes what it may before it plans.
    """

    def __init__(self, kernels: Kernels, compiling: Compile) -> None:
        self._kernels = kernels
        functions = {name: _named(name, kernel.plain) for name, kernel in kernels.items()}
        key = repr([(name, function.serialize()) for name, function in functions.items()])
        self._code = Code(key, lambda: functions, compiling, tuple(functions))
        self._functions = self._code.functions

    def take(self) -> None:
        """Sets the kernels to machine code, or, as long as there is none, to the plain ones."""
        if self._functions is None:
            self._functions = self._code.arrived()
        for name, kernel in self._kernels.items():
            kernel.function = kernel.plain if self._functions is None else self._functions[name]


def _named(name: str, function: ca.Function) -> ca.Function:
    """The function by a name of its own: a library's names are all different."""
    inputs = function.mx_in()
    return ca.Function(name, inputs, function.call(inputs))
