"""FATROP and IPOPT on one NLP."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from .ocp import Nlp

Array = npt.NDArray[np.float64]

#: A point is feasible for us when no constraint is broken by more than this.
FEASIBLE = 1e-6
MAX_ITERATIONS = {"fatrop": 150, "ipopt": 500}
#: Barrier parameter at the start: small, for the starting points are good ones.
MU_INIT = 0.01


@dataclass(frozen=True)
class Solution:
    """Point, multipliers and how the solver ended. violation: largest constraint breach."""

    x: Array
    lam_g: Array
    lam_x: Array
    cost: float
    success: bool
    violation: float
    iterations: int
    seconds: float
    message: str


class Solver:
    """One NLP with one solver; `solve` may be called many times."""

    def __init__(self, nlp: Nlp, name: str, max_iterations: int | None = None) -> None:
        self.nlp = nlp
        self.name = name
        most = max_iterations or MAX_ITERATIONS[name]
        options: dict[str, Any] = {"expand": True, "print_time": False, "error_on_fail": False}
        if name == "fatrop":
            options |= {
                "structure_detection": "manual",
                "N": len(nlp.nx) - 1,
                "nx": nlp.nx,
                "nu": nlp.nu,
                "ng": nlp.ng,
                "fatrop": {"print_level": 0, "max_iter": most, "tol": 1e-7, "mu_init": MU_INIT},
            }
        else:
            options["ipopt"] = {
                "print_level": 0,
                "sb": "yes",
                "max_iter": most,
                "tol": 1e-7,
                "mu_init": MU_INIT,
            }
        self._function = ca.nlpsol("throw", name, nlp.problem, options)
        self._constraints = ca.Function(
            "g", [nlp.problem["x"], nlp.problem["p"]], [nlp.problem["g"]]
        )

    def solve(
        self,
        guess: Array,
        parameters: Array,
        bounds: tuple[Array, Array],
        warm: Solution | None = None,
    ) -> Solution:
        """Solve from `guess`; `warm` hands over a solution nearby, multipliers too."""
        arguments: dict[str, Any] = {
            "x0": guess,
            "p": parameters,
            "lbx": bounds[0],
            "ubx": bounds[1],
            "lbg": self.nlp.lbg,
            "ubg": self.nlp.ubg,
        }
        if warm is not None:
            arguments |= {"x0": warm.x, "lam_g0": warm.lam_g, "lam_x0": warm.lam_x}
        start = time.perf_counter()
        result = self._function(**arguments)
        seconds = time.perf_counter() - start
        stats = self._function.stats()
        x = np.array(result["x"]).ravel()
        finite = bool(np.isfinite(x).all())
        return Solution(
            x=x,
            lam_g=np.array(result["lam_g"]).ravel(),
            lam_x=np.array(result["lam_x"]).ravel(),
            cost=float(result["f"]),
            success=bool(stats["success"]) and finite,
            violation=self.violation(x, parameters, bounds) if finite else np.inf,
            iterations=int(stats.get("iter_count", 0)),
            seconds=seconds,
            message=str(stats.get("return_status", "")),
        )

    def violation(self, x: Array, parameters: Array, bounds: tuple[Array, Array]) -> float:
        """Largest breach of any constraint or bound at x."""
        g = np.array(self._constraints(x, parameters)).ravel()
        breaches = (self.nlp.lbg - g, g - self.nlp.ubg, bounds[0] - x, x - bounds[1])
        return float(max(np.max(breach) for breach in breaches))
