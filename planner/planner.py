"""From a scene to a checked throw: guess, solve, smooth, check, correct."""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from ..problems.errors import InputError
from ..problems.scene import Pose, Scene
from .check import broken_limits, limit_surface_landing, scene_violations, throw
from .motion import planned_motion
from .mover import make_mover
from .nlp import ThrowNlp, build_nlp
from .numbers import bounds, parameter_values, structure_of
from .plan import Plan, PlannedThrow, Status, checked_target
from .reach import Binding, highest, nearest_possible
from .releases import Releases, ReleaseSampler, guess_from, nearest
from .smooth import SmoothingError, send
from .solver import Solution, Solver
from .start import check_start

Array = npt.NDArray[np.float64]
SolverName = Literal["auto", "fatrop", "ipopt"]
Turns = Literal["exact", "any"]

#: Corrections aim at this on the landing that counts: position [m], angle [rad].
AIM = (1e-4, math.radians(0.02))
MAX_CORRECTIONS = 8
#: Starts tried with FATROP, then with IPOPT.
STARTS = {"fatrop": 6, "ipopt": 4}
#: Random releases drawn for the starting points.
SAMPLES = 20_000


@dataclass
class _Search:
    """One `plan` call: the scene with its target, and bookkeeping."""

    scene: Scene
    times: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    iterations: int = 0
    attempts: int = 0
    trouble: list[str] = field(default_factory=list)
    fallback: tuple[PlannedThrow, str] | None = None
    palm: bool = False

    @contextmanager
    def clock(self, name: str) -> Iterator[None]:
        """Adds the block's duration to `name`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.times[name] += time.perf_counter() - start


class Planner:
    """Plans throws of one scene; builds its NLP once and solves for many targets.

    Raises InputError for a scene that cannot be planned at all: no [hand] or [robot],
    or a grip too weak to hold the object at rest in any permitted start pose.
    """

    def __init__(self, scene: Scene) -> None:
        start = time.perf_counter()
        self.scene = scene
        self.mover = make_mover(scene)
        check_start(scene, self.mover)
        self._nlps: dict[tuple[bool, bool], ThrowNlp] = {}
        self._solvers: dict[tuple[bool, bool, str], Solver] = {}
        self._releases: Releases | None = None
        self._sampler = ReleaseSampler(scene, self.mover)
        self._build_time = time.perf_counter() - start

    def plan(
        self,
        target: Pose | None = None,
        *,
        solver: SolverName = "auto",
        turns: Turns = "exact",
        warm: Plan | None = None,
    ) -> Plan:
        """A throw to `target` (the scene's by default), with its status.

        Always returns; raises InputError only for wrong input. solver: 'auto' is FATROP
        with IPOPT as fallback. turns: 'any' takes theta modulo full turns. warm: a
        solved plan of this planner for a target nearby.
        """
        started = time.perf_counter()
        target = self.check(target)
        if solver not in ("auto", "fatrop", "ipopt"):
            raise InputError(f"solver = {solver!r}: must be one of auto, fatrop, ipopt")
        if turns not in ("exact", "any"):
            raise InputError(f"turns = {turns!r}: must be one of exact, any")
        search = _Search(self.scene.aimed_at(target))
        made, self._build_time = self._build_time, 0.0
        search.times["build"] = made
        names = ("fatrop", "ipopt") if solver == "auto" else (solver,)
        plan = self._warm_plan(target, names[0], warm, search) if warm is not None else None
        if plan is None:
            plan = self._search(target, names, turns, search)
        plan.time.update(search.times)
        plan.time["total"] = time.perf_counter() - started + made
        return plan

    def check(self, target: Pose | None = None) -> Pose:
        """The target that `plan` would take; InputError if it does not fit the scene."""
        target = checked_target(self.scene, target)
        self._check_azimuth(target)
        return target

    def _search(self, target: Pose, names: tuple[str, ...], turns: Turns, search: _Search) -> Plan:
        """Solvers in turn, each from several starts; then the honest answer."""
        with search.clock("guess"):
            releases = self._table()
            starts = self._starts(releases, target, turns)
        for name in names:
            for index, goal in starts[: STARTS[name]]:
                nlp = self._nlp(goal, search)
                with search.clock("guess"):
                    guess = guess_from(nlp, self._sampler, releases, index, goal.z)
                solved = self._attempt(goal, name, guess, None, search)
                if solved is not None:
                    return self._result("solved", goal, "", solved, name, search)
                search.palm = search.palm or "palm:" in search.trouble[-1]
        return self._failure(target, [goal for _, goal in starts], releases, names[-1], search)

    def _warm_plan(self, target: Pose, name: str, warm: Plan, search: _Search) -> Plan | None:
        """A plan from a neighbouring one, None if that does not lead to a solved throw."""
        if warm.throw is None or warm.mover is not self.mover:
            return None
        if (warm.target.theta is None) != (target.theta is None):
            return None
        solution = warm.throw.solution
        # The palm's rows, if the earlier plan needed them: its multipliers fit no other NLP.
        search.palm = solution.lam_g.size != self._nlp(target, search).size[1]
        if solution.lam_g.size != self._nlp(target, search).size[1]:
            search.palm = False
            return None
        solved = self._attempt(target, name, solution.x, solution, search)
        if solved is None:
            return None
        return self._result("solved", target, "", solved, name, search)

    def _starts(self, releases: Releases, target: Pose, turns: Turns) -> list[tuple[int, Pose]]:
        """(release index, target) pairs, nearest landing first."""
        goals = [target]
        if turns == "any" and target.theta is not None:
            _, thetas, _ = releases.landings(target.z, self.scene.gravity)
            usual = float(np.nanmedian(thetas)) if np.isfinite(thetas).any() else target.theta
            nearest_turn = round((usual - target.theta) / (2 * math.pi))
            turns_around = range(nearest_turn - 2, nearest_turn + 3)
            goals = [target.turned(2 * math.pi * k) for k in turns_around]
        found: list[tuple[float, int, Pose]] = []
        for goal in goals:
            indices, distances = nearest(
                releases, self.scene, goal.plane_x, goal.z, goal.theta, max(STARTS.values())
            )
            found += [(float(d), int(i), goal) for i, d in zip(indices, distances, strict=True)]
        found.sort(key=lambda entry: entry[0])
        return [(index, goal) for _, index, goal in found]

    def _attempt(
        self, target: Pose, name: str, guess: Array, warm: Solution | None, search: _Search
    ) -> PlannedThrow | None:
        """One solve and its corrections; None (and why, in `search`) if it is no good."""
        nlp = self._nlp(target, search)
        solver = self._solver(target, name, search)
        limits = bounds(nlp, self.scene, self.mover)
        goal = target
        best: PlannedThrow | None = None
        best_miss = math.inf
        for _ in range(MAX_CORRECTIONS):
            numbers = nlp.parameters.vector(parameter_values(search.scene, self.mover, goal))
            with search.clock("solve"):
                solution = solver.solve(guess, numbers, limits, warm)
                if not solution.success and warm is not None:
                    solution = solver.solve(warm.x, numbers, limits)
            search.iterations += solution.iterations
            search.attempts += 1
            if not solution.success:
                if best is None:
                    search.trouble.append(f"{name} did not converge")
                break
            try:
                thrown = self._checked(nlp, solution, numbers, target, search)
            except SmoothingError as error:
                search.trouble.append(str(error))
                break
            dx, dtheta = thrown.final.miss(target)
            miss = _scaled(dx, dtheta, AIM)
            if not miss < best_miss:
                if best is None:
                    search.trouble.append("the object never comes down to the target's height")
                break
            best, best_miss = thrown, miss
            if miss <= 1.0:
                break
            goal = goal.in_plane(goal.plane_x - dx, goal.turned(-dtheta).theta)
            guess, warm = solution.x, solution
        return self._accepted(best, target, search)

    def _checked(
        self, nlp: ThrowNlp, solution: Solution, numbers: Array, target: Pose, search: _Search
    ) -> PlannedThrow:
        """The solution's motion smoothed, and thrown by the non-smooth models."""
        scene, mover = search.scene, self.mover
        opening = scene.gripper.profile().opening
        duration = nlp.block(solution.x, "T", 0)
        assert duration is not None
        opening_time = float(duration[0])
        planned = planned_motion(nlp, mover, solution.x, opening)
        with search.clock("smooth"):
            samples = send(mover, planned)
        with search.clock("check"):
            exact = throw(scene, mover, planned, opening_time, target.z)
            sent = None
            if scene.robot is not None:
                sent = throw(scene, mover, samples, opening_time, target.z)
            surface = limit_surface_landing(
                scene, mover, planned if sent is None else samples, opening_time, target.z
            )
            x, z, theta = np.array(nlp.landing(solution.x, numbers)).ravel()
        return PlannedThrow(
            solution, planned, samples, opening_time, (x, z, theta), exact, sent, surface
        )

    def _accepted(
        self, thrown: PlannedThrow | None, target: Pose, search: _Search
    ) -> PlannedThrow | None:
        """`thrown` if it keeps the promise of `solved`; else None and why."""
        if thrown is None:
            return None
        with search.clock("check"):
            problems = self._broken(search.scene, thrown, target)
        if not problems:
            return thrown
        search.trouble.append("; ".join(problems))
        if search.fallback is None:
            search.fallback = (thrown, search.trouble[-1])
        return None

    def _broken(self, scene: Scene, thrown: PlannedThrow, target: Pose) -> list[str]:
        """Everything that a solved throw must not break, in words."""
        mover, tolerance = self.mover, scene.tolerance
        problems = []
        for label, result in (("planned", thrown.exact), ("sent", thrown.sent)):
            if result is None:
                continue
            dx, dtheta = result.miss(target)
            if not _scaled(dx, dtheta, (tolerance.position, tolerance.angle)) <= 1.0:
                problems.append(
                    f"{label} motion lands {1e3 * abs(dx):.2f} mm and "
                    f"{math.degrees(abs(dtheta)):.2f} deg off"
                )
        problems += [
            f"limit of {name} broken"
            for name in broken_limits(mover.hard, mover.joints, thrown.samples)
        ]
        if thrown.exact.grip_use > 1.0:
            problems.append(f"slip before the opening (grip use {thrown.exact.grip_use:.2f})")
        motion = thrown.planned if thrown.sent is None else thrown.samples
        end = thrown.planned.times[-1] if thrown.sent is None else thrown.samples.times[-1]
        return problems + scene_violations(
            scene, mover, motion, end, thrown.opening_time, thrown.final
        )

    def _failure(
        self,
        target: Pose,
        goals: list[Pose],
        releases: Releases,
        name: str,
        search: _Search,
    ) -> Plan:
        """No throw found: out of reach with the nearest possible, or not converged."""
        if not goals:
            far, pose, words = highest(releases, target, self.scene.gravity)
            status: Status = "out_of_reach" if far else "not_converged"
            return self._result(
                status, target, words, None, name, search, pose, ("landing height",)
            )
        goal = goals[0]
        with search.clock("solve"):
            answer = nearest_possible(search.scene, self.mover, self._sampler, releases, goal)
        search.iterations += answer.iterations
        if answer.pose is not None and not answer.inside_tolerance:
            message = _out_of_reach(goal, answer)
            return self._result(
                "out_of_reach", target, message, None, name, search, answer.pose, answer.names
            )
        if answer.solution is not None:
            # The elastic solve reached the target: its point starts the real problem.
            nlp = self._nlp(goal, search)
            guess = answer.guess_for(nlp)
            solved = self._attempt(goal, "ipopt", guess, None, search)
            if solved is not None:
                return self._result("solved", goal, "", solved, "ipopt", search)
        thrown, why = search.fallback or (None, search.trouble[-1] if search.trouble else "")
        message = f"no throw found: {why or 'no feasible release to start from'}"
        return self._result("not_converged", target, message, thrown, name, search)

    def _result(
        self,
        status: Status,
        target: Pose,
        message: str,
        thrown: PlannedThrow | None,
        name: str,
        search: _Search,
        nearest_pose: Pose | None = None,
        binding: tuple[str, ...] = (),
    ) -> Plan:
        nlp = self._nlp(target, search)
        plan = Plan(
            search.scene,
            self.mover,
            target,
            status,
            message,
            thrown,
            nearest_pose,
            binding,
            name,
            search.iterations,
            search.attempts,
            *nlp.size,
        )
        if status == "solved":
            dx, dtheta = plan.error_sent()
            object.__setattr__(
                plan,
                "message",
                f"lands {1e3 * dx:.3f} mm and {math.degrees(dtheta):.3f} deg from the target",
            )
        return plan

    def _table(self) -> Releases:
        if self._releases is None:
            self._releases = self._sampler.draw(SAMPLES)
        return self._releases

    def _nlp(self, target: Pose, search: _Search) -> ThrowNlp:
        key = (target.theta is not None, search.palm)
        if key not in self._nlps:
            with search.clock("build"):
                structure = structure_of(self.scene, self.mover, key[0], palm=search.palm)
                self._nlps[key] = build_nlp(structure, self.mover)
        return self._nlps[key]

    def _solver(self, target: Pose, name: str, search: _Search) -> Solver:
        key = (target.theta is not None, search.palm, name)
        if key not in self._solvers:
            nlp = self._nlp(target, search)
            with search.clock("build"):
                self._solvers[key] = Solver(nlp, name)
        return self._solvers[key]

    def _check_azimuth(self, target: Pose) -> None:
        arm = self.scene.arm
        if arm is None:
            return
        joint = arm.azimuth_joint - 1
        turn = target.azimuth
        low, high = arm.limits.position_min[joint], arm.limits.position_max[joint]
        if not low <= turn <= high:
            raise InputError(
                f"target: its azimuth {math.degrees(turn):.1f} deg is outside joint "
                f"{joint + 1}'s range [{math.degrees(low):.1f}, {math.degrees(high):.1f}] deg"
            )


def _scaled(dx: float, dtheta: float, scale: tuple[float, float]) -> float:
    """The larger of the two misses, each in its own unit of `scale`; inf for NaN."""
    value = max(abs(dx) / scale[0], abs(dtheta) / scale[1])
    return value if math.isfinite(value) else math.inf


def _out_of_reach(target: Pose, answer: Binding) -> str:
    pose = answer.pose
    assert pose is not None
    angle = "" if pose.theta is None else f", theta {math.degrees(pose.theta):.1f} deg"
    limits = f" (limited by {', '.join(answer.names[:4])})" if answer.names else ""
    return f"out of reach: nearest possible x {pose.plane_x:.3f} m{angle}{limits}"
