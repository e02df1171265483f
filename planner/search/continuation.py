"""Moves a solved throw to a target nearby, or towards it up to the limits, in steps within these.

Each step is the solution of the condensed NLP (`CondensedQp`), about the last one's point.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...models import Array
from ..library import Neighbour
from ..ocp import CondensedQp, Optimum, Refinement, Request, Solution, Step, ThrowNlp
from ..throw import Throw
from .attempt import Attempt, NearestFeasible, accuracy, error_over
from .guess import initial_guess_from
from .move import Corrector, condensed_at, throw_of
from .nlp_cache import CompiledNlp, Task


@dataclass(frozen=True)
class StepSettings:
    """Settings of the continuation.

    max_steps, max_throws: most steps, and throws brought to the goal. max_error, always_accept:
    a step is accepted if the pose error of its predicted landing is below this share of the step's
    own length, or below this [m]; else it is shortened by `shrink`, and given up below
    `min_length`, a share of the longest step. min_gain [m], min_gain_share: ends when a throw short
    of the goal is nearer than the last one by less than both this pose error and this share of it.
    """

    max_steps: int = 12
    max_throws: int = 6
    max_error: float = 1.0
    always_accept: float = 0.05
    shrink: float = 0.5
    min_length: float = 0.002
    min_gain: float = 0.005
    min_gain_share: float = 0.05


SETTINGS = StepSettings()


@dataclass(frozen=True, eq=False)
class _Point:
    """A point of the continuation.

    optimum: the throw there; off: its landing from the goal (dx [m], dtheta [rad]); nlp, x: a point
    of the NLP, whose states stay free between steps (lifted Newton), None before the first; trust:
    longest step, as a share; du: the first guess of the next step; short: whether limits hold the
    step short of the goal.
    """

    optimum: Optimum
    off: Array
    du: Array
    nlp: ThrowNlp | None = None
    x: Array | None = None
    trust: float = 1.0
    short: bool = False


@dataclass(frozen=True, eq=False)
class SqpContinuation:
    """Steps from an optimum near a goal towards it, within all limits.

    The throw of a step is brought to the goal along the limits that are active there. Where limits
    hold it short of the goal, it is brought to where the step lands instead, and checked there.
    """

    corrector: Corrector
    near: Neighbour
    task: Task

    def attempts(self) -> Iterator[Attempt]:
        """Attempts to throw to the goal; where limits stop them, the last is the nearest one.

        There the linearised limits let no throw nearer by more than `min_gain` or its share.
        """
        optimum, off = self.near.optimum, np.array(self.near.miss)
        refinement, slope = optimum.refinement, optimum.slope
        point = _Point(optimum, off, slope @ -off[: slope.shape[1]])
        nearest: Attempt | None = None
        throws = 0
        for _ in range(SETTINGS.max_steps):
            program = self._program(refinement)
            found = self._step(program, refinement, point)
            if found is None or throws == SETTINGS.max_throws:
                break
            point, step = found
            if point.short and not step.full:
                continue
            attempt = self._throw(program, point, step)
            if attempt.edge is None:
                throws += 1
                yield attempt
                if attempt.solved:
                    return
            elif attempt.verdict is not None and attempt.verdict.ok:
                if nearest is not None:
                    far, gain = nearest.missed, nearest.missed - attempt.missed
                    if gain < min(SETTINGS.min_gain, SETTINGS.min_gain_share * far):
                        yield attempt if gain > 0.0 else nearest
                        return
                nearest = attempt
            refinement = attempt.after

    def _program(self, refinement: Refinement) -> CompiledNlp:
        problems, goal = self.corrector.problems, self.near.goal
        return problems.problem(goal, refinement, "fatrop", self.task.clock)

    def _throw(self, program: CompiledNlp, point: _Point, step: Step) -> Attempt:
        """An attempt to land at the goal, or where limits hold the step short of it."""
        goal, task = self.near.goal, self.task
        if not point.short:
            begins = point.optimum.u, step.slope, point.off
            return self.corrector.attempt_from(begins, self.near, point.optimum, task)
        here = goal.shifted(*point.off)
        task = replace(task, scene=task.scene.aimed_at(here), target=here)
        begins = point.optimum.u, step.slope, 0 * point.off
        near = replace(self.near, goal=here)
        attempt = self.corrector.attempt_from(begins, near, point.optimum, task)
        missed = task.scene.object.pose_error(*map(float, point.off))
        edge = NearestFeasible(here, self._limits(program, point, step), missed)
        return replace(
            attempt, goal=goal, edge=edge, reason=edge.words("short of the goal: nearest x", goal)
        )

    def _step(
        self, program: CompiledNlp, refinement: Refinement, point: _Point
    ) -> tuple[_Point, Step] | None:
        """The point after a step, and the step; None without one."""
        task, nlp, controls = self.task, program.nlp, self.corrector.controls
        manipulator = self.corrector.problems.manipulator
        throw = throw_of(controls, manipulator, point.optimum, task)
        x = point.x
        if x is None or nlp is not point.nlp:
            with task.clock("guess"):
                x = initial_guess_from(nlp, throw, Request(task.scene, manipulator))
        near = throw.exact if nlp.linearised else None
        aim = self.near.goal.shifted(*self.near.optimum.smoothing)
        request = Request(task.scene, manipulator, aim, refinement, reference=near)
        places = controls.places(nlp)
        with task.clock("solve"), contextlib.suppress(np.linalg.LinAlgError):
            condensed = condensed_at(controls, program, request, Solution.none(x))
            found = self._accepted(condensed, places, point)
            if found is None:
                return None
            trust, step, x, exact, off = found
            short = error_over(step.residual[0], step.residual[-1], accuracy(task.scene)) > 1.0
            u = controls.within(x[places])
            optimum = replace(point.optimum, u=u, refinement=refinement)
            if step.full or not short:
                # This point is thrown next.
                detach, effort = exact.deciding.release.end, controls.effort(exact.path)
                optimum = replace(optimum, slope=step.slope, detach=detach, effort=effort)
            trust = min(2 * trust, 1.0)
            return _Point(optimum, off, 0 * point.du, nlp, x, trust, short), step
        return None

    def _accepted(
        self, condensed: CondensedQp, places: list[int], point: _Point
    ) -> tuple[float, Step, Array, Throw, Array] | None:
        """The longest step whose landing is near its prediction, as in trust region methods.

        Returns its share of the full length, the step, its point, throw and landing off the goal.
        """
        task, controls, trust, du = self.task, self.corrector.controls, point.trust, point.du
        pose_error, manipulator = task.scene.object.pose_error, self.corrector.problems.manipulator
        while trust > SETTINGS.min_length and not task.clock.late:
            step = condensed.step(du, trust, task.scene.object.half_length)
            if step is None:
                return None
            x = condensed.point + condensed.dx_du @ step.du
            exact = Throw(task.scene, manipulator, *controls.motion(controls.within(x[places])))
            off, predicted = np.array(exact.miss(self.near.goal)), np.zeros(2)
            predicted[: step.residual.size] = step.residual
            error, length = (pose_error(*(v - predicted)) for v in (off, point.off))
            if error <= max(SETTINGS.max_error * length, SETTINGS.always_accept):
                return trust, step, x, exact, off
            trust, du = SETTINGS.shrink * trust, 0 * du
        return None

    def _limits(self, program: CompiledNlp, point: _Point, step: Step) -> tuple[str, ...]:
        """The names of the limits that bind at a step."""
        assert point.x is not None
        rows, bounds = step.multipliers
        held = replace(Solution.none(point.x), lam_g=rows, lam_x=bounds)
        joints = self.corrector.problems.manipulator.joints
        return program.nlp.binding_limits(joints, held, program.limits)
