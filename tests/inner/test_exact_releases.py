"""Fails if the quick exact releases land elsewhere than slow, plain references."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
import throwplan as tp
from scipy.integrate import solve_ivp
from throwplan.models import MovedHand, Trajectory
from throwplan.models.release import (
    Release,
    ReleaseCase,
    SlidingPivot,
    SteppedRelease,
    TableGrip,
    exact_pivot_release,
    exact_surface_release,
)
from throwplan.planner.throw import Throw, ThrowBatch, case_of
from throwplan.planner.verdict import Judge

from benchmarks.plain_pivot import world_release

#: Seen from either side of a kink, so far away [s].
INSIDE = 1e-12
SCENES = ("near-cup", "hand-flip")


@pytest.fixture
def throw(plan_of, name: str) -> Throw:
    """What a scene's plan sends."""
    return plan_of(name).throw.deciding


def landed(throw: Throw, release: Release) -> np.ndarray:
    """x [m], theta [rad] at the height of the throw's target."""
    return throw.scene.flight.land(release.end[None], throw.target.z)[0, :2]


def together(one: np.ndarray, other: np.ndarray, x: float, theta: float) -> bool:
    """Whether two landings are no farther apart than x [m] and theta [rad]."""
    return bool((np.abs(one - other) <= [x, theta]).all())


def kinks(case: ReleaseCase) -> np.ndarray:
    """Where the hand's acceleration or jerk may step in the opening [s]."""
    path = case.hand.path if isinstance(case.hand, MovedHand) else case.hand
    assert isinstance(path, Trajectory)
    times = path.kinks - path.delays
    return times[(times > 0) & (times < case.grip.opening)]


def reference(case: ReleaseCase) -> Release:
    """Another integrator, with its own step control, from kink to kink."""
    law = SlidingPivot(case.body, case.contact, case.gravity)
    state = np.array([0.0, 0.0, case.grasp_angle, 0.0, 0.0, 0.0])
    for begin, end in itertools.pairwise([0.0, *kinks(case), case.grip.opening]):

        def rates(t: float, y: np.ndarray, a: float = begin, b: float = end) -> list:
            hand = case.hand.at(np.clip(np.array([t]), a + INSIDE, b - INSIDE))
            return [np.ravel(v)[0] for v in law.rates(y, hand.motion, case.grip.force(t))]

        run = solve_ivp(rates, (begin, end), state, "DOP853", rtol=1e-10, atol=1e-12)
        state = run.y[:, -1]
    last = case.hand.at(np.array([case.grip.opening - INSIDE]))
    return world_release(law, last, state[:, None], np.zeros(1))


@pytest.mark.parametrize("name", SCENES)
def test_sliding_pivot_lands_as_by_another_integrator(throw: Throw) -> None:
    """Also under a measured grip force, and by a hand whose acceleration steps between nodes."""
    case = throw.case
    mine = landed(throw, exact_pivot_release(case))
    assert together(mine, landed(throw, reference(case)), 1e-6, 1e-5)
    table = TableGrip([0.0, 0.005, 0.02, 0.04, 0.05], [120.0, 120.0, 60.0, 20.0, 0.0])
    measured = dataclasses.replace(case, grip=table)
    mine = landed(throw, exact_pivot_release(measured))
    assert together(mine, landed(throw, reference(measured)), 1e-5, 1e-4)
    steps = [[5.0, 2, 60], [-20, 10, -80], [15, -5, 90], [0, 20, -60]]
    times = [0.0, 0.0107, 0.0233, 0.0391]
    hand = Trajectory.stepping((0.0, 0.5, 0.3), (2.0, 1.0, 5.0), times, steps)
    stepping = case_of(throw.scene, hand)
    assert exact_pivot_release(stepping).end == pytest.approx(reference(stepping).end, abs=1e-6)


@pytest.mark.parametrize("name", SCENES)
def test_limit_surface_lands_as_the_models_own_does(throw: Throw) -> None:
    case = throw.case
    surface = landed(throw, exact_surface_release(case))
    # First order: two runs of the plain model give its limit.
    coarse, fine = (landed(throw, SteppedRelease(steps=n).release(case)) for n in (8000, 16_000))
    assert together(surface, 2 * fine - coarse, 1e-4, 6e-4)


def test_a_stiff_throw_of_a_sweep_is_that_throw_by_itself() -> None:
    """A light body on wide pads under a crooked grip force: steps of equal length miss its landing
    by a degree."""
    times = (0.0, 0.0041, 0.0098, 0.0268, 0.0302, 0.0344, 0.0711, 0.0834, 0.1297, 0.1329)
    forces = (5.862, 5.393, 3.793, 3.604, 3.389, 1.33, 1.169, 0.988, 0.072, 0.0)
    scene = tp.load_scene("hand-flip").replace(
        object=tp.Object(length=0.1062, com=0.0742, width=0.0221, mass=0.02017),
        contact=tp.Contact(friction=1.4968, patch_radius=0.044406, torsion=2.462, faces=3),
        gripper=tp.Gripper(times=times, forces=forces),
        tolerance=tp.Tolerance(position=5e-4, angle=math.radians(0.2)),
        target=tp.Pose(1.452, -2.0, math.radians(92.9)),
        cost=tp.Cost(quiet=0.0),
    )
    plan = tp.Planner(scene, library=False).plan()
    assert plan.solved
    batch = ThrowBatch.of(plan.throw.deciding, plan.target, ("delay",), (-0.05, 0.05, 0.1329))
    judge, delays = Judge.of_success(batch), np.linspace(-4e-4, 4e-4, 41)[:, None]
    verdicts = judge.verdicts(delays)
    for delay, pose in zip(delays, verdicts.pose, strict=True):
        late = batch.one(delay)
        own = [late.landing.x, late.landing.theta]
        assert pose[:2] == pytest.approx(own, abs=1e-6)
        # The same by very many even steps, not extrapolated.
        many = SteppedRelease(20000).release(late.case)
        assert pose[:2] == pytest.approx(landed(late, many), abs=2e-3)
    assert 0.1 < verdicts.succeeds.mean() < 0.9
