"""Sweeps on several processes and on a Dask cluster: the same result to the last bit."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.sweep.sweep import sweep_until_stopped
from throwplan.planner.sweep.sweep_run import CHUNKS
from throwplan.planner.sweep.workers import executor_of

#: Chunks that are smaller than usual, so that there are many.
CHUNK, SAMPLES = 256, 12 * 256 + 100


@pytest.fixture(autouse=True, scope="module")
def small_chunks():
    usual = CHUNKS["sp"]
    CHUNKS["sp"] = CHUNK
    yield
    CHUNKS["sp"] = usual


@pytest.fixture(scope="module")
def plan() -> tp.Plan:
    return tp.plan("delay")


@pytest.fixture(scope="module")
def alone(plan) -> tp.Sweep:
    return tp.sweep(plan, samples=SAMPLES, seed=7)


def assert_same(one: tp.Sweep, other: tp.Sweep) -> None:
    assert np.array_equal(one.numbers, other.numbers)
    assert np.array_equal(one.values, other.values)
    assert np.array_equal(one.landings.pose, other.landings.pose, equal_nan=True)
    assert np.array_equal(one.success, other.success)
    results = [json.dumps(sweep.to_dict() | {"time": 0}) for sweep in (one, other)]
    assert results[0] == results[1]


def test_any_number_of_workers_gives_the_same_bits(plan, alone) -> None:
    with ThreadPoolExecutor(3) as executor:
        assert_same(alone, tp.sweep(plan, samples=SAMPLES, seed=7, executor=executor))
    with ProcessPoolExecutor(2, get_context("spawn")) as executor:
        assert_same(alone, tp.sweep(plan, samples=SAMPLES, seed=7, executor=executor))


def test_another_seed_is_another_sweep(plan, alone) -> None:
    other = tp.sweep(plan, samples=SAMPLES, seed=8)
    assert not np.array_equal(other.values, alone.values)
    # Of the same distribution.
    one, two = (sweep.to_dict()["quantiles"]["scaled"]["95"] for sweep in (alone, other))
    assert two == pytest.approx(one, rel=0.02)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def start(module: str, *arguments: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{module}", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.fixture
def cluster():
    """A scheduler's address and its two worker processes."""
    pytest.importorskip("distributed")
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    local = ("--host", "127.0.0.1")
    scheduler = start("dask_scheduler", *local, "--port", str(port), "--no-dashboard")
    options = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
    workers = [start("dask_worker", address, *local, *options) for _ in range(2)]
    try:
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline:
            try:
                socket.create_connection(("127.0.0.1", port), 1).close()
                break
            except OSError:
                time.sleep(0.1)
        yield address, workers
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


@pytest.mark.filterwarnings("ignore")  # the cluster's own, about its closing connections
def test_a_killed_worker_does_not_change_the_result(plan, alone, cluster) -> None:
    address, workers = cluster

    def kill_one(done: int, total: int) -> None:
        if workers[0].poll() is None:
            os.kill(workers[0].pid, signal.SIGKILL)
            workers[0].wait()

    import distributed

    with distributed.Client(address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=20)
    with executor_of(None, address) as executor:
        found = sweep_until_stopped(plan, SAMPLES, 7, "sp", executor, kill_one)
    assert workers[0].poll() is not None
    assert_same(alone, found)
