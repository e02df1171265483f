"""Further throws to a target, which bear the scene's uncertainty."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...problems import Nlp, Scene
from ..ocp import CONSTANT_RATES, LEAST_LOAD, SCENARIOS
from ..result import Plan
from ..search import Exact, NlpCache, Task, attempt, guess_of
from ..uncertainty import sampler_of
from .choice import Candidate, best_of, chosen
from .running import SAMPLES, SEED

#: [nlp] of robust throws: they hardly slide, so even intervals and a wide rounding are enough.
ROBUST_NLP = Nlp(opening=8, grading=1.0, epsilon=0.03)
#: Share of the samples for which grip and clearances of a robust throw have a reserve.
RESERVED = 0.999
#: NLPs of one method from one throw.
TRIES = 2


@dataclass(frozen=True)
class Hardening:
    """Makes further throws to a target, which bear the scene's uncertainty.

    problems: the NLPs of `robust_scene`.
    """

    problems: NlpCache
    task: Task

    def from_throw(self, source: Plan, method: str) -> Plan | None:
        """A throw by one method from a plan's: with reserves for uncertain parameters, else without
        them; None without any."""
        start, nlp = source.throw, self.problems.scene.nlp
        assert start is not None
        plain = self.task.scene.replace(nlp=nlp)
        for scene in dict.fromkeys((with_reserves(plain), plain)):
            task = dataclasses.replace(self.task, scene=scene)
            refinement = dataclasses.replace(start.refinement, quiet=0.0)
            # The middle of a region is the farthest from its bounds.
            first = Exact(source.target.middle, guess_of(start), refinement, robust=method)
            found = attempt(self.problems, first, task, rounds=TRIES)
            self.task.budget.counts["starts"] += 1
            if found.hits and found.throw is not None:
                deciding = found.throw.deciding.in_scene(plain)
                throw = dataclasses.replace(found.throw, deciding=deciding)
                message = throw.words(source.target)
                return dataclasses.replace(
                    source,
                    throw=throw,
                    solver=found.solver,
                    message=message,
                    variables=throw.nlp_size[0],
                    constraints=throw.nlp_size[1],
                )
            margins = found.verdict is not None and found.verdict.reserves
            if (found.throw is not None and not margins) or self.task.budget.late:
                # Less reserve does not help: a throw was found, and it breaks another limit.
                break
        return None


def hardened(
    plans: Sequence[Plan], hardening: Hardening, others: Callable[[], Sequence[Plan]]
) -> Plan:
    """The best of plans to a target, of throws with the least load or constant joint rates while
    the pads open, of throws planned for several openings at once, and of those from other throws to
    the target.

    The search ends where all samples succeed.
    """
    pool, tried = [Candidate(plan) for plan in plans], set[tuple[int, str]]()

    def is_over() -> bool:
        return bool(best_of(pool).success.all()) or hardening.task.budget.late

    def sources() -> Iterator[Candidate]:
        yield pool[0]
        if not is_over():
            for plan in others():
                pool.append(Candidate(plan))
                yield pool[-1]

    for source in sources():
        for method in (LEAST_LOAD, CONSTANT_RATES, SCENARIOS):
            start = best_of(pool) if method == SCENARIOS else source
            if is_over() or (id(start), method) in tried:
                continue
            tried.add((id(start), method))
            plan = hardening.from_throw(start.plan, method)
            if plan is not None:
                pool.append(Candidate(plan))
    return dataclasses.replace(chosen(pool), robust=True)


def robust_scene(scene: Scene) -> Scene:
    """The scene with the [nlp] of robust plans, unless it sets its own."""
    return scene.replace(nlp=ROBUST_NLP) if scene.nlp == Nlp() else scene


def with_reserves(scene: Scene) -> Scene:
    """The scene with reserves of grip and clearances for its [uncertainty] until the opening.

    They cover the friction and the displacement of the held bar in a share `RESERVED` of the
    samples.
    """
    sampler = sampler_of(scene, SEED)
    own = scene.values | {"delay": scene.mean_delay}
    draws = dict(zip(sampler.names, sampler.draw(0, SAMPLES).T, strict=True))
    value = {name: draws.get(name, np.full(SAMPLES, own[name])) for name in own}
    h = value["com_offset"] - value["grasp_offset"] + own["grasp_offset"]
    pads = own["friction"] / value["friction"]
    heavy = value["mass"] / own["mass"]
    # Against turning, the moment of inertia about the pads, and the weight's lever.
    about_pads = value["inertia"] + value["mass"] * h**2
    levers = [about_pads / (own["inertia"] + own["mass"] * own["com_offset"] ** 2)]
    if own["com_offset"] > 0.0:
        levers.append(heavy * np.abs(h) / own["com_offset"])
    turning = np.max(levers, axis=0) * own["patch_radius"] / value["patch_radius"]
    load = float(np.quantile(pads * np.maximum(heavy, turning), RESERVED))
    margin = max(scene.gripper.sticking_margin, 1.0 - 1.0 / max(load, 1.0))
    scene = scene.changed(gripper=scene.gripper.changed(sticking_margin=margin))
    lever = max(scene.object.com, scene.object.length - scene.object.com)
    angle = np.abs(value["grasp_angle"] - own["grasp_angle"] + value["hand_theta"])
    off = np.abs(value["grasp_offset"] - own["grasp_offset"]) + lever * angle
    off = float(np.quantile(off + np.hypot(value["hand_x"], value["hand_z"]), RESERVED))
    if scene.workspace is None or off == 0.0:
        return scene
    room = scene.workspace
    wider = {
        name: getattr(room, name) + off
        for name in ("floor", "column_radius", "column_height", "palm_clearance")
        if getattr(room, name) is not None
    }
    return scene.changed(workspace=room.changed(**wider))
