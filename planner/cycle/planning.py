"""The plan of a cycle: its throws, their order, and one motion through all of them."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence

import numpy as np

from ...problems import InputError, Jobs, Pick, Scene, check_arguments
from ..planner import Planner
from .cycle import Cycle, UnsolvedError
from .network import Network
from .order import EXACT
from .sequence import sequence
from .transfers import CycleThrow

#: Time [s] for each throw that is planned.
PATIENCE = 3.0


@check_arguments
def plan_cycle(
    jobs: Jobs, *, patience: float = PATIENCE, progress: Callable[[str], object] | None = None
) -> Cycle:
    """All objects of a job file thrown into their bins, as one motion in the least time.

    Always returns; `Cycle.solved` says whether all is done. patience [s]: for each throw that is
    planned. progress: called with what is done next. InputError for an option out of range.
    """
    started = time.perf_counter()
    if not patience > 0:
        raise InputError(f"patience = {patience:g}: must be above 0")
    say = progress or (lambda words: None)
    throws = _Throws(jobs, patience, say)
    planned = time.perf_counter() - started
    if throws.trouble:
        spent = {"throws": planned, "total": planned}
        return Cycle(jobs.name, refused=throws.trouble, time=spent)
    say(f"{jobs.name}: finding the order")
    network = Network(jobs, throws.found, throws.kinds)
    try:
        order, chosen = network.fastest()
        say(f"{jobs.name}: joining the motions")
        cycle = sequence(jobs, network, order, chosen, throws.again)
    except UnsolvedError as error:
        spent = {"throws": planned, "total": time.perf_counter() - started}
        return Cycle(jobs.name, refused=str(error), time=spent)
    stops = network.with_stops(order, chosen)
    total = time.perf_counter() - started
    spent = {"throws": planned, "transfers": total - planned, "total": total}
    searched = "exact" if len(jobs.picks) <= EXACT else "insertion"
    known = jobs.order if jobs.order == "given" else searched
    return dataclasses.replace(cycle, stops=stops, time=spent, order=known)


class _Throws:
    """Throws for every object into every bin that it may go to.

    Objects that are alike share them. Each is planned from rest in the throwing joints' pose of a
    pick, in the least time, and from a free start pose if that finds none.
    """

    def __init__(self, jobs: Jobs, patience: float, say: Callable[[str], object]) -> None:
        self.jobs, self._patience = jobs, patience
        self._planners: list[Planner] = []
        self.found: list[CycleThrow] = []
        self.kinds: list[int] = []
        self.trouble = ""
        sections: list[dict[str, object]] = []
        for pick in jobs.picks:
            if pick.sections not in sections:
                sections.append(pick.sections)
            self.kinds.append(sections.index(pick.sections))
        for kind in range(len(sections)):
            picks = [p for p, k in zip(jobs.picks, self.kinds, strict=True) if k == kind]
            for number, one in enumerate(jobs.bins):
                able = [pick for pick in picks if one in jobs.bins_of(pick)]
                if able:
                    say(f"{self.jobs.name}: planning throws into {one.name}")
                    self._plan(kind, number, able)

    def _plan(self, kind: int, number: int, picks: Sequence[Pick]) -> None:
        """Throws of one kind of object into one bin."""
        one = self.jobs.bins[number]
        scene, reasons = self.jobs.scene_of(picks[0], one), list[str]()
        target = scene.target
        assert target is not None
        # A bin that moves is aimed at where it is in the middle of the cycle.
        goal = target.at(0.75 * len(self.jobs.picks)).changed(velocity=None, since=0.0)
        for start in (_middle(picks, scene), None):
            planner = self._planner(scene, start)
            plan = planner.plan(goal, patience=self._patience)
            if plan.solved:
                self.found.append(CycleThrow(plan, number, kind))
                return
            reasons.append(plan.message)
        words = f"{picks[0].name} into {one.name}: {reasons[-1]}"
        if not all(len(self.jobs.bins_of(pick)) > 1 for pick in picks):
            self.trouble = self.trouble or words

    def _planner(self, scene: Scene, start: tuple[float, ...] | None) -> Planner:
        """The planner of a scene with a start pose; one for all that differ in the target only."""
        assert scene.robot is not None
        scene = scene.replace(robot=dataclasses.replace(scene.robot, start=start))
        for planner in self._planners:
            own = planner.scene
            assert scene.target is not None
            if own.fits(scene) and own.aimed_at(scene.target).cup == scene.cup:
                return planner
        self._planners.append(Planner(scene, library=False))
        return self._planners[-1]

    def again(self, one: CycleThrow, seconds: float) -> CycleThrow | None:
        """A throw into a moving bin, for where it is `seconds` after the start of the cycle."""
        target = self.jobs.scene_of(self._pick_of(one), self.jobs.bins[one.bin]).target
        assert target is not None
        planner = next(p for p in self._planners if p.scene.fits(one.plan.scene))
        goal = target.at(seconds).changed(velocity=None, since=0.0)
        plan = planner.plan(goal, warm=one.plan, patience=self._patience)
        return CycleThrow(plan, one.bin, one.kind) if plan.solved else None

    def _pick_of(self, one: CycleThrow) -> Pick:
        """A pick of the object of a throw."""
        return self.jobs.picks[self.kinds.index(one.kind)]


def _middle(picks: Sequence[Pick], scene: Scene) -> tuple[float, ...]:
    """The throwing joints' pose of the pick that is nearest to all others."""
    arm = scene.arm
    assert arm is not None
    poses = np.array([pick.joints for pick in picks])[:, np.array(arm.throwing_joints) - 1]
    away = np.abs(poses[:, None] - poses).sum(axis=(1, 2))
    return tuple(poses[away.argmin()].tolist())
