"""What is measured of one way to pose and solve throws: first solves, and whole plans."""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene
from ..check import SmoothingError, send, throw
from ..compile import Compile
from ..ocp import USUAL, bounds, opening_nodes, opening_start, parameter_values, planned_motion
from ..plan import Planner, SolverName
from ..search import Clock, guess_from, starts
from .warmed import warmed

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Variant:
    """One way to pose and solve: mesh settings other than the usual, solver, compiled."""

    mesh: tuple[tuple[str, float | str], ...] = ()
    solver: SolverName = "fatrop"
    compiling: Compile = "no"

    @property
    def words(self) -> str:
        """What differs from the default."""
        return ", ".join(f"{name} {value}" for name, value in self.mesh) or "as it is"


@dataclass(frozen=True)
class Measured:
    """What came of a variant's first solves, and of its whole plans.

    solved: first solves that converged; exact, sent (M, 2): their landing errors without
    correction [m, rad], of the planned motion and of what is sent, and cost (M,) of the throw,
    NaN where the solve failed; solve [s], iterations (M,); plans: that ended as solved; plan [s]
    (M,); final (L, 2): the errors of these; trouble, lost: why first solves, and plans, failed;
    beside [s] (M,): solves of the usual settings, each just before this one's.
    """

    solved: int
    exact: Array
    sent: Array
    cost: Array
    solve: Array
    iterations: Array
    plans: int
    plan: Array
    final: Array
    trouble: str
    lost: str = ""
    beside: Array | None = None


def usual_planner(scene: Scene) -> Planner:
    """The planner whose solves stand beside all others': the scene's settings, not compiled."""
    planner = Planner(scene, compiling="no")
    planner.plan()
    return planner


def measured(
    scene: Scene, targets: list[Pose], variant: Variant, usual: Planner, repeats: int = 1
) -> Measured:
    """A variant on all M targets; building and compiling are not in the times.

    usual: whose first solves are measured in turn with the variant's; repeats: of each first
    solve, of which the fastest counts.
    """
    mesh = dataclasses.replace(scene.mesh, **dict(variant.mesh))  # type: ignore[arg-type]
    scene = scene.replace(mesh=mesh)
    planner = warmed(scene, targets[:1], variant.compiling, variant.solver)
    beside, first = [], []
    for target in targets:
        beside.append(_first(usual, target, "fatrop", repeats).seconds)
        first.append(_first(planner, target, variant.solver, repeats))
    plans = [planner.plan(target, solver=variant.solver) for target in targets]
    done = [plan for plan in plans if plan.solved]
    return Measured(
        sum(not one.trouble for one in first),
        np.array([one.exact for one in first]),
        np.array([one.sent for one in first]),
        np.array([one.cost for one in first]),
        np.array([one.seconds for one in first]),
        np.array([one.iterations for one in first]),
        len(done),
        np.array([plan.time["total"] - plan.time["build"] for plan in plans]),
        np.array([plan.error_sent() for plan in done]).reshape(-1, 2),
        "; ".join(dict.fromkeys(one.trouble for one in first if one.trouble)),
        "; ".join(dict.fromkeys(plan.message for plan in plans if not plan.solved)),
        np.array(beside),
    )


class _First(NamedTuple):
    """One solve: errors of what is planned and sent [m, rad], and what went wrong."""

    cost: float
    seconds: float
    iterations: int
    exact: tuple[float, float] = (math.nan, math.nan)
    sent: tuple[float, float] = (math.nan, math.nan)
    trouble: str = ""


def _first(planner: Planner, target: Pose, solver: str, repeats: int) -> _First:
    """One solve from the nearest sampled release."""
    scene, mover = planner.scene.aimed_at(target), planner.mover
    releases = planner.releases()
    index = starts(releases, scene, target, "exact", 1)[0][0]
    flight = releases.flight_time(index, target.z, scene.gravity)
    problem = planner.problems.problem(target, USUAL, solver, Clock())
    nlp = problem.nlp
    guess = guess_from(nlp, scene, mover, releases, index, flight)
    numbers = nlp.parameters.vector(parameter_values(scene, mover, target))
    limits, seconds = bounds(nlp, scene, mover), math.inf
    for _ in range(repeats):
        begin = time.process_time()
        found = problem.solver.solve(guess, numbers, limits)
        seconds = min(seconds, time.process_time() - begin)
    made = _First(found.cost, seconds, found.iterations)
    if not found.success:
        return made._replace(cost=math.nan, trouble=f"{solver} did not converge")
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    planned, at = planned_motion(nlp, mover, found.x, nodes), opening_start(nlp, found.x)
    made = made._replace(exact=throw(scene, mover, planned, at, target.z).miss(target))
    try:
        motion = planned if scene.robot is None else send(mover, planned)
    except SmoothingError as error:
        return made._replace(trouble=str(error))
    return made._replace(sent=throw(scene, mover, motion, at, target.z).miss(target))
