"""One set of equations for numbers and symbols.

The models are written component by component with the handful of functions
below, so that the same lines run on floats, on NumPy arrays (a batch of throws,
one throw per entry) and on CasADi expressions (inside the NLP).
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

#: float, NumPy array of shape (N,), or a scalar CasADi SX/MX expression.
Value = Any

_SYMBOLS = (ca.SX, ca.MX)
_NUMPY = SimpleNamespace(
    sqrt=np.sqrt, sin=np.sin, cos=np.cos, maximum=np.maximum, minimum=np.minimum, where=np.where
)
_CASADI = SimpleNamespace(
    sqrt=ca.sqrt, sin=ca.sin, cos=ca.cos, maximum=ca.fmax, minimum=ca.fmin, where=ca.if_else
)


def backend(*values: Value) -> SimpleNamespace:
    """Functions that suit `values`: CasADi's if any of them is symbolic, else NumPy's."""
    for value in values:  # called in every step of a batch: no generator
        if isinstance(value, _SYMBOLS):
            return _CASADI
    return _NUMPY


def components(vector: Value) -> tuple[Value, ...]:
    """Rows of a CasADi column or of an array (rows, ...) as separate values."""
    if isinstance(vector, ca.SX | ca.MX):
        return tuple(ca.vertsplit(vector))
    return tuple(vector)
