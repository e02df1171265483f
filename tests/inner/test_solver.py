"""Fails if a solve without an end is not given up: FATROP can repeat one step for ever."""

from __future__ import annotations

import hashlib
import threading

import pytest
from throwplan.planner.ocp import TimeLimitError, run_limited


def endless() -> bytes:
    """Works in C without Python's lock, as solvers do; hours of it."""
    return hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)


def test_answers_and_errors_come_back() -> None:
    assert run_limited(lambda: 3, 10.0) == 3
    assert run_limited(threading.get_ident, 10.0) != threading.get_ident()
    with pytest.raises(ZeroDivisionError):
        run_limited(lambda: 1 // 0, 10.0)


def test_an_endless_call_is_given_up_and_others_go_on() -> None:
    with pytest.raises(TimeLimitError, match="no end after"):
        run_limited(endless, 0.1)
    assert run_limited(lambda: 5, 10.0) == 5
