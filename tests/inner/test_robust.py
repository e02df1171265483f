"""Fails if a robust plan scatters more than a plain one on samples that planning did not use, or
says another success than that of its sweep."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
import pytest
import throwplan as tp
from builders import only
from throwplan.planner.sweep import Sweep
from throwplan.planner.throw import friction_use
from throwplan.problems import Distribution, Uncertainty


def scaled_spread(plan: tp.Plan) -> float:
    """95 % quantile [m] of the scaled error about the plan's own landing."""
    return float(np.quantile(tp.sweep(plan, samples=512).errors["scaled"], 0.95))


def relative(deviation: float) -> Distribution:
    return Distribution(normal=deviation, relative=True)


#: Delay, friction, patch radius and mass.
FOUR = only(
    delay=Distribution(uniform=0.006),
    friction=relative(0.12),
    patch_radius=relative(0.1),
    mass=relative(0.04),
)


def scene_of(name: str) -> tp.Scene:
    """A built-in scene; "place": that of the scene `box` with its bin's centre as the target."""
    if name != "place":
        return tp.load_scene(name)
    return tp.load_scene("box").replace(bin=None, target=tp.Pose(x=1.1, z=0.10))


@cache
def planner_of(name: str, uncertainty: Uncertainty | None) -> tp.Planner:
    scene = scene_of(name).replace(uncertainty=uncertainty, cost=tp.Cost(quiet=10.0))
    return tp.Planner(scene)


@cache
def planned(name: str, uncertainty: Uncertainty | None, robust: bool = False) -> tp.Plan:
    return planner_of(name, uncertainty).plan(robust=robust)


@cache
def loud(name: str, uncertainty: Uncertainty | None) -> tp.Plan:
    """The plan whose load on the pads costs nothing."""
    scene = scene_of(name).replace(uncertainty=uncertainty, cost=tp.Cost(quiet=0.0))
    return tp.plan(scene)


def fresh(plan: tp.Plan) -> Sweep:
    """A sweep with samples that planning did not use."""
    assert plan.solved
    return tp.sweep(plan, samples=1024, seed=11)


DELAY = tp.load_scene("delay").uncertainty


def test_no_plan_is_worse_than_one_that_tries_less() -> None:
    """A robust one than the default, and this than one whose load costs nothing."""
    plans = loud("delay", FOUR), planned("delay", FOUR), planned("delay", FOUR, True)
    for before, after in itertools.pairwise(map(fresh, plans)):
        lost = int((before.success & ~after.success).sum())
        gained = int((after.success & ~before.success).sum())
        assert lost - gained <= 3 * np.sqrt(lost + gained)
        if lost >= gained:
            bound, found = (np.quantile(one.errors["scaled"], 0.95) for one in (before, after))
            assert found <= 1e-4 + 1.1 * bound


def test_a_robust_throw_falls_steeply_where_the_height_is_uncertain() -> None:
    """An error of height moves the landing only by the time of flight that it adds."""
    uncertainty = only(hand_z=Distribution(normal=0.01))
    plain, robust = (planned("hand-box", uncertainty, kind) for kind in (False, True))
    assert scaled_spread(robust) < 0.8 * scaled_spread(plain)


@pytest.mark.slow
def test_friction_patch_radius_mass_and_delay_are_borne() -> None:
    """Slip in the full grip counts: no sample of 1,024 slips or lands outside the tolerance."""
    plain, robust = fresh(loud("place", FOUR)), fresh(planned("place", FOUR, True))
    assert plain.success.mean() < 0.7 and robust.success.mean() > 0.99
    wide, narrow = (np.quantile(one.errors["scaled"], 0.95) for one in (plain, robust))
    assert narrow < wide / 10


def test_the_success_that_a_plan_says_is_that_of_its_sweep() -> None:
    plan = planned("delay", DELAY)
    rate = tp.sweep(plan).to_dict()["success"]["rate"]
    assert f"{100 * rate:.1f} % succeed" in plan.message


def test_a_free_hand_is_quiet_all_the_way() -> None:
    """Where nothing limits it, the pads transmit next to nothing from when the earliest opening has
    left a quarter of the grip, until the latest is over."""
    plan = planned("hand-flip", DELAY)
    assert plan.solved and plan.peak_load < 0.05
    throw, scene = plan.throw, tp.load_scene("hand-flip")
    begin = throw.opening_time - 0.01 + 3 / 4 * scene.gripper.profile().opening
    end = throw.opening_time + scene.gripper.profile().opening + 0.01
    hand = plan.manipulator.hand(throw.planned).at(np.linspace(begin, end, 200))
    assert friction_use(scene, hand).max() == pytest.approx(plan.peak_load, rel=0.1)
    assert scaled_spread(plan) < scaled_spread(loud("hand-flip", DELAY)) / 50
