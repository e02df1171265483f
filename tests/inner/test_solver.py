"""Solves that are given up: FATROP can repeat one factorisation for ever."""

from __future__ import annotations

import hashlib
import threading

import pytest
import throwplan as tp
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


def test_many_callers_at_once() -> None:
    found: list[int] = []

    def ask(number: int) -> None:
        found.append(run_limited(lambda: number, 10.0))

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(found) == list(range(20))


def test_a_start_that_fatrop_never_returned_from(pose_planner) -> None:
    """A usual scene, a usual start: its regularisation grew beyond all numbers."""
    target = tp.Pose(x=-0.6779736469720694, z=0.1, theta=3.469174496347765)
    assert pose_planner.plan(target, patience=90.0).solved
