"""A solved throw moved to a target nearby by steps that know all limits, or as near as these let.

Each step is the solution of the condensed NLP (`Condensed`), about the last one's point.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Iterator

import numpy as np

from ...models import Array
from ...problems import Pose
from ..check import Throw
from ..ocp import Condensed, Request, Solution, Step, ThrowNlp, binding_limits
from .attempt import Attempt, Edge, aims, scaled
from .corrector import Corrector, throw_of
from .guess import refit
from .library import Neighbour
from .nlps import Task

#: Most steps, and throws tried to the goal, of one walk.
STEPS, THROWS = 12, 6
#: A step is taken where its throw lands within this share of its way of what it foretold, or this
#: near [m]; else it is made so much shorter, down to the least share of the longest.
FORETOLD, NEAR, SHORTER, LEAST = 1.0, 0.05, 0.5, 0.002
#: It goes on while a step comes so much nearer the goal.
NEARER = 0.9


class Walk:
    """Steps from an optimum towards a goal nearby, whichever limits come in on the way.

    The NLP's states stay free between steps (lifted Newton); the throw of a step is then brought
    to the goal along the limits that are active there. Where limits hold it short of the goal, it
    is brought to where the step lands instead, and checked there.
    """

    def __init__(self, corrector: Corrector, near: Neighbour, task: Task) -> None:
        self._corrector, self._goal, self._task = corrector, near.goal, task
        self._near, self._optimum, self._asked = near, near.optimum, near.optimum.asked
        self._aim = _moved(near.goal, np.array(near.optimum.smoothing))
        self._off = np.array(near.miss)
        slope = near.optimum.slope
        self._around = slope @ -self._off[: slope.shape[1]]
        self._nlp: ThrowNlp | None = None
        self._point, self._trust, self._short = np.zeros(0), 1.0, False

    def attempts(self) -> Iterator[Attempt]:
        """Attempts to throw to the goal; last, where they end short of it, the one that does."""
        nearest, least, tried = list[Attempt](), math.inf, 0
        for _ in range(STEPS):
            step = self._step()
            if step is None or tried == THROWS:
                break
            if self._short and not step.whole:
                continue
            attempt = self._thrown(self._off if self._short else 0 * self._off, step)
            edge = attempt.edge
            if edge is None:
                tried += 1
                yield attempt
                if attempt.solved:
                    return
            elif attempt.throw is not None and not attempt.broken:
                if not edge.missed < NEARER * least:
                    break
                nearest, least = [attempt], edge.missed
            self._asked = attempt.after
        yield from nearest

    def _thrown(self, off: Array, step: Step) -> Attempt:
        """An attempt to land `off` (dx [m], dtheta [rad]) the goal."""
        goal, task, lever = _moved(self._goal, off), self._task, self._task.scene.object.length / 2
        if off.any():
            task = dataclasses.replace(task, scene=task.scene.aimed_at(goal), target=goal)
        near = dataclasses.replace(self._near, goal=goal)
        begins = self._optimum.u, step.slope, self._off - off
        attempt = self._corrector.attempted(near, self._optimum, begins, task)
        if not off.any():
            return attempt
        edge = Edge(self._goal, goal, self._names(step), self._goal.distance(goal, lever))
        return dataclasses.replace(attempt, edge=edge, reason=edge.words(self._goal))

    def _step(self) -> Step | None:
        """A step that was made; None without one."""
        corrector, task, asked = self._corrector, self._task, self._asked
        controls, mover = corrector.controls, corrector.problems.mover
        self._program = corrector.problems.problem(self._goal, asked, "fatrop", task.clock)
        nlp, solver, limits = (getattr(self._program, n) for n in ("nlp", "solver", "limits"))
        throw = throw_of(controls, mover, self._optimum, task)
        if nlp is not self._nlp:
            with task.clock("guess"):
                self._nlp, self._point = nlp, refit(nlp, throw, Request(task.scene, mover))
        near = throw.exact if nlp.structure.local else None
        request = Request(task.scene, mover, self._aim, asked, near=near)
        places, lever = controls.places(nlp), task.scene.object.length / 2
        with task.clock("solve"), contextlib.suppress(np.linalg.LinAlgError):
            at, numbers = Solution.none(self._point), nlp.numbers(request)
            condensed = Condensed.about(nlp, solver, at, numbers, limits, places)
            while self._trust > LEAST and not task.clock.late:
                step = condensed.step(self._around, self._trust)
                if step is None:
                    return None
                point = condensed.point + condensed.whole @ step.du
                u = controls.within(point[places])
                exact = Throw(task.scene, mover, *controls.motion(u))
                off = np.array(exact.miss(self._goal))
                foretold = np.zeros(2)
                foretold[: step.short.size] = -step.short
                error, way = np.abs([off - foretold, self._off - foretold]) @ [1.0, lever]
                if error <= max(FORETOLD * way, NEAR):
                    break
                self._trust, self._around = SHORTER * self._trust, 0 * self._around
            else:
                return None
            self._trust = min(2 * self._trust, 1.0)
            self._point, self._off, self._around = point, off, 0 * self._around
            self._short = scaled(step.short[0], step.short[-1], aims(task.scene)) > 1.0
            self._optimum = dataclasses.replace(self._optimum, u=u, asked=asked)
            if step.whole or not self._short:
                # It will be thrown.
                detach = exact.final.release.end
                self._optimum = dataclasses.replace(
                    self._optimum, slope=step.slope, detach=detach, effort=controls.effort(u)
                )
            return step
        return None

    def _names(self, step: Step) -> tuple[str, ...]:
        """Of the limits that bind at a step."""
        program, (rows, bounds) = self._program, step.held
        held = dataclasses.replace(Solution.none(self._point), lam_g=rows, lam_x=bounds)
        joints = self._corrector.problems.mover.joints
        return binding_limits(program.nlp, joints, held, program.limits)


def _moved(goal: Pose, off: Array) -> Pose:
    """The goal moved by (dx [m], dtheta [rad])."""
    return goal.in_plane(goal.plane_x + float(off[0]), goal.turned(float(off[1])).theta)
