"""The plan of a cycle: its throws, their order, and one motion through all of them."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..models import Array
from ..planner import Plan, Planner, SpatialScene, State, make_manipulator
from ..problems import InputError, Pose, Scene, checked
from .approach import approach_of
from .connections import CycleThrow, standstill
from .cycle import Cycle, UnsolvedError
from .inverse_kinematics import HandPose, inverse_kinematics
from .job_files import Jobs, Pick
from .network import Network
from .sequence import sequence
from .waiting import WaitingObjects

#: Time [s] for each throw that is planned.
PATIENCE = 10.0
#: Largest number of bins into which throws of a pick are planned: those whose planes are nearest.
MOST_BINS = 4
#: Largest number of picks of which all orders are compared.
EXACT = 10
#: Time [s] that an object takes, for a first guess where moving bins are.
CYCLE_TIME = 2.0
#: Start poses [rad] that differ by less are one.
ALIKE = 1e-9


def plan_cycle(
    jobs: Jobs, *, patience: float = PATIENCE, progress: Callable[[str], object] | None = None
) -> Cycle:
    """All objects of a job file thrown into their bins, as one motion in the least time.

    Always returns; `Cycle.solved` says whether all is done. patience [s]: for each throw that is
    planned. progress: called with what is done next. InputError for an option out of range.
    """
    started = time.perf_counter()
    checked("patience", patience, float, {"above": 0})
    if jobs.order == "free" and len(jobs.picks) > EXACT:
        words = f"has {len(jobs.picks)} picks: of more than {EXACT} give the order"
        raise InputError(f"{jobs.name}: order = 'free': {words}: order = 'given'")
    say = progress or (lambda words: None)
    jobs = with_joints(jobs)
    cycle = _planned(jobs, patience, say)
    if not cycle.solved and jobs.base_scene.weights.quiet:
        # A quiet hand follows its object, perhaps to where another one waits.
        say(f"{jobs.name}: again, with throws that are not quiet")
        cycle = _planned(jobs.loud, patience, say)
    spent = cycle.time | {"total": time.perf_counter() - started}
    return dataclasses.replace(cycle, time=spent)


def _planned(jobs: Jobs, patience: float, say: Callable[[str], object]) -> Cycle:
    """The cycle of jobs whose picks have all joints."""
    started = time.perf_counter()
    objects = WaitingObjects(jobs)
    throws = _Throws(jobs, patience, say)
    planned = time.perf_counter() - started
    if throws.trouble:
        spent = {"throws": planned, "total": planned}
        return Cycle(jobs.name, jobs.base_scene, refused=throws.trouble, time=spent)
    say(f"{jobs.name}: finding the order")
    network = Network(jobs, throws.found, objects)
    try:
        chosen = network.fastest()
        say(f"{jobs.name}: joining the motions")
        motion = sequence(jobs, network, chosen, throws.again)
    except UnsolvedError as error:
        spent = {"throws": planned, "total": time.perf_counter() - started}
        return Cycle(jobs.name, jobs.base_scene, refused=str(error), time=spent)
    total = time.perf_counter() - started
    spent = {"throws": planned, "transfers": total - planned, "total": total}
    order = jobs.order if jobs.order == "given" else "exact"
    return Cycle(jobs.name, jobs.base_scene, motion, order, spent)


def with_joints(jobs: Jobs) -> Jobs:
    """The jobs with all joints of each pick; InputError for a hand pose that the arm cannot take.

    Of the solutions of a hand pose the one next to the posture of throws over it is taken, whose
    plane the hand is in if its turn is left open.
    """
    if all(pick.joints is not None for pick in jobs.picks):
        return jobs
    arm, picks, mistakes = jobs.arm, list[Pick](), list[str]()
    middle = (np.array(arm.limits.position_min) + np.array(arm.limits.position_max)) / 2
    seed, throwing = np.array(arm.posture), np.array(arm.throwing_joints) - 1
    seed[throwing] = middle[throwing]
    for number, pick in enumerate(jobs.picks, start=1):
        try:
            if pick.joints is not None:
                seed = np.array(pick.joints)
            elif pick.place is not None:
                near = np.array(arm.posture)
                near[throwing] = seed[throwing]
                seed = _joints_over(jobs, pick, pick.place, near)
        except InputError as error:
            mistakes += str(error.within(f"{jobs.name}: pick {number}")).splitlines()
        picks.append(pick.changed(joints=tuple(seed.tolist()), x=None, y=None, z=None, turn=None))
    if mistakes:
        raise InputError(*mistakes)
    return dataclasses.replace(jobs, picks=tuple(picks))


def _joints_over(jobs: Jobs, pick: Pick, place: tuple[float, float, float], near: Array) -> Array:
    """Joints of a hand that points down at a place, near the throwing joints of `near`."""
    (x, y, z), arm, scene = place, jobs.arm, jobs.scene_of(pick, jobs.bins_of(pick)[0])
    azimuth = Pose(x=x, y=y, z=z).with_lateral(arm.lateral).plane.azimuth
    near[arm.azimuth_joint - 1] = arm.azimuth_angle(azimuth)
    space = SpatialScene(scene, make_manipulator(scene))
    pose = HandPose(place, azimuth if pick.turn is None else pick.turn)
    return inverse_kinematics(space, pose, near.tolist(), held=True)


class _Throws:
    """Throws of each object into its bins, in the least time from rest in the pick's own pose.

    found: of each pick in turn; a throw is planned once for objects that are alike in like poses.
    """

    def __init__(self, jobs: Jobs, patience: float, say: Callable[[str], object]) -> None:
        self.jobs, self._patience = jobs, patience
        self._planners: list[Planner] = []
        self._plans = list[tuple[Scene, State, Plan]]()
        self.found: list[CycleThrow] = []
        self.trouble = ""
        for number, pick in enumerate(jobs.picks):
            say(f"{jobs.name}: planning throws of {pick.name}")
            self._plan(number, pick)

    def _plan(self, number: int, pick: Pick) -> None:
        """Throws from one pick."""
        scenes = {one.name: self.jobs.scene_of(pick, one) for one in self.jobs.bins_of(pick)}
        reasons, count = list[str](), len(self.found)
        try:
            behind = approach_of(self.jobs, pick).away[-1].q[-1]
        except UnsolvedError as error:
            self.trouble = self.trouble or f"{pick.name}: {error}"
            return
        for name in _nearest(pick, scenes)[:MOST_BINS]:
            try:
                plan = self._first(scenes[name], _start(behind, scenes[name]))
            except InputError as error:
                raise error.within(f"{self.jobs.name}: bin {name!r}") from None
            if plan.solved:
                self.found.append(CycleThrow(plan, number, name))
            else:
                reasons.append(f"{pick.name} into {name}: {plan.message}")
        if len(self.found) == count:
            self.trouble = self.trouble or reasons[0]

    def _first(self, scene: Scene, start: State) -> Plan:
        """The throw to a bin; to one that moves, for where it is in the middle of the cycle."""
        return self._planned(scene, scene.aim.at(CYCLE_TIME / 2 * len(self.jobs.picks)), start)

    def _planned(self, scene: Scene, target: Pose, start: State, warm: Plan | None = None) -> Plan:
        """The throw to a target, as if that were at rest.

        From the start or, if that finds none, from a start pose that is free.
        """
        goal = target.changed(velocity=None, since=0.0)
        scene = scene.aimed_at(goal)
        for known, state, plan in self._plans:
            if known == scene and np.abs(state.q - start.q).max() < ALIKE:
                return plan
        planner, patience = self._planner(scene), self._patience / 2
        plan = planner.plan(goal, start=start, warm=warm, patience=patience)
        if not plan.solved:
            plan = planner.plan(goal, patience=patience)
        self._plans.append((scene, start, plan))
        return plan

    def _planner(self, scene: Scene) -> Planner:
        """The planner of a scene; one for all that differ in the target only."""
        for planner in self._planners:
            own = planner.scene
            if own.fits(scene) and own.aimed_at(scene.aim).opening == scene.opening:
                return planner
        self._planners.append(Planner(scene, library=False))
        return self._planners[-1]

    def again(self, one: CycleThrow, seconds: float) -> CycleThrow | None:
        """A throw into a moving bin, for where it is `seconds` after the start of the cycle."""
        pick = self.jobs.picks[one.pick]
        scene = self.jobs.scene_of(pick, self.jobs.bin(one.bin))
        start = standstill(one.throw.samples.q[0])
        plan = self._planned(scene, scene.aim.at(seconds), start, one.plan)
        return CycleThrow(plan, one.pick, one.bin) if plan.solved else None


def _start(joints: Sequence[float] | Array | None, scene: Scene) -> State:
    """The throwing joints at rest, of all joints."""
    assert scene.arm is not None and joints is not None
    return standstill([joints[joint - 1] for joint in scene.arm.throwing_joints])


def _nearest(pick: Pick, scenes: Mapping[str, Scene]) -> list[str]:
    """Names of bins, those first whose throws' planes are nearest to the pick's."""

    def turn(name: str) -> float:
        arm = scenes[name].arm
        assert arm is not None and pick.joints is not None
        angle = arm.azimuth_angle(scenes[name].aim.plane.azimuth)
        return abs(angle - pick.joints[arm.azimuth_joint - 1])

    return sorted(scenes, key=turn)
