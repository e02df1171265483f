"""Extreme scenes: one quantity at an extreme value, then all quantities at random.

The targets come from the scene's own table of releases, so that most are in reach: among its
landings, at the farthest one, beyond it, at the height of the hand.
"""

from __future__ import annotations

import dataclasses
import math
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from throwplan import InputError, Plan, Planner, Pose, Scene, load_scene

from .judge import Judgement, judge
from .processes import ENDINGS, in_processes

#: Place of a case's target; "own" is the base scene's target.
Aim = Literal["own", "inside", "edge", "beyond", "hand height", "straight up", "behind"]
#: Number of random mixtures of each base scene; those with a Panda take ten times as long.
BASES = {"hand-flip": 75, "hand-box": 70, "pose": 6, "box": 2, "cup": 2}
#: Index of the value that each scene with an arm takes of a lever's values.
ENDS = {"pose": -1, "box": 0, "cup": -1}
#: Seed of the mixtures.
SEED = 7
#: Time limit [s] of a case; a longer one is a hang, and its process is ended.
PATIENCE = 120.0
#: Longest flight [s] to a target from the table; the planner's own limit is 3 s.
LONGEST = 2.5
#: Least x [m] of an arm's targets, ahead of its base, except in the case "behind".
AHEAD = 0.5


@dataclass(frozen=True)
class Case:
    """One extreme scene: its base, the extreme quantity, its value, and the place of the target."""

    base: str
    lever: str
    value: str
    scene: Scene
    aim: Aim = "inside"

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"{self.base}: {self.lever} {self.value}".strip()

    def target(self, planner: Planner) -> Pose:
        """The case's target; the scene's own if no release lands."""
        own = self.scene.aim
        if self.aim == "own":
            return own
        height = own.z
        if self.aim == "hand height":
            height = 0.7 if self.scene.robot is None else 0.5
        if self.aim == "straight up":
            height = 1.5
        x, theta, time = planner.releases().landings(height, self.scene.flight)
        # NaN for a release that does not land at this height.
        found = np.flatnonzero((time < LONGEST) & planner.releases().clear)
        if found.size == 0:
            return dataclasses.replace(own, z=height)
        ordered = found[np.argsort(x[found])]
        if self.aim in ("edge", "beyond"):
            i = int(ordered[-1])
        elif self.aim == "behind":
            i = int(ordered[0])
        else:
            ahead = found if self.scene.robot is None else found[x[found] > AHEAD]
            seed = zlib.crc32(self.name.encode())
            i = int(np.random.default_rng(seed).choice(ahead if ahead.size else found))
        away = 0.1 * float(x[ordered[-1]] - x[ordered[0]]) if self.aim == "beyond" else 0.0
        angle = None if own.theta is None else float(theta[i])
        return Pose(x=float(x[i]) + away, z=height, theta=angle)


def bar(scene: Scene, *, mass: float, gyration: float, h: float) -> Scene:
    """The scene with a symmetric bar of this mass [kg] and radius of gyration [m], held at `h` [m]
    from its middle."""
    length = max(2.4 * gyration, 2.0 * h)
    thing = dataclasses.replace(
        scene.object, mass=mass, inertia=mass * gyration**2, length=length, com=length / 2
    )
    grasp = dataclasses.replace(scene.grasp, offset=length / 2 - h)
    return scene.replace(object=thing, grasp=grasp)


def _usual(scene: Scene) -> dict[str, float]:
    """The scene's bar as arguments of `bar`."""
    thing = scene.object
    gyration = math.sqrt(thing.inertia / thing.mass)
    return {"mass": thing.mass, "gyration": gyration, "h": scene.com_offset}


def _section(scene: Scene, name: str, **changes: Any) -> Scene:
    """The scene with some keys of one section changed."""
    return scene.replace(**{name: dataclasses.replace(getattr(scene, name), **changes)})


def _grip(scene: Scene, factor: float) -> Scene:
    force = scene.gripper.force
    assert force is not None
    return _section(scene, "gripper", force=factor * force)


def _heavy(scene: Scene, factor: float) -> Scene:
    """Mass and grip force times `factor`, so that the grip still holds."""
    usual = _usual(scene)
    return _grip(bar(scene, **usual | {"mass": factor * usual["mass"]}), factor)


def _slippery(scene: Scene, friction: float) -> Scene:
    """Friction reduced and grip force increased by one factor."""
    factor = scene.contact.friction / friction
    return _grip(_section(scene, "contact", friction=friction), factor)


def _agile(scene: Scene, acceleration: float) -> Scene:
    """Acceleration limits of a hand [m/s^2]; for an arm, a share of its limits."""
    if scene.hand is None:
        return _section(scene, "robot", acceleration_margin=1 - acceleration)
    angular = scene.hand.angular_acceleration
    if angular is not None:
        angular *= acceleration / scene.hand.acceleration
    return _section(scene, "hand", acceleration=acceleration, angular_acceleration=angular)


#: Extreme quantities: the function that sets one, and its values, SI units.
LEVERS: dict[str, tuple[Callable[[Scene, float], Scene], tuple[float, ...]]] = {
    "mass": (lambda s, v: bar(s, **_usual(s) | {"mass": v}), (1e-4, 0.01, 2.0, 50.0)),
    "mass and grip times": (_heavy, (1e-3, 0.1, 10.0, 200.0)),
    "radius of gyration": (
        lambda s, v: bar(s, **_usual(s) | {"gyration": v}),
        (0.002, 0.02, 0.1, 0.4),
    ),
    "CoM offset": (lambda s, v: bar(s, **_usual(s) | {"h": v}), (0.0, 1e-4, 0.01, 0.3)),
    "bar of 1 m, CoM offset": (
        lambda s, v: bar(s, mass=0.3, gyration=1 / math.sqrt(12), h=v),
        (0.0, 0.5),
    ),
    "friction": (lambda s, v: _section(s, "contact", friction=v), (0.01, 0.1, 3.0, 30.0)),
    "friction with a strong grip": (_slippery, (1e-3, 0.02)),
    "patch radius": (lambda s, v: _section(s, "contact", patch_radius=v), (1e-5, 5e-4, 0.02, 0.2)),
    "torsion": (lambda s, v: _section(s, "contact", torsion=v), (1e-3, 5.0)),
    "grip force": (lambda s, v: _section(s, "gripper", force=v), (0.5, 10.0, 1e3, 1e5)),
    "opening": (lambda s, v: _section(s, "gripper", opening=v), (1e-5, 5e-4, 5e-3, 0.2, 1.0)),
    "dwell": (lambda s, v: _section(s, "gripper", dwell=v), (0.0, 1.0)),
    "gravity": (lambda s, v: s.replace(gravity=v), (0.0, 0.1, 1.62, 25.0, 100.0)),
    "tolerance": (lambda s, v: _section(s, "tolerance", position=v, angle=v), (2e-4, 0.05)),
}
#: Extreme acceleration limits [m/s^2] of a hand.
HAND_ACCELERATIONS = (2.0, 8.0, 200.0, 500.0)
#: Extreme accelerations of an arm, as shares of its limits.
ARM_ACCELERATIONS = (0.15, 0.4)
#: Places of targets in the otherwise unchanged base scenes.
AIMS: tuple[Aim, ...] = ("edge", "beyond", "hand height", "straight up", "behind")


def cases() -> list[Case]:
    """All extreme cases; equal in each call."""
    found = []
    for number, (name, mixtures) in enumerate(BASES.items()):
        # The extremes are beyond what a gripper of a file has.
        base = _section(load_scene(name), "gripper", peak=1e6)
        found += list(_levers(name, base))
        found += [Case(name, "target", aim, base, aim) for aim in AIMS]
        rng = np.random.default_rng([SEED, number])
        found += [_mixture(name, base, rng, i) for i in range(mixtures)]
    return found


def _levers(name: str, base: Scene) -> Iterator[Case]:
    """One extreme quantity at a time: several values for a hand, one for an arm."""
    # With a cup the target stays: the bar fits into it at one angle only.
    aim: Aim = "own" if base.cup is not None else "inside"
    for lever, (change, settings) in LEVERS.items():
        for value in settings if base.robot is None else [settings[ENDS[name]]]:
            yield Case(name, lever, f"{value:g}", change(base, value), aim)
    for value in HAND_ACCELERATIONS if base.robot is None else ARM_ACCELERATIONS:
        yield Case(name, "acceleration", f"{value:g}", _agile(base, value), aim)


def _mixture(name: str, base: Scene, rng: np.random.Generator, number: int) -> Case:
    """All quantities at random, log-uniform over wide ranges.

    The grip is strong enough for the bar's weight, by a factor of 1.2 to 30.
    """

    def wide(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    mass, h = wide(1e-3, 50), 0.0 if rng.random() < 0.2 else wide(1e-3, 0.5)
    scene = bar(base, mass=mass, gyration=wide(5e-3, 0.3), h=h)
    scene = _section(scene, "contact", friction=wide(0.02, 3), patch_radius=wide(2e-4, 0.05))
    gravity = 0.0 if rng.random() < 0.2 else float(rng.uniform(1, 25))
    weight = mass * max(gravity, 1.0)
    patch = scene.patch
    # The load of a bar held level: its weight and the torque of that.
    needed = weight * math.hypot(1.0, h / patch.torsion_arm) / float(patch.force_limit(1.0))
    force = min(needed * wide(1.2, 30), 1e6)
    scene = _section(scene, "gripper", force=force, opening=wide(5e-4, 0.5))
    scene = scene.replace(gravity=gravity)
    if scene.hand is not None:
        scene = _agile(scene, wide(3, 500))
    aims: tuple[Aim, ...] = ("inside", "inside", "edge", "hand height")
    aim: Aim = "own" if base.cup is not None else aims[int(rng.integers(len(aims)))]
    return Case(name, "mixture", str(number), scene, aim)


@dataclass(frozen=True)
class CaseOutcome:
    """The outcome of a case. cause: why it is not solved or judged wrong; seconds: of the plan."""

    case: Case
    status: str
    cause: str = ""
    judgement: Judgement | None = None
    finite: bool = True
    iterations: int = 0
    seconds: float = math.nan

    @property
    def false(self) -> bool:
        """Whether the oracle judges a solved plan wrong."""
        return self.judgement is not None and bool(self.judgement.broken)

    @property
    def is_defect(self) -> bool:
        """Whether the plan ended otherwise than a plan may."""
        return not self.finite or self.status in ("traceback", *ENDINGS)

    @property
    def undecided(self) -> bool:
        """Whether the oracle's own error exceeds the tolerance."""
        allowed = self.case.scene.tolerance.position
        return self.judgement is not None and self.judgement.doubt > allowed


def run(case: Case) -> CaseOutcome:
    """Plan one case; judge it by the oracle."""
    start = time.perf_counter()
    try:
        planner = Planner(case.scene, library=False)
        plan = planner.plan(case.target(planner))
    except InputError as error:
        return CaseOutcome(case, "refused", str(error), seconds=time.perf_counter() - start)
    except Exception as error:
        words = f"{type(error).__name__}: {error}"
        return CaseOutcome(case, "traceback", words, seconds=time.perf_counter() - start)
    seconds = time.perf_counter() - start
    judgement, cause = None, plan.message
    if plan.solved:
        judgement = judge(plan)
        cause = "; ".join(judgement.broken)
    return CaseOutcome(case, plan.status, cause, judgement, finite(plan), plan.iterations, seconds)


def finite(plan: Plan) -> bool:
    """Whether all numbers of a plan are finite."""
    found: list[Any] = []
    if plan.nearest is not None:
        near = plan.nearest.target
        found += [near.x, near.z, near.theta or 0.0]
    if plan.solved and plan.throw is not None:
        throw = plan.throw
        solution = throw.solution
        found += [throw.effort, throw.planned_landing]
        found += [] if solution is None else [solution.x, solution.lam_g]
        found += [throw.samples.q, throw.samples.dq, throw.samples.ddq, plan.error_sent()]
        found += [throw.deciding.release.com, throw.deciding.release.com_twist]
    return all(bool(np.isfinite(np.asarray(value, float)).all()) for value in found)


def outcomes(chosen: list[Case]) -> Iterator[CaseOutcome]:
    """All cases, planned by processes that can be ended."""
    answers = in_processes(run, [(case,) for case in chosen], PATIENCE)
    for case, answer in zip(chosen, answers, strict=True):
        if isinstance(answer, str):
            yield CaseOutcome(case, answer, ENDINGS[answer], seconds=PATIENCE)
        else:
            yield answer
