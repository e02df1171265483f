"""The few functions by which formulas run on floats, NumPy arrays and CasADi expressions."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

#: float, NumPy array of shape (N,), or a scalar CasADi SX/MX expression.
Value = Any

_NUMPY = SimpleNamespace(
    sqrt=np.sqrt, sin=np.sin, cos=np.cos, maximum=np.maximum, minimum=np.minimum, where=np.where
)
_CASADI = SimpleNamespace(
    sqrt=ca.sqrt, sin=ca.sin, cos=ca.cos, maximum=ca.fmax, minimum=ca.fmin, where=ca.if_else
)


def backend(*values: Value) -> SimpleNamespace:
    """Functions that suit `values`: CasADi's if any of them is symbolic, else NumPy's."""
    for value in values:  # called in every step of a batch: no generator
        if isinstance(value, ca.SX | ca.MX):
            return _CASADI
    return _NUMPY


def components(vector: Value) -> tuple[Value, ...]:
    """Rows of a CasADi column or of an array (rows, ...) as separate values."""
    if isinstance(vector, ca.SX | ca.MX):
        return tuple(ca.vertsplit(vector))
    return tuple(vector)
