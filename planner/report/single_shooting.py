"""SciPy's SLSQP on the planner's NLP by single shooting: the states are put in."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from ...problems import Pose, Scene
from ..check import make_mover
from ..ocp import bounds, build_nlp, parameter_values, structure_of
from ..search import Releases, guess_from

Array = npt.NDArray[np.float64]

#: SLSQP's iterations, and the breach of a row that still counts as solved.
ITERATIONS, FEASIBLE = 200, 1e-4


class SingleShooting:
    """The NLP of a scene in its first state and controls alone, for explicit integrators."""

    def __init__(self, scene: Scene) -> None:
        mesh = dataclasses.replace(scene.mesh, integrator="rk4", substeps=2)
        self._scene = scene.replace(mesh=mesh)
        self._mover = make_mover(self._scene)
        assert scene.target is not None
        angle = scene.target.theta is not None
        self._nlp = build_nlp(structure_of(self._scene, self._mover, angle), self._mover)
        nlp = self._nlp
        p = nlp.problem["p"]
        links = nlp.links
        free = [ca.MX.sym("x0", nlp.nx[0])]
        self._free = list(range(nlp.nx[0]))
        state, pieces = free[0], []
        rows: list[int] = []
        for k, link in enumerate(links):
            control = ca.MX.sym(f"u{k}", nlp.nu[k])
            free.append(control)
            self._free += range(link.v.start + nlp.nx[k], link.v.stop)
            pieces.append(ca.vertcat(state, control))
            outputs, _ = link.functions.value(pieces[-1], p[link.data], p)
            ahead = link.gap.stop - link.gap.start
            state = outputs[:ahead]
            rows += range(link.rows.start, link.rows.stop)
        z, x = ca.vertcat(*free), ca.vertcat(*pieces)
        whole = ca.Function("w", [nlp.problem["x"], p], [nlp.problem["f"], nlp.problem["g"]])
        f, g = whole(x, p)
        g = ca.vertcat(x, g[rows])
        self._rows = rows
        self._value = ca.Function("v", [z, p], [f, g])
        self._slope = ca.Function("s", [z, p], [ca.gradient(f, z), ca.jacobian(g, z)])

    def solve(
        self, aimed: Scene, target: Pose, releases: Releases, index: int, flight: float
    ) -> tuple[bool, float]:
        """Whether SLSQP gets to the target from a sampled release, and its time [s]."""
        nlp, mover = self._nlp, self._mover
        scene = aimed.replace(mesh=self._scene.mesh)
        p = nlp.parameters.vector(parameter_values(scene, mover, target))
        low, high = bounds(nlp, scene, mover)
        lower = np.concatenate([low, nlp.lbg[self._rows]])
        upper = np.concatenate([high, nlp.ubg[self._rows]])
        guess = guess_from(nlp, scene, mover, releases, index, flight)[self._free]
        same = lower == upper
        under, over = np.isfinite(lower) & ~same, np.isfinite(upper) & ~same

        def split(g: Array, kind: str) -> Array:
            if kind == "eq":
                return np.asarray((g - lower)[same] if g.ndim == 1 else g[same])
            if g.ndim == 1:
                return np.concatenate([(g - lower)[under], (upper - g)[over]])
            return np.vstack([g[under], -g[over]])

        def rows(kind: str) -> dict[str, Any]:
            return {
                "type": kind,
                "fun": lambda z: split(np.array(self._value(z, p)[1]).ravel(), kind),
                "jac": lambda z: split(self._slope(z, p)[1].full(), kind),
            }

        begin = time.perf_counter()
        result = minimize(
            lambda z: float(self._value(z, p)[0]),
            guess,
            jac=lambda z: np.array(self._slope(z, p)[0]).ravel(),
            method="SLSQP",
            constraints=[rows("eq"), rows("ineq")],
            options={"maxiter": ITERATIONS, "ftol": 1e-6},
        )
        seconds = time.perf_counter() - begin
        g = np.array(self._value(result.x, p)[1]).ravel()
        breach = float(np.nanmax(np.maximum(lower - g, g - upper)))
        return bool(np.isfinite(breach) and breach <= FEASIBLE), seconds
