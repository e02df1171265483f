"""Calls that are given up: FATROP can repeat one factorisation for ever."""

from __future__ import annotations

import hashlib
import signal
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
import throwplan as tp
from throwplan.planner.ocp import solver as solver_module
from throwplan.planner.ocp.watched import GivenUpError, watched


def endless() -> bytes:
    """Works in C without Python's lock, as solvers do; hours of it."""
    return hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)


def test_answers_and_errors_come_back() -> None:
    assert watched(lambda: 3, 1.0) == 3
    assert watched(threading.get_ident, 1.0) != threading.get_ident()
    with pytest.raises(ZeroDivisionError):
        watched(lambda: 1 // 0, 1.0)
    assert watched(lambda: 4, 1.0) == 4


def test_an_endless_call_is_given_up_and_leaves_the_processor() -> None:
    start = time.perf_counter()
    with pytest.raises(GivenUpError, match="no end after"):
        watched(endless, 0.3)
    assert time.perf_counter() - start < 30.0
    assert watched(lambda: 5, 1.0) == 5
    if hasattr(signal, "SIGRTMIN"):
        worked = time.process_time()
        time.sleep(1.0)
        assert time.process_time() - worked < 0.3


def test_many_callers_at_once() -> None:
    found: list[int] = []

    def ask(number: int) -> None:
        found.append(watched(lambda: number, 5.0))

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(found) == list(range(20))


def test_an_interrupted_caller_leaves_no_answer_for_the_next() -> None:
    def stop(number: int, frame: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(TimeoutError):
            watched(lambda: time.sleep(0.6) or 1, 5.0)
        assert watched(lambda: 2, 5.0) == 2
        time.sleep(0.8)
        assert watched(lambda: 3, 5.0) == 3
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_a_solve_that_is_given_up_is_a_start_that_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[float] = []

    def first_is_endless(made: Callable[[], Any], limit: float) -> Any:
        calls.append(limit)
        if len(calls) == 1:
            raise GivenUpError("no end after 1 s")
        return watched(made, limit)

    monkeypatch.setattr(solver_module, "watched", first_is_endless)
    plan = tp.Planner(tp.load_scene("hand-flip"), compiling="no").plan()
    assert plan.solved and plan.solver == "fatrop"
    assert len(calls) > 1 and all(1.0 < limit <= 60.0 for limit in calls)


def test_a_start_that_fatrop_never_returned_from() -> None:
    """A usual scene, a usual start: its regularisation grew beyond all numbers."""
    scene = tp.load_scene("pose")
    start = time.perf_counter()
    plan = tp.Planner(scene, compiling="no").plan(
        tp.Pose(x=-0.6779736469720694, z=0.1, theta=3.469174496347765)
    )
    assert time.perf_counter() - start < 60.0
    assert plan.solved
