"""FATROP and IPOPT on one NLP.

FATROP 1.1 raises its regularisation until a factorisation succeeds; at rare points none does, and
the call never returns. It therefore runs in a thread that the caller can abandon.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from ...interrupts import interrupts_deferred
from ...models import Array, ReadOnly
from ...problems import InputError
from .assembly import StagedNlp, nlp_functions


@dataclass(frozen=True)
class Barrier:
    """The barrier parameter that an interior-point method starts with, and its iterations."""

    mu_init: float
    max_iterations: int


#: Barrier of a start from a guess; guesses are good, so it is small. IPOPT takes 160
#: iterations at most for nearly all that it solves.
COLD = {"fatrop": Barrier(0.01, 100), "ipopt": Barrier(0.01, 200)}
#: Barrier of a start from the solution for a close target; FATROP's median is 3 iterations.
WARM = {"fatrop": Barrier(1e-8, 12), "ipopt": Barrier(1e-5, 500)}
#: Barrier of a start from a solution centimetres away, or after WARM; FATROP's median is 6.
FAR = {"fatrop": Barrier(1e-6, 30), "ipopt": Barrier(1e-5, 500)}


@dataclass(frozen=True)
class CallLimits:
    """Limits at which a call of a solver is skipped or given up.

    max_derivative: of a constraint at the start. Above about 3e6 FATROP 1.1 may repeat one
    factorisation without end; usual starts are below 500. fatrop_time [s]: processor time of a
    FATROP call; those that end take a tenth of it at most. max_time [s]: of any call, in wall time.
    poll_interval [s]: shortest time between two readings of a thread's clock.
    """

    max_derivative: float = 1e5
    fatrop_time: float = 5.0
    max_time: float = 60.0
    poll_interval: float = 0.01


LIMITS = CallLimits()

Result = TypeVar("Result")


class TimeLimitError(Exception):
    """The call exceeded its time limit."""


class _WaitTime(threading.local):
    """Processor time [s] of the threads that this thread has waited for."""

    seconds = 0.0


_WAIT_TIME = _WaitTime()


def processor_time() -> float:
    """Processor time [s] of this thread and of the threads it waited for; abandoned ones
    excluded."""
    return time.thread_time() + _WAIT_TIME.seconds


def run_limited(
    call: Callable[[], Result], limit: float, seconds: float = LIMITS.max_time
) -> Result:
    """Result of call(), made in another thread; exceptions of the call are raised here.

    limit: processor time [s]; seconds: wall time [s]. Beyond either it raises TimeLimitError. An
    abandoned thread keeps its memory until the process ends; on Linux it gets
    idle processor time only.
    """
    future: Future[tuple[Result, float]] = Future()
    clocks: list[int] = []

    def work() -> None:
        if hasattr(time, "pthread_getcpuclockid"):
            clocks.append(time.pthread_getcpuclockid(threading.get_ident()))
        try:
            future.set_result((call(), time.thread_time()))
        except BaseException as error:
            future.set_exception(error)

    thread = threading.Thread(target=work, name="throwplan-solver", daemon=True)
    end = time.perf_counter() + seconds
    thread.start()
    try:
        _await_end(future, clocks, limit, end)
    except BaseException:
        if hasattr(os, "SCHED_IDLE") and thread.native_id is not None:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(thread.native_id, os.SCHED_IDLE, os.sched_param(0))
        raise
    result, spent = future.result()
    _WAIT_TIME.seconds += spent
    return result


def _await_end(future: Future[Any], clocks: list[int], limit: float, end: float) -> None:
    """Waits for a thread; TimeLimitError at its limit of processor time, or at `end`.

    clocks: of its processor time; on a system without them the time that has passed counts.
    """
    start, used = time.perf_counter(), 0.0
    while True:
        remaining = min(limit - used, end - time.perf_counter())
        if remaining <= 0.0:
            _WAIT_TIME.seconds += used
            raise TimeLimitError(f"no end after {used:.2g} s")
        if wait([future], max(remaining, LIMITS.poll_interval)).done:
            return
        used = time.perf_counter() - start
        for clock in clocks:
            # A thread that has just ended has a result and no clock.
            with contextlib.suppress(OSError):
                used = time.clock_gettime(clock)


@dataclass(frozen=True)
class Solution(ReadOnly):
    """Point, multipliers, cost and status of a solve."""

    x: Array
    lam_g: Array
    lam_x: Array
    cost: float
    success: bool
    iterations: int

    @classmethod
    def none(cls, guess: Array) -> Solution:
        """The result of a failed solve: the guess, without multipliers."""
        empty = np.zeros(0)
        return cls(guess, empty, empty, np.inf, False, 0)


@dataclass(frozen=True)
class WarmStart:
    """A start from a solution with its multipliers.

    near: the target is almost that of the solution (barrier WARM, else FAR).
    """

    solution: Solution
    near: bool = True


class Solver:
    """One NLP with its functions, for FATROP or IPOPT.

    name: "fatrop" or "ipopt". options: a user's, of this solver, in place of the usual ones.
    """

    def __init__(self, nlp: StagedNlp, name: str, options: Mapping[str, Any] | None = None) -> None:
        self.nlp = nlp
        self.name = name
        self._options = options or {}
        self._kinds = nlp.kinds
        self._plugins: dict[Barrier, ca.Function] = {}
        self._make_functions()

    @interrupts_deferred()
    def solve(
        self,
        start: Array | WarmStart,
        parameters: Array,
        bounds: tuple[Array, Array],
        *,
        seconds: float = LIMITS.max_time,
    ) -> Solution:
        """Solves from a guess (n,) or from a solution; seconds: wall time limit [s]."""
        if any(kind.code is not code for kind, code in zip(self._kinds, self._codes, strict=True)):
            # Some have become machine code.
            self._make_functions()
        start_time, end = processor_time(), time.perf_counter() + seconds
        arguments: dict[str, Any] = {"p": parameters, "lbg": self.nlp.lbg, "ubg": self.nlp.ubg}
        arguments |= {"lbx": bounds[0], "ubx": bounds[1]}
        if isinstance(start, WarmStart):
            x = start.solution.x
            arguments |= {"lam_g0": start.solution.lam_g, "lam_x0": start.solution.lam_x}
            barriers = [WARM[self.name], FAR[self.name]][0 if start.near else 1 :]
        else:
            x, barriers = start, [COLD[self.name]]
            if (
                self.name == "fatrop"
                and not self._max_derivative(x, parameters) <= LIMITS.max_derivative
            ):
                return Solution.none(x)
        arguments["x0"], iterations = x, 0
        for barrier in dict.fromkeys(barriers):
            try:
                result, stats = self._call(barrier, arguments, end - time.perf_counter())
            except TimeLimitError:
                return Solution.none(x)
            except (RuntimeError, NotImplementedError) as error:
                if not self._options:
                    raise
                given = ", ".join(f"{key} = {value!r}" for key, value in self._options.items())
                raise InputError(f"solver_options: {given}: refused by {self.name}") from error
            iterations += int(stats.get("iter_count", 0))
            if stats["success"]:
                break
        spent = processor_time() - start_time
        for kind in self._kinds:
            kind.spend(spent)
        optimum, lam_g, lam_x = (np.array(result[name]).ravel() for name in ("x", "lam_g", "lam_x"))
        success = bool(stats["success"]) and bool(np.isfinite(optimum).all())
        return Solution(optimum, lam_g, lam_x, float(result["f"]), success, iterations)

    def _call(
        self, barrier: Barrier, arguments: dict[str, Any], seconds: float
    ) -> tuple[dict[str, ca.DM], dict[str, Any]]:
        """The plug-in's results and statistics; raises TimeLimitError if FATROP exceeds its
        time."""
        if self.name == "ipopt":
            plugin = self._plugin(barrier, {"sb": "yes", "max_wall_time": max(seconds, 1e-3)})
            return dict(plugin(**arguments)), plugin.stats()
        if barrier not in self._plugins:
            # Largest distance by which the solver moves a warm point off its active bounds.
            push = dict.fromkeys(("bound_push", "bound_frac"), barrier.mu_init)
            self._plugins[barrier] = self._plugin(
                barrier, {} if barrier == COLD["fatrop"] else push
            )
        plugin = self._plugins[barrier]
        try:
            found = run_limited(lambda: dict(plugin(**arguments)), LIMITS.fatrop_time, seconds)
            return found, plugin.stats()
        except BaseException:
            # The plug-in's memory is the lost thread's.
            self._plugins.clear()
            raise

    def _plugin(self, barrier: Barrier, settings: dict[str, Any]) -> ca.Function:
        """The plug-in for a barrier parameter to start with."""
        settings = settings | {"print_level": 0, "mu_init": barrier.mu_init, "tol": 1e-7}
        options: dict[str, Any] = {
            "print_time": False,
            "error_on_fail": False,
            "show_eval_warnings": False,
            "calc_lam_p": False,
            "cache": self._functions,
            self.name: settings | {"max_iter": barrier.max_iterations} | dict(self._options),
        }
        if self.name == "fatrop":
            options |= {"structure_detection": "manual", "N": len(self.nlp.links) - 1}
            options |= dict(zip(("nx", "nu", "ng"), self.nlp.sizes, strict=True))
        return ca.nlpsol("throw", self.name, self.nlp.problem, options)

    def jacobian(self, x: Array, parameters: Array) -> tuple[Array, Any]:
        """g (m,) and its Jacobian (m, n), a scipy.sparse.csc_matrix, at a point."""
        import scipy.sparse

        g, jacobian = self._functions["nlp_jac_g"](x, parameters)
        entries = np.array(jacobian.nonzeros())
        starts, rows = self._pattern
        return g.full().ravel(), scipy.sparse.csc_matrix((entries, rows, starts), jacobian.shape)

    @cached_property
    def _pattern(self) -> tuple[Array, Array]:
        """Column pointers and row indices of the Jacobian (compressed columns)."""
        starts, rows = self._functions["nlp_jac_g"].sparsity_out(1).get_ccs()
        return np.array(starts), np.array(rows)

    def hessian(self, x: Array, parameters: Array, multipliers: Array) -> Array:
        """The Lagrangian's Hessian (n, n) at a point, for FATROP; multipliers (m,): of g."""
        _, hessian = self._functions["nlp_hess_l"](x, parameters, 1.0, multipliers)
        # Equal to `hessian.full()`, ten times faster.
        return np.asarray(hessian.sparse().toarray())

    def compile(self) -> None:
        """Compiles the functions, in some seconds; nothing without a compiler, or if compiled."""
        for kind in self._kinds:
            kind.compile()
        self._make_functions()

    def _make_functions(self) -> None:
        """Makes the NLP's functions of those of its stages."""
        self._codes = [kind.code for kind in self._kinds]
        self._functions = nlp_functions(self.nlp, self.name)
        self._plugins.clear()

    def _max_derivative(self, x: Array, parameters: Array) -> float:
        """Largest derivative of a constraint at x."""
        entries = self._functions["nlp_jac_g"](x, parameters)[1].nonzeros()
        return float(np.max(np.abs(entries), initial=0.0))
