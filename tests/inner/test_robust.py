"""Robust plans: quiet, by scenarios; what they bear, and what they cost when not asked for."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.check import friction_use, make_mover
from throwplan.planner.ocp import Request, build_nlp, window_of
from throwplan.planner.robust import QUIET_MESH
from throwplan.planner.search import refit
from throwplan.problems import Robust


def scaled_spread(plan: tp.Plan, **uncertain: dict) -> float:
    """95 % quantile [m] of the scaled error about the plan's own landing."""
    return float(np.quantile(tp.sweep(plan, samples=512).errors["scaled"], 0.95))


@pytest.fixture(scope="module")
def planner() -> tp.Planner:
    return tp.Planner(tp.load_scene("delay"))


@pytest.fixture(scope="module")
def nominal(planner: tp.Planner) -> tp.Plan:
    return planner.plan()


@pytest.mark.slow
def test_near_the_base_auto_lets_go_slowly() -> None:
    """Where the hand has no room to follow a free flight; a quiet throw scatters more there.

    With an arm without capsules: the bar would meet its links there.
    """
    scene = tp.load_scene("delay")
    planner = tp.Planner(scene.replace(arm=dataclasses.replace(scene.arm, capsules=())))
    target = tp.Pose(x=-0.3444, z=0.1, theta=-1.428254)
    plain, quiet, auto = (planner.plan(target, robust=m) for m in (None, "quiet", "auto"))
    assert plain.solved and auto.solved
    assert auto.robust == "joint-velocity"
    assert scaled_spread(auto) < scaled_spread(plain) / 5
    assert not quiet.solved or scaled_spread(quiet) > scaled_spread(auto)


@pytest.mark.slow
def test_auto_is_never_worse_than_the_nominal_throw(planner: tp.Planner) -> None:
    target = tp.Pose(x=0.2160, z=0.1, theta=-2.111609)
    plain, auto = planner.plan(target), planner.plan(target, robust="auto")
    assert plain.solved and auto.solved
    assert scaled_spread(auto) <= 1.01 * scaled_spread(plain)


def test_a_free_hand_is_quiet_all_the_way() -> None:
    """Where nothing limits it, the pads transmit next to nothing over the whole window."""
    scene = tp.load_scene("hand-flip")
    plan = tp.Planner(scene).plan(robust="quiet")
    assert plan.solved and plan.peak_load < 0.01
    throw = plan.throw
    window, profile = window_of(scene), scene.gripper.profile()
    begin = throw.opening_time - window.early * window.step
    end = throw.opening_time + profile.opening + window.late * window.step
    hand = plan.mover.hand(throw.planned).at(np.linspace(begin, end, 200))
    assert np.hypot(*friction_use(scene, hand)).max() == pytest.approx(plan.peak_load, rel=0.1)
    assert scaled_spread(plan) < scaled_spread(tp.plan(scene)) / 50


def test_quiet_forgives_friction_and_opening_time_too(planner: tp.Planner) -> None:
    """Planned without knowing it: 30 % less friction and 20 % longer opening."""
    other = planner.scene
    contact = dataclasses.replace(other.contact, friction=0.7 * other.contact.friction)
    gripper = dataclasses.replace(other.gripper, opening=1.2 * other.gripper.opening)
    misses = []
    for plan in (planner.plan(), planner.plan(robust="quiet")):
        changed = dataclasses.replace(
            plan, scene=plan.scene.replace(contact=contact, gripper=gripper)
        )
        found = tp.sweep(changed, samples=256)
        x, theta = found.landings.pose[:, 0], found.landings.pose[:, 1]
        dx, dtheta = x - plan.target.plane_x, theta - plan.target.theta
        arm = other.object.length / 2
        misses.append(np.quantile(np.abs(dx) + arm * np.abs(dtheta), 0.95))
    assert misses[1] < misses[0] / 5


def test_window_and_scenarios_cost_nothing_when_not_asked_for() -> None:
    scene = tp.load_scene("delay")
    mover = make_mover(scene)
    plain = build_nlp(Request(scene, mover, scene.target))
    without = scene.replace(uncertainty=None)
    assert build_nlp(Request(without, mover, scene.target)).size == plain.size
    assert not [n for n in plain.parameters.blocks if n.startswith(("window", "quiet"))]
    window = window_of(scene)
    quiet = build_nlp(Request(scene, mover, scene.target, robust="quiet"))
    extra = window.early + window.late
    # q, dq, ddq and the jerk of each interval of the window; no relative states.
    assert quiet.size[0] - plain.size[0] == extra * 4 * mover.size


def test_window_follows_the_uncertainty() -> None:
    scene = tp.load_scene("delay")
    window = window_of(scene)
    # 10 ms of delay either way, and a fifth of the opening's 50 ms at the end.
    assert (window.early, window.late) == (2, 4)
    assert window.step == pytest.approx(0.005)
    assert sorted(window.delays) == pytest.approx([-0.01, -0.005, 0.01, 0.02])
    short = window_of(scene.replace(robust=Robust(early=0.0, late=0.004)))
    assert (short.early, short.late, short.step) == (0, 1, pytest.approx(0.004))


def test_a_throw_of_another_mesh_is_a_start_of_the_scenarios(nominal: tp.Plan) -> None:
    """Robust NLPs have other opening intervals than the throw they start from."""
    throw = nominal.throw
    scene = nominal.scene.replace(mesh=QUIET_MESH)
    assert scene.mesh.opening != throw.nlp.structure.opening
    window = window_of(scene)
    request = Request(scene, nominal.mover, nominal.target, robust="scenarios")
    nlp = build_nlp(request)
    x = refit(nlp, throw, request)
    assert np.isfinite(x).all()
    detach = nlp.structure.detach
    for name in ("rel", "t_f"):
        old = throw.nlp.block(throw.solution.x, name, throw.nlp.structure.detach)
        assert nlp.block(x, name, detach) == pytest.approx(old)
    # An opening that is late has hardly moved when the planned one is over, an early one is on.
    early, late = (nlp.block(x, "rel", detach, i) for i in (1, len(window.delays)))
    assert np.abs(late).max() < np.abs(early).max()
