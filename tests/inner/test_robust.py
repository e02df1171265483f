"""Robust plans: judged on samples that planning did not use; what they cost when not asked for."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.planner.ocp import window_of
from throwplan.planner.sweep import Sweep
from throwplan.planner.throw import friction_use
from throwplan.problems import Distribution, Uncertainty


def scaled_spread(plan: tp.Plan) -> float:
    """95 % quantile [m] of the scaled error about the plan's own landing."""
    return float(np.quantile(tp.sweep(plan, samples=512).errors["scaled"], 0.95))


def relative(deviation: float) -> Distribution:
    return Distribution(normal=deviation, relative=True)


#: Delay, friction, patch radius and mass.
FOUR = Uncertainty(
    delay=Distribution(uniform=0.006),
    friction=relative(0.12),
    patch_radius=relative(0.1),
    mass=relative(0.04),
)


@cache
def planner_of(name: str, uncertainty: Uncertainty | None) -> tp.Planner:
    return tp.Planner(tp.load_scene(name).replace(uncertainty=uncertainty))


@cache
def planned(name: str, uncertainty: Uncertainty | None, robust: str | None = None) -> tp.Plan:
    return planner_of(name, uncertainty).plan(robust=robust)


@cache
def fresh(name: str, uncertainty: Uncertainty | None, robust: str | None) -> Sweep:
    """A sweep with samples that planning did not use."""
    plan = planned(name, uncertainty, robust)
    assert plan.solved
    return tp.sweep(plan, samples=1024, seed=11)


DELAY = tp.load_scene("delay").uncertainty


@pytest.fixture(scope="module")
def nominal() -> tp.Plan:
    return planned("delay", DELAY)


@pytest.mark.slow
def test_near_the_base_auto_lets_go_slowly() -> None:
    """Where the hand has no room to follow a free flight; a quiet throw scatters more there.

    With an arm without capsules: the bar would meet its links there.
    """
    planner = tp.Planner(varied(tp.load_scene("delay"), arm={"capsules": ()}))
    target = tp.Pose(x=-0.3444, z=0.1, theta=-1.428254)
    plain, quiet, auto = (planner.plan(target, robust=m) for m in (None, "quiet", "auto"))
    assert plain.solved and quiet.solved and auto.solved
    assert scaled_spread(auto) < scaled_spread(plain) / 3
    assert scaled_spread(quiet) > scaled_spread(auto)


@pytest.mark.parametrize(
    ("name", "uncertainty"),
    [
        ("delay", FOUR),
        pytest.param("box", FOUR, marks=pytest.mark.slow),
        ("gen3", None),
        pytest.param("cup", None, marks=pytest.mark.slow),
        pytest.param("flip", FOUR, marks=pytest.mark.slow),
    ],
)
def test_a_robust_plan_is_never_worse_than_the_plain_one(
    name: str, uncertainty: Uncertainty | None
) -> None:
    before, after = (fresh(name, uncertainty, robust) for robust in (None, "auto"))
    lost = int((before.success & ~after.success).sum())
    gained = int((after.success & ~before.success).sum())
    assert lost - gained <= 3 * np.sqrt(lost + gained)
    if lost >= gained:
        bound, found = (np.quantile(one.errors["scaled"], 0.95) for one in (before, after))
        assert found <= 1e-4 + 1.1 * bound


def test_friction_patch_radius_mass_and_delay_are_borne() -> None:
    """Slip in the full grip counts: no sample of 1,024 slips or lands outside the tolerance."""
    plain, robust = (fresh("box", FOUR, robust) for robust in (None, "auto"))
    assert plain.success.mean() < 0.7 and robust.success.mean() > 0.99
    wide, narrow = (np.quantile(one.errors["scaled"], 0.95) for one in (plain, robust))
    assert narrow < wide / 10


def test_a_method_that_fails_leaves_the_plain_plan_and_says_so() -> None:
    """No motion of the arm into the cup keeps the joints' velocities over the window."""
    nominal, planner = planned("cup", None), planner_of("cup", None)
    plan = planner.plan(robust="joint-velocity", patience=4.0)
    assert plan.solved and plan.robust == "nominal"
    assert "joint-velocity found none" in plan.message
    # All numbers are those of the throw that is given.
    assert plan.to_dict()["error"] == nominal.to_dict()["error"]
    assert np.array_equal(plan.throw.samples.q, nominal.throw.samples.q)


def test_a_free_hand_is_quiet_all_the_way() -> None:
    """Where nothing limits it, the pads transmit next to nothing from when the earliest opening has
    left a quarter of the grip, until the latest is over."""
    plan = planned("hand-flip", None, "quiet")
    assert plan.solved and plan.peak_load < 0.01
    throw, scene = plan.throw, tp.load_scene("hand-flip")
    window, profile = window_of(scene), scene.gripper.profile()
    begin = throw.opening_time - window.early * window.step + 3 / 4 * profile.opening
    end = throw.opening_time + profile.opening + window.late * window.step
    hand = plan.manipulator.hand(throw.planned).at(np.linspace(begin, end, 200))
    assert friction_use(scene, hand).max() == pytest.approx(plan.peak_load, rel=0.1)
    assert scaled_spread(plan) < scaled_spread(planned("hand-flip", None)) / 50


def test_a_robust_plan_forgives_friction_and_opening_time_too(nominal) -> None:
    """Planned without knowing it: 30 % less friction and 20 % longer opening."""
    other = nominal.scene
    pads = {"friction": 0.7 * other.contact.friction}
    grip = {"opening": 1.2 * other.gripper.opening}
    misses = []
    for plan in (nominal, planned("delay", DELAY, "auto")):
        scene = varied(plan.scene, contact=pads, gripper=grip)
        found = tp.sweep(dataclasses.replace(plan, scene=scene), samples=256)
        x, theta = found.landings.pose[:, 0], found.landings.pose[:, 1]
        dx, dtheta = x - plan.target.plane_x, theta - plan.target.theta
        arm = other.object.length / 2
        misses.append(np.quantile(np.abs(dx) + arm * np.abs(dtheta), 0.95))
    assert misses[1] < misses[0] / 5


@pytest.mark.slow
def test_errors_of_com_and_grasp_are_planned_against() -> None:
    """They move the free flight, which a quiet release alone does not mind."""
    errors = {name: Distribution(normal=0.002) for name in ("com_offset", "grasp_offset")}
    known = Uncertainty(**errors)
    spread = [scaled_spread(planned("hand-flip", known, m)) for m in (None, "quiet")]
    with_delay, scene = planned("hand-flip", None, "quiet"), planner_of("hand-flip", known).scene
    blind = scaled_spread(dataclasses.replace(with_delay, scene=scene))
    assert spread[1] < min(spread[0], 0.9 * blind)
