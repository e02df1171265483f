"""The nearest landing that is possible, and the limits that bind there.

The same NLP with a landing that may miss at a price in the scaled error (39), solved
from the nearest sampled releases: an answer from the table and from the elastic solve, not from
a failed iteration.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...models import Array
from ...problems import Pose, Scene
from ..check import (
    Guard,
    Mover,
    Throw,
    column_distance,
    column_of,
    enters_cup_at_landing,
)
from ..ocp import (
    CUP_MARGIN,
    Asked,
    Block,
    Margins,
    Request,
    Solution,
    Solver,
    ThrowNlp,
    binding_limits,
    build_nlp,
    planned_motion,
)
from .attempt import Edge, Start
from .guess import guess_from
from .nlps import Task
from .release_table import Releases, nearest, past_column

#: Starts of the elastic solve, and how many more where it ends farther from the target than
#: the landing it started from.
STARTS, MORE_STARTS = 3, 5
#: How much farther that may be.
WORSE = 1.1
#: A height this far [m] above every sampled apex is out of reach.
HEIGHT_ROOM = 0.25
#: The cup's own clearance and no more: less than that only is out of reach.
BARE = Margins(cup=-CUP_MARGIN)
#: NLPs tried from the elastic point for each aim.
TRIES = 3
#: How much farther than the elastic point to aim, which lies at the very edge.
BEYOND = 1.02
#: Share of the tolerance that the aim may use.
INSIDE = 0.98
#: A target is out of reach where the nearest possible landing is farther [m, scaled error] off.
CLEARLY = 0.03
#: Margin [m] beyond the cup's clearance that is kept in the end, at more depths.
LEAST = 2e-4
#: Angles at which a bar that may land at any angle is compared with the column.
HALF_TURN = 181


@dataclass(frozen=True)
class Binding(Edge):
    """The nearest possible landing by the elastic problem; pose is None where it was not solved.

    inside_tolerance: whether it is the goal itself. beside: (dx [m], dtheta [rad]) from the goal to
    where the elastic point lands by its own model, missed its scaled distance.
    """

    inside_tolerance: bool
    iterations: int
    solution: Solution | None = None
    nlp: ThrowNlp | None = None
    beside: tuple[float, float] = (0.0, 0.0)

    @property
    def outside(self) -> bool:
        """Whether something is possible, but not the goal."""
        return self.pose is not None and not self.inside_tolerance

    def guess_for(self, nlp: ThrowNlp) -> Array:
        """The elastic point as a start of the real problem `nlp`."""
        elastic, solution = self.nlp, self.solution
        assert elastic is not None and solution is not None
        flight = elastic.block(solution.x, "t_f", elastic.structure.detach)

        def value(block: Block, k: int) -> Array | float:
            known = elastic.block(solution.x, block.name, k, block.index)
            if known is not None:
                return known
            # The times of more cup depths than the elastic problem has.
            return 0.0 if flight is None else float(flight[0])

        return nlp.fill(value)


class Reach:
    """The elastic problems of a scene, built when first asked for."""

    def __init__(self, scene: Scene, mover: Mover) -> None:
        self._scene, self._mover = scene, mover
        self._solvers: dict[
            tuple[tuple[bool, ...], frozenset[Guard]], tuple[ThrowNlp, list[Solver]]
        ] = {}

    def begun(self, mover: Mover) -> Reach:
        """The same problems for a mover that begins in another state of motion."""
        found = copy(self)
        found._mover = mover
        return found

    def _solver(self, request: Request) -> tuple[ThrowNlp, list[Solver]]:
        guards = request.asked.guards
        assert request.target is not None
        key = request.target.kind, guards
        if key not in self._solvers:
            nlp = build_nlp(request)
            solvers = [Solver(nlp, name) for name in ("fatrop", "ipopt")]
            self._solvers[key] = (nlp, solvers)
        return self._solvers[key]

    def nearest_possible(
        self,
        task: Task,
        releases: Releases,
        target: Pose,
        guards: frozenset[Guard],
        solved: Sequence[tuple[Start, float]] = (),
    ) -> Binding:
        """The landing nearest `target` in the scaled error that the task's scene can throw.

        target: the task's, its turns counted; guards: rows that the check has shown to be needed;
        solved: starts from throws that land nearby, with how far off [m], tried before releases.
        """
        mover, scene = self._mover, task.scene
        request = Request(scene, mover, target, Asked(guards, BARE), elastic=True)
        with task.clock("build"):
            nlp, solvers = self._solver(request)
        numbers, limits = nlp.numbers(request), nlp.bounds(request)
        begins, enough, known = _begins(nlp, request, releases, solved)
        best: Solution | None = None
        missed, iterations = math.inf, 0
        for tried, begin in enumerate(begins):
            if (tried >= enough and missed <= known) or task.clock.late:
                break
            if missed <= scene.tolerance.position:
                break
            guess = begin()
            for solver in solvers:
                with task.clock("solve"):
                    solution = solver.solve(guess, numbers, limits, seconds=task.clock.left)
                iterations += solution.iterations
                if solution.success:
                    break
            if solution.success and (best is None or solution.cost < best.cost):
                best, missed = solution, _miss(nlp, solution, numbers, scene, target)
        if best is None or missed > known:
            # Failed iterations prove nothing, nor do those that led away from a known landing.
            return Binding(target, None, (), math.inf, False, iterations)
        return _binding(nlp, request, best, missed, iterations)


def _begins(
    nlp: ThrowNlp, request: Request, releases: Releases, solved: Sequence[tuple[Start, float]]
) -> tuple[list[Callable[[], Array]], int, float]:
    """Guesses to start from, how many are enough, and how near [m] a known throw lands."""
    scene, mover, target = request.scene, request.mover, request.target
    assert target is not None
    if "passing" in request.asked.guards:
        releases = past_column(releases, scene, target.z)
    where = scene, target.plane_x, target.z, target.theta
    entering = _into_the_cup(scene, releases, target)
    indices, distances = nearest(entering, *where, STARTS + MORE_STARTS)
    nearby = [*distances, *(away for _, away in solved)]
    known = WORSE * min(nearby, default=math.inf) + scene.tolerance.position
    places = [(entering, index) for index in indices]
    if entering is not releases:
        # Beside the throws that go into the cup the nearest of those that do not.
        places[1:1] = [(releases, index) for index in nearest(releases, *where, STARTS)[0]]
    begins: list[Callable[[], Array]] = [partial(start.guess, nlp) for start, _ in solved]
    for table, index in places:
        flown = table.flight_time(index, target.z, scene.gravity)
        begins.append(partial(guess_from, nlp, scene, mover, table, int(index), flown))
    return begins, len(begins) - MORE_STARTS, known


def _binding(
    nlp: ThrowNlp, request: Request, best: Solution, missed: float, iterations: int
) -> Binding:
    """What an elastic solution says; its pose is that of the non-smooth model's landing, which can
    be thrown."""
    scene, mover, target = request.scene, request.mover, request.target
    assert target is not None
    motion, opening = planned_motion(nlp, request, best.x)
    landing = Throw(scene, mover, motion, opening).landing
    if not math.isfinite(landing.flight_time):
        return Binding(target, None, (), math.inf, False, iterations)
    numbers, limits = nlp.numbers(request), nlp.bounds(request)
    angle = None if target.theta is None else landing.theta
    end = np.array(nlp.landing(best.x, numbers)).ravel()
    dx = float(end[0] - target.plane_x)
    dtheta = 0.0 if target.theta is None else float(end[2] - target.theta)
    most = scene.tolerance
    inside = abs(dx) <= most.position and abs(dtheta) <= most.angle
    names = () if inside else binding_limits(nlp, mover.joints, best, limits)
    pose = target.in_plane(landing.x, angle)
    return Binding(target, pose, names, missed, inside, iterations, best, nlp, (dx, dtheta))


def elastic_starts(answer: Binding, task: Task, asked: Asked) -> Iterator[Start]:
    """Starts from an elastic point within the tolerance, the last resort at the edge of reach.

    The target itself first. Where that is impossible the elastic point's own landing, which the
    tolerance allows, is the aim; and in the end a smaller margin to the cup is kept.
    """
    if answer.solution is None or answer.missed > CLEARLY:
        return
    most = task.scene.tolerance
    dx, dtheta = (
        min(max(BEYOND * miss, -INSIDE * allowed), INSIDE * allowed)
        for miss, allowed in zip(answer.beside, (most.position, most.angle), strict=True)
    )
    variants = [asked]
    if task.scene.cup is not None:
        margins = asked.margins.replace(cup=LEAST - CUP_MARGIN)
        variants.append(Asked(asked.guards | {"flight"}, margins))
    first = task.solvers[0]
    if answer.outside:
        # It seems to be just out of reach.
        for variant in variants:
            yield Start(answer.goal, answer.guess_for, first, variant)
        return
    yield Start(answer.goal, answer.guess_for, first, asked, TRIES)
    for variant, aim in itertools.product(variants, ((0.0, 0.0), (dx, dtheta))):
        yield Start(answer.goal, answer.guess_for, "ipopt", variant, TRIES, aim=aim)


def _miss(nlp: ThrowNlp, solution: Solution, numbers: Array, scene: Scene, target: Pose) -> float:
    """Scaled distance [m] (39) of an elastic solution's landing from the target."""
    x, _, theta = np.array(nlp.landing(solution.x, numbers)).ravel()
    turn = 0.0 if target.theta is None else abs(theta - target.theta)
    return float(abs(x - target.plane_x) + turn * scene.object.length / 2)


def in_column(scene: Scene, target: Pose) -> bool:
    """Whether the bar would be inside the base column there, wherever the tolerance lets it be."""
    column, most = column_of(scene), scene.tolerance
    if column is None:
        return False
    half_turn = np.linspace(0.0, math.pi, HALF_TURN)
    theta = half_turn if target.theta is None else np.array([target.theta])
    poses = np.array([np.full(theta.size, target.plane_x), np.full(theta.size, target.z), theta])
    room = column_distance(scene.object, poses, *column).max()
    return bool(room < -most.position - most.angle * scene.object.length)


def _into_the_cup(scene: Scene, releases: Releases, target: Pose) -> Releases:
    """The releases that go into a cup that has come along; all, if none does."""
    if scene.cup is None:
        return releases
    x, _, time = releases.landings(target.z, scene.gravity)
    found = enters_cup_at_landing(scene, releases.detach, x, time)
    return releases.picked(found) if found.any() else releases


def highest(releases: Releases, target: Pose, gravity: float) -> tuple[bool, Pose | None, str]:
    """Where no sampled release comes down through the target's height: the highest apex.

    Whether the target is clearly above it, the pose there, and words.
    """
    if len(releases.q) == 0:
        return False, None, "no throw found: no sampled release keeps limits and grip"
    x, z, theta, v_x, v_z, omega = releases.detach.T
    rise = np.maximum(v_z, 0.0) / gravity if gravity > 0 else np.zeros_like(z)
    apex = z + rise * np.maximum(v_z, 0.0) / 2
    i = int(np.argmax(apex))
    angle = None if target.theta is None else float(theta[i] + omega[i] * rise[i])
    pose = dataclasses.replace(
        target.in_plane(float(x[i] + v_x[i] * rise[i]), angle), z=float(apex[i])
    )
    far = bool(target.z > apex[i] + HEIGHT_ROOM)
    kind = "out of reach" if far else "no throw found"
    if target.z <= apex[i]:
        return far, pose, f"{kind}: no sampled release comes down through z {target.z:g} m"
    most = f"at most about {apex[i]:.2f} m"
    return far, pose, f"{kind}: no sampled release rises to z {target.z:g} m, {most}"
