"""A solved throw moved to a target nearby, by the throw itself instead of a solver.

An optimum says how its free numbers move with the target (`Optimum.slope`), so that limits which
bind stay just kept. Along these one or two directions the exact throw is brought to the target by
Newton steps, whose 2 x 2 matrix is learnt from the throws themselves (Broyden). Whether the limits
do hold is not taken from this: the throw is checked as any other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array, Path
from ...problems import Pose
from ..check import Mover, SmoothingError, Throw, Violation, send
from ..ocp import Condensed, Controls, Optimum, Request
from ..result import PlannedThrow
from .attempt import Attempt, Start, aims, scaled, violations
from .guess import refit
from .library import Neighbour
from .nlps import Problems, Program, Task

#: Exact throws of one correction, the first included.
THROWS = 6
#: A throw must come nearer than this share of the least miss so far; else the next step is at most
#: half as long.
NEARER = 0.9
#: A step that is none, in shares of what corrections aim at.
TINY = 1e-9
#: NLPs tried from an optimum whose correction fails.
TRIES = 2
#: What an attempt by correction is called where a solver is named.
CORRECTOR = "corrector"


@dataclass(frozen=True)
class Corrector:
    """Moves optima of a scene to targets nearby."""

    controls: Controls
    problems: Problems

    def attempt(self, near: Neighbour, task: Task) -> Attempt:
        """An attempt to throw to the goal of an optimum near it, along its slope."""
        optimum = near.optimum
        begins = optimum.u, optimum.slope, np.array(near.miss)
        return self.attempted(near, optimum, begins, task)

    def attempted(
        self, near: Neighbour, optimum: Optimum, begins: tuple[Array, Array, Array], task: Task
    ) -> Attempt:
        """A throw to the goal from an optimum; begins: its u, slope and miss."""
        start = Start(near.goal, _no_guess, CORRECTOR, asked=optimum.asked)
        found: PlannedThrow | None = None
        broken: Sequence[Violation] = ()
        try:
            u, planned, thrown = self._moved(*begins, near.goal, task)
        except SmoothingError as error:
            reason = str(error)
        else:
            effort, size = self.controls.effort(u), optimum.nlp_size
            found = PlannedThrow(planned, thrown, effort, size, optimum.asked, optimum=optimum)
            with task.clock("check"):
                broken = violations(found, near.goal)
            reason = "; ".join(violation.words for violation in broken)
        return Attempt(start, optimum.asked, CORRECTOR, found, tuple(broken), reason, 0, 1)

    def _moved(
        self, u: Array, slope: Array, off: Array, goal: Pose, task: Task
    ) -> tuple[Array, Path, Throw]:
        """The controls, motion and throw that land at the goal; SmoothingError if none is found."""
        aim, size = aims(task.scene), slope.shape[1]
        last, matrix, moved = scaled(off[0], off[1], aim), np.eye(size), np.zeros(size)
        longest = math.inf
        for _ in range(THROWS):
            step = -np.linalg.solve(matrix, off[:size])
            length = float(np.abs(step / aim[:size]).max()) or TINY
            step, length = step * min(longest / length, 1.0), min(length, longest)
            now_u = self.controls.within(u + slope @ (moved + step))
            planned, thrown = self._thrown(now_u, task)
            now = np.array(thrown.miss(goal))
            missed = scaled(now[0], now[1], aim)
            if missed <= 1.0:
                return now_u, planned, thrown
            if math.isfinite(missed) and length > TINY:
                change = now[:size] - off[:size]
                matrix = matrix + np.outer(change - matrix @ step, step) / (step @ step)
            if missed < NEARER * last:
                moved, off, last, longest = moved + step, now, missed, math.inf
            else:
                longest = length / 2
        raise SmoothingError("a solved throw nearby does not move to the target")

    def _thrown(self, u: Array, task: Task) -> tuple[Path, Throw]:
        """The motion of `u`, and its throw by the model that counts."""
        planned, opening_time = self.controls.motion(u)
        mover = self.problems.mover
        with task.clock("smooth"):
            samples = send(mover, planned, as_planned=True)
        thrown = Throw.sent(task.scene, mover, planned, samples, opening_time)
        with task.clock("check"):
            _ = thrown.landing
        return planned, thrown


def _no_guess(nlp: Any) -> Array:
    return np.zeros(nlp.size[0])


def throw_of(controls: Controls, mover: Mover, optimum: Optimum, task: Task) -> PlannedThrow:
    """An optimum's throw."""
    planned, opening_time = controls.motion(optimum.u)
    final = Throw(task.scene, mover, planned, opening_time)
    return PlannedThrow(planned, final, optimum.effort, optimum.nlp_size, optimum.asked)


def moved_start(
    controls: Controls, mover: Mover, optimum: Optimum, goal: Pose, task: Task
) -> Start:
    """A start for a solver from an optimum that lands near `goal`."""
    throw = throw_of(controls, mover, optimum, task)
    request = Request(task.scene, mover)
    return Start(
        goal,
        lambda nlp: refit(nlp, throw, request),
        task.solvers[0],
        asked=optimum.asked,
        tries=TRIES,
        aim=optimum.smoothing,
    )


def optimum_of(
    controls: Controls, program: Program, throw: PlannedThrow, names: tuple[str, ...] = ()
) -> Optimum | None:
    """The optimum that a throw is, which an NLP was solved for; None without that.

    names: of the limits that bind there.
    """
    solution, nlp = throw.solution, throw.nlp
    if solution is None or nlp is None:
        return throw.optimum
    scene, target = throw.scene, throw.final.target
    aim = target.in_plane(target.plane_x + throw.aim[0], target.turned(throw.aim[1]).theta)
    numbers = nlp.numbers(Request(scene, throw.mover, aim, throw.asked))
    places = controls.places(nlp)
    try:
        at = Condensed.about(nlp, program.solver, solution, numbers, program.limits, places)
        slope = at.slope
    except np.linalg.LinAlgError:
        return None
    lands, exact = throw.planned_landing, throw.exact.landing.pose
    return Optimum(
        solution.x[places],
        slope,
        throw.final.release.end,
        throw.effort,
        nlp.size,
        (lands[0] - exact[0], lands[2] - exact[2]),
        throw.asked,
        names,
    )
