"""Fails if the NLP's derivatives are not those of CasADi's whole, its landing is not that of the
exact model, or its bounds are not the scene's."""

from __future__ import annotations

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from builders import nlp_of, request_of, varied
from throwplan.models import HandMotion
from throwplan.models.release import SlidingPivot, Widths, rk4_step
from throwplan.planner.ocp import Refinement, ThrowNlp, build_nlp, nlp_functions
from throwplan.planner.search import ReleaseSampler, Starts, Task
from throwplan.planner.throw import make_manipulator


def point_of(scene: tp.Scene, nlp: ThrowNlp) -> tuple[np.ndarray, np.ndarray]:
    """A realistic decision vector and the scene's parameters."""
    manipulator = make_manipulator(scene)
    sampler = ReleaseSampler(scene, manipulator)
    releases = sampler.draw(6000)
    table = Starts(releases, Task(scene, scene.target), manipulator)
    guess = table.guess(table.nearest[0][0])
    return guess(nlp), nlp.parameter_values(request_of(scene))


@pytest.mark.parametrize(
    ("name", "solver"), [("hand-flip", "fatrop"), ("cup", "fatrop"), ("hand-box", "ipopt")]
)
def test_derivatives_are_those_of_the_whole_composition(name, solver) -> None:
    """CasADi differentiates it at once, without the levels of intermediate values."""
    scene = tp.load_scene(name)
    nlp = nlp_of(scene)
    x, p = point_of(scene, nlp)
    rng, problem = np.random.default_rng(1), nlp.problem
    x, factors = x + 1e-3 * rng.standard_normal(x.size), rng.standard_normal(nlp.size[1])
    whole = ca.Function("whole", [problem["x"], problem["p"]], [problem["f"], problem["g"]])
    at = ca.SX.sym("x", x.size), ca.SX.sym("p", p.size)
    lam = ca.SX.sym("l", nlp.size[1])
    f, g = whole.expand()(*at)
    hessian, slope = ca.hessian(1.3 * f + ca.dot(lam, g), at[0])
    parts = [f, g, ca.gradient(f, at[0]), ca.jacobian(g, at[0]), slope, hessian]
    expected = [v.full() for v in ca.Function("h", [*at, lam], parts)(x, p, factors)]
    found = nlp_functions(nlp, solver)
    jacobian, bend = found["nlp_jac_g"](x, p), found["nlp_hess_l"](x, p, 1.3, factors)
    if solver == "ipopt":
        expected, ours = [np.triu(expected[-1]), expected[3]], [bend, jacobian[1]]
    else:
        gradient = found["nlp_grad"](x, p, 1.3, factors)[2]
        values = found["nlp_f"](x, p), found["nlp_g"](x, p), found["nlp_grad_f"](x, p)
        ours = [*values, jacobian[1], gradient, bend[1]]
        np.testing.assert_allclose(bend[0].full().ravel(), gradient.full().ravel(), atol=1e-9)
    for theirs, mine in zip(expected, ours, strict=True):
        near = 1e-10 * np.abs(theirs).max()
        np.testing.assert_allclose(mine.full().reshape(theirs.shape), theirs, rtol=0, atol=near)


def test_nlps_that_share_functions_are_those_built_alone() -> None:
    """Their stages are partly the same, with parameters at other places."""
    base, shared = request_of(tp.load_scene("cup")), dict[str, object]()
    kinds = [
        (frozenset[str](), frozenset[str](), 0.0),
        (frozenset({"flight"}), frozenset[str](), 0.0),
        (frozenset({"carry"}), frozenset({"hand"}), 0.0),
        (frozenset({"flight"}), frozenset({"flying bar"}), 1.0),
    ]
    rng, least = np.random.default_rng(2), math.inf
    for lazy, bodies, elastic in kinds:
        refinement = Refinement(lazy, bodies=bodies)
        request = dataclasses.replace(base, refinement=refinement, elastic=elastic)
        before = len(shared)
        ours, alone = build_nlp(request, shared), build_nlp(request)
        least = min(least, len(shared) - before)
        assert ours.row_names == alone.row_names and ours.size == alone.size
        x, factors = rng.uniform(0.1, 0.4, ours.size[0]), rng.standard_normal(ours.size[1])
        p = ours.parameter_values(request)
        for name, more in (("nlp_f", ()), ("nlp_jac_g", ()), ("nlp_hess_l", (1.3, factors))):
            each = [nlp_functions(nlp, "fatrop")[name].call([x, p, *more]) for nlp in (ours, alone)]
            for one, other in zip(*each, strict=True):
                np.testing.assert_allclose(one.full(), other.full(), rtol=1e-12, atol=1e-12)
    # A landing that may miss, say, changes the last stage alone.
    assert least <= 2


def test_collocation_lands_where_runge_kutta_does() -> None:
    """Another integrator of the same smooth law, in 4000 steps along the same hand motion."""
    coarse, fine = (collocation_error(tp.load_scene("hand-flip"), opening) for opening in (8, 32))
    assert coarse[0] < 2e-4 and coarse[1] < 2e-3
    assert (fine < coarse / 16).all()


def collocation_error(scene: tp.Scene, opening: int) -> np.ndarray:
    """Error of the landing, x [m] and theta [rad], by `opening` intervals."""
    scene = varied(scene, nlp={"opening": opening, "epsilon": 0.3})
    nlp = nlp_of(scene)
    x, p = point_of(scene, nlp)
    free = [where for block, _, where in nlp.blocks if block.name in ("rel", "acc")]
    slopes = nlp_functions(nlp, "fatrop")["nlp_jac_g"]
    rows = [i for i, row in enumerate(nlp.row_names) if row == "sliding pivot"]
    for link in nlp.links[scene.nlp.carry :]:
        rows += range(link.gap.start, link.gap.stop)
    columns = np.concatenate([np.arange(w.start, w.stop) for w in free])
    for _ in range(40):
        # Newton on the opening's own equations, the hand's motion kept.
        g, slope = slopes(x, p)
        small = slope.full()[np.ix_(rows, columns)]
        step = np.linalg.lstsq(small, -np.array(g).ravel()[rows], rcond=None)[0]
        x[columns] += step
        if np.abs(step).max() < 1e-10:
            break
    landing = np.array(nlp.landing(x, p)).ravel()
    planned, opens = nlp.motion(request_of(scene), x)
    body, pads, grip = scene.body, scene.patch, scene.gripper.profile()
    widths = Widths.relative(scene.nlp.epsilon, body, pads, scene.gravity)
    law = SlidingPivot(body, pads, scene.gravity, widths=widths)
    times = np.linspace(0.0, grip.opening, 8001)
    hand = make_manipulator(scene).hand(planned).at(opens + times)
    motions = [HandMotion(*row) for row in np.array([*vars(hand.motion).values()]).T]
    state = [0.0, 0.0, scene.grasp.angle, 0.0, 0.0, 0.0]
    for k in range(0, 8000, 2):
        forces = grip.force(times[k : k + 3])
        state = rk4_step(law.rates, state, motions[k : k + 3], forces, times[2])
    end = law.com_state(state, hand.pose[:, -1], hand.twist[:, -1], motions[-1])
    x_land, theta, _ = scene.flight.land(np.array(end, float)[None], landing[1])[0]
    return np.abs([landing[0] - x_land, landing[2] - theta])


def test_bounds_come_from_the_limits_less_the_margins() -> None:
    scene = tp.load_scene("pose")
    nlp = nlp_of(scene)
    low, high = nlp.bounds(request_of(scene))
    dq = nlp.block(high, "dq", 3)
    assert dq == pytest.approx(0.99 * np.array([2.175, 2.175, 2.61]))
    assert nlp.block(low, "q", 0) == pytest.approx(np.array([-1.7628, -3.0718, -0.0175]) + 0.01)
    assert nlp.block(low, "T", 0) == pytest.approx(0.05)
    assert nlp.block(high, "dq", 0) is None
    assert (low < high).all()
