"""FATROP and IPOPT on one NLP.

FATROP 1.1 raises its regularisation until a factorisation succeeds, without an end: at rare
points, with nothing unusual about them, none does. Nothing ends a call inside a library, so it is
made in a thread that need not come back.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from ...models import Array
from ..compile import compiled
from .assembly import Nlp, nlp_functions, nlp_key

MAX_ITERATIONS = {"fatrop": 100, "ipopt": 500}
#: Barrier parameter at the start: small, for the starting points are good ones.
MU_INIT = 0.01
#: The same for a warm start, a solution with its multipliers, and the most iterations from there:
#: for almost the same target (3 usual), and after that, or for one some centimetres off (6
#: usual). FATROP moves such a point by as much away from its active bounds.
WARM = {"fatrop": ((1e-8, 12), (1e-6, 30)), "ipopt": ((1e-5, 500),)}
#: FATROP 1.1 may repeat one factorisation for ever where constraints are this steep at the
#: start (seen from 3e6 on; usual starts are below 500), so it is not given such a start.
STEEPEST = 1e5
#: FATROP is given up after this processor time [s] and that of so many evaluations of the
#: constraints' derivatives, 150 iterations taking that of a thousand; at the latest [s].
LONGEST, EVALUATIONS, LATEST = 0.2, 2000, 60.0
#: A thread's processor time is not looked up more often than this [s].
SHORTEST_WAIT = 0.01

#: What `nlp_functions` makes.
NAMES = ("nlp_f", "nlp_g", "nlp_grad_f", "nlp_jac_g", "nlp_hess_l", "nlp_grad")

Answer = TypeVar("Answer")


class GivenUpError(Exception):
    """The call took longer than it may."""


class _Waited(threading.local):
    """Processor time [s] of the threads that this thread has waited for."""

    seconds = 0.0


_WAITED = _Waited()


def processor_time() -> float:
    """Processor time [s] of this thread and of those it waited for, not of those it gave up."""
    return time.thread_time() + _WAITED.seconds


def watched(made: Callable[[], Answer], limit: float, latest: float = LATEST) -> Answer:
    """made(), in another thread; GivenUpError once it has used `limit` [s] of processor time.

    At the latest after `latest` [s], on a machine however busy. Whatever the call raises is
    raised here. A thread that is given up, or left by Ctrl-C, keeps its memory until the process
    ends; on Linux it only gets processor time that is left over.
    """
    answers: SimpleQueue[tuple[Any, BaseException | None, float]] = SimpleQueue()
    clocks: list[int] = []

    def work() -> None:
        if hasattr(time, "pthread_getcpuclockid"):
            clocks.append(time.pthread_getcpuclockid(threading.get_ident()))
        try:
            answers.put((made(), None, time.thread_time()))
        except BaseException as error:
            answers.put((None, error, time.thread_time()))

    thread = threading.Thread(target=work, name="throwplan-solver", daemon=True)
    end = time.perf_counter() + latest
    thread.start()
    try:
        answer, error, spent = _awaited(answers, clocks, limit, end)
    except BaseException:
        if hasattr(os, "SCHED_IDLE") and thread.native_id is not None:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(thread.native_id, os.SCHED_IDLE, os.sched_param(0))
        raise
    _WAITED.seconds += spent
    if error is not None:
        raise error
    return answer  # type: ignore[no-any-return]


def _awaited(answers: SimpleQueue[Any], clocks: list[int], limit: float, end: float) -> Any:
    """A thread's answer; GivenUpError at its limit of processor time, or at `end`.

    clocks: its processor time's, none where the system has none; then that time is all its own.
    """
    start, used = time.perf_counter(), 0.0
    while True:
        left = min(limit - used, end - time.perf_counter())
        if left <= 0.0:
            _WAITED.seconds += used
            raise GivenUpError(f"no end after {used:.2g} s")
        try:
            return answers.get(timeout=max(left, SHORTEST_WAIT))
        except Empty:
            used = time.perf_counter() - start
        for clock in clocks:
            # A thread that has just ended has no clock; its answer is there.
            with contextlib.suppress(OSError):
                used = time.clock_gettime(clock)


class _Ending(ca.Callback):
    """Stops IPOPT after an iteration, once time.perf_counter() is past `until`."""

    def __init__(self, variables: int, rows: int, parameters: int) -> None:
        ca.Callback.__init__(self)
        self.until = np.inf
        self._sizes = {"x": variables, "f": 1, "g": rows, "lam_x": variables}
        self._sizes |= {"lam_g": rows, "lam_p": parameters}
        self.construct("ending", {})

    def get_n_in(self) -> int:
        """What a solver answers."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Whether to stop."""
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """All dense."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(i)])

    def eval(self, arguments: Any) -> list[float]:
        """1 stops."""
        return [float(time.perf_counter() > self.until)]


@dataclass(frozen=True)
class Solution:
    """Point, multipliers and how the solver ended."""

    x: Array
    lam_g: Array
    lam_x: Array
    cost: float
    success: bool
    iterations: int

    @classmethod
    def none(cls, guess: Array) -> Solution:
        """No solution, nor any point."""
        empty = np.zeros(0)
        return cls(guess, empty, empty, np.inf, False, 0)


class Solver:
    """One NLP with one solver; `solve` may be called many times.

    Its functions are machine code where the cache has that, see `compile`.
    """

    def __init__(self, nlp: Nlp, name: str) -> None:
        self.nlp = nlp
        self.name = name
        self._functions = self._made(make=False)
        self._solvers: dict[float, ca.Function] = {}
        self._ending = _Ending(*(nlp.problem[name].numel() for name in ("x", "g", "p")))
        self._evaluation = np.inf

    def _solver(self, mu_init: float) -> ca.Function:
        """The plug-in with a barrier parameter to start from."""
        if mu_init in self._solvers:
            return self._solvers[mu_init]
        warm = dict(WARM[self.name])
        options: dict[str, Any] = {
            "print_time": False,
            "error_on_fail": False,
            "show_eval_warnings": False,
            "calc_lam_p": False,
            "cache": self._functions,
        }
        common: dict[str, Any] = {"print_level": 0, "mu_init": mu_init, "tol": 1e-7}
        common["max_iter"] = warm.get(mu_init, MAX_ITERATIONS[self.name])
        nlp = self.nlp
        if self.name == "fatrop":
            if mu_init in warm:
                common |= {"bound_push": mu_init, "bound_frac": mu_init}
            options |= {
                "structure_detection": "manual",
                "N": len(nlp.links) - 1,
                **dict(zip(("nx", "nu", "ng"), nlp.sizes, strict=True)),
                "fatrop": common,
            }
        else:
            options["ipopt"] = common | {"sb": "yes"}
            options["iteration_callback"] = self._ending
        self._solvers[mu_init] = ca.nlpsol("throw", self.name, nlp.problem, options)
        return self._solvers[mu_init]

    def solve(
        self,
        guess: Array,
        parameters: Array,
        bounds: tuple[Array, Array],
        warm: Solution | None = None,
        *,
        near: bool = True,
        seconds: float = LATEST,
    ) -> Solution:
        """Solve from `guess`; `warm` hands over a solution, multipliers too.

        near: whether that is of almost the same target. seconds: how long it may take.
        """
        nlp = self.nlp
        sides = {"lbx": bounds[0], "ubx": bounds[1], "lbg": nlp.lbg, "ubg": nlp.ubg}
        arguments: dict[str, Any] = {"x0": guess, "p": parameters, **sides}
        if warm is not None:
            arguments |= {"x0": warm.x, "lam_g0": warm.lam_g, "lam_x0": warm.lam_x}
        steep = self.name == "fatrop" and warm is None and self._slope(guess, parameters)
        if not steep <= STEEPEST:
            return Solution.none(guess)
        iterations, steps, end = 0, [MU_INIT], time.perf_counter() + seconds
        self._ending.until = end
        if warm is not None:
            steps = [mu_init for mu_init, _ in WARM[self.name]][0 if near else -1 :]
        for mu_init in steps:
            solver = self._solver(mu_init)
            try:
                result = self._called(solver, arguments, end - time.perf_counter())
            except BaseException as error:
                # The plug-in's memory is the lost thread's.
                self._solvers.clear()
                if not isinstance(error, GivenUpError):
                    raise
                return Solution.none(guess)
            stats = solver.stats()
            iterations += int(stats.get("iter_count", 0))
            if stats["success"]:
                break
        x, lam_g, lam_x = (np.array(result[name]).ravel() for name in ("x", "lam_g", "lam_x"))
        success = bool(stats["success"]) and bool(np.isfinite(x).all())
        return Solution(x, lam_g, lam_x, float(result["f"]), success, iterations)

    def _called(
        self, solver: ca.Function, arguments: dict[str, Any], seconds: float
    ) -> dict[str, ca.DM]:
        """The plug-in's answer; GivenUpError where it has none in time."""
        if self.name != "fatrop":
            return dict(solver(**arguments))
        if not np.isfinite(self._evaluation):
            self._slope(arguments["x0"], arguments["p"])
        limit = LONGEST + EVALUATIONS * self._evaluation
        return watched(lambda: solver(**arguments), limit, seconds)

    def slopes(self, x: Array, parameters: Array) -> tuple[Array, Any]:
        """g (m,) and its Jacobian (m, n), a scipy.sparse.csc_matrix, at a point."""
        import scipy.sparse

        g, slopes = self._functions["nlp_jac_g"](x, parameters)
        entries = np.array(slopes.nonzeros())
        starts, rows = self._places
        return g.full().ravel(), scipy.sparse.csc_matrix((entries, rows, starts), slopes.shape)

    @cached_property
    def _places(self) -> tuple[Array, Array]:
        """Where the Jacobian's columns start among its entries, and the rows of these."""
        starts, rows = self._functions["nlp_jac_g"].sparsity_out(1).get_ccs()
        return np.array(starts), np.array(rows)

    def curvature(self, x: Array, parameters: Array, multipliers: Array) -> Array:
        """The Lagrangian's Hessian (n, n) at a point; multipliers (m,): of g."""
        hessian = self._functions["nlp_hess_l"](x, parameters, 1.0, multipliers)
        curvature = _dense(hessian[-1] if isinstance(hessian, tuple) else hessian)
        if self.name == "ipopt":
            # Its upper triangle.
            curvature = curvature + np.triu(curvature, 1).T
        return np.asarray(curvature)

    def compile(self) -> None:
        """Compiles its functions, in some seconds, unless that is done or there is no compiler."""
        self._functions = self._made(make=True)
        self._solvers.clear()

    def _made(self, make: bool) -> dict[str, ca.Function]:
        functions = partial(nlp_functions, self.nlp, self.name)
        return compiled(nlp_key(self.nlp, self.name), NAMES, functions, make=make)

    def _slope(self, x: Array, parameters: Array) -> float:
        """Largest derivative of a constraint at x."""
        start = time.thread_time()
        slopes = self._functions["nlp_jac_g"](x, parameters)[1].nonzeros()
        self._evaluation = min(self._evaluation, time.thread_time() - start)
        return float(np.max(np.abs(slopes), initial=0.0))


def _dense(matrix: ca.DM) -> Array:
    """What `full` gives, in a tenth of its time."""
    dense = np.zeros(matrix.shape)
    dense[matrix.sparsity().get_triplet()] = matrix.nonzeros()
    return dense
