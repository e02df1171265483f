"""The NLP: derivatives, FATROP's block form, consistency with the exact model, sizes."""

from __future__ import annotations

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.mover import make_mover
from throwplan.planner.nlp import ThrowNlp, build_nlp
from throwplan.planner.numbers import bounds, parameter_values, structure_of
from throwplan.planner.releases import ReleaseSampler, guess_from, nearest

#: (variables, constraints) of the built-in scenes: what a scene does not need is not there.
SIZES = {
    "hand-box": (171, 205),
    "hand-flip": (251, 287),
    "box": (311, 461),
    "flip": (311, 462),
    "pose": (314, 462),
    "cup": (315, 482),
}


def nlp_of(scene: tp.Scene) -> ThrowNlp:
    mover = make_mover(scene)
    assert scene.target is not None
    return build_nlp(structure_of(scene, mover, scene.target.theta is not None), mover)


def point_of(scene: tp.Scene, nlp: ThrowNlp) -> tuple[np.ndarray, np.ndarray]:
    """A realistic decision vector and the scene's parameters."""
    mover = make_mover(scene)
    sampler = ReleaseSampler(scene, mover)
    releases = sampler.draw(6000)
    target = scene.target
    index = nearest(releases, scene, target.x, target.z, target.theta, 1)[0][0]
    x = guess_from(nlp, sampler, releases, int(index), target.z)
    return x, nlp.parameters.vector(parameter_values(scene, mover, target))


@pytest.mark.parametrize("name", SIZES)
def test_sizes(name: str) -> None:
    assert nlp_of(tp.load_scene(name)).size == SIZES[name]


def test_what_each_section_costs() -> None:
    """Leaving a section out takes its variables, constraints and parameters away."""
    cup = tp.load_scene("cup")
    full = nlp_of(cup)
    no_cup = nlp_of(cup.replace(cup=None))
    assert full.size[0] - no_cup.size[0] == 4
    assert full.size[1] - no_cup.size[1] == 4 * 5
    assert {"cup_x", "cup_rim", "lower_end"} <= set(full.parameters.blocks)
    assert not [name for name in no_cup.parameters.blocks if name.startswith("cup")]
    bare = nlp_of(cup.replace(cup=None, workspace=None))
    assert not {"floor", "column_radius", "ahead"} & set(bare.parameters.blocks)
    assert bare.size[0] == no_cup.size[0] and bare.size[1] < no_cup.size[1]
    free = nlp_of(cup.replace(cup=None, target=tp.Pose(x=0.9, z=0.2)))
    assert no_cup.size[1] - free.size[1] == 1
    assert not [name for name in full.parameters.blocks if name.startswith("palm")]


def test_com_grasp_with_open_angle_has_no_pivot_states() -> None:
    scene = tp.load_scene("hand-box")
    held_off_centre = scene.replace(grasp=dataclasses.replace(scene.grasp, offset=0.05))
    opening = scene.mesh.opening
    assert nlp_of(held_off_centre).size[0] - nlp_of(scene).size[0] == 2 * opening


@pytest.mark.parametrize("name", ["hand-flip", "cup"])
def test_derivatives_agree_with_differences(name: str) -> None:
    scene = tp.load_scene(name)
    nlp = nlp_of(scene)
    x, p = point_of(scene, nlp)
    problem = nlp.problem
    values = ca.vertcat(problem["f"], problem["g"])
    function = ca.Function("v", [problem["x"], problem["p"]], [values])
    jacobian = ca.Function("j", [problem["x"], problem["p"]], [ca.jacobian(values, problem["x"])])
    derivative = np.array(jacobian(x, p))
    assert np.isfinite(derivative).all()
    rng = np.random.default_rng(1)
    for _ in range(3):
        direction = rng.standard_normal(x.size)
        step = 1e-6
        ahead, behind = (np.array(function(x + s * direction, p)).ravel() for s in (step, -step))
        differences = (ahead - behind) / (2 * step)
        exact = derivative @ direction
        assert np.abs(differences - exact).max() <= 1e-5 * (1 + np.abs(exact).max())


@pytest.mark.parametrize("name", ["hand-box", "cup"])
def test_block_form_that_fatrop_relies_on(name: str) -> None:
    """Gap rows are X_{k+1} - F(X_k, U_k); rows of a stage see that stage only; the
    Lagrangian's Hessian has no entry across stages."""
    nlp = nlp_of(tp.load_scene(name))
    x, g = nlp.problem["x"], nlp.problem["g"]
    stage_of = np.repeat(np.arange(len(nlp.nx)), np.array(nlp.nx) + np.array(nlp.nu))
    pattern = ca.DM(ca.jacobian_sparsity(g, x), 1)
    rows, cols = (np.array(v) for v in pattern.sparsity().get_triplet())
    values = ca.Function("j", [x, nlp.problem["p"]], [ca.jacobian(g, x)])
    numbers = ca.DM(values(0.1, 1.0)).full()
    at, offset = 0, 0
    for k, (nx, nu, ng) in enumerate(zip(nlp.nx, nlp.nu, nlp.ng, strict=True)):
        offset += nx + nu
        gaps = nlp.nx[k + 1] if k + 1 < len(nlp.nx) else 0
        for i in range(gaps):
            columns = cols[rows == at + i]
            assert set(stage_of[columns]) <= {k, k + 1}
            ahead = columns[stage_of[columns] == k + 1]
            assert list(ahead) == [offset + i] and numbers[at + i, offset + i] == 1.0
        for i in range(gaps, gaps + ng):
            assert set(stage_of[cols[rows == at + i]]) <= {k}
        at += gaps + ng
    assert at == g.numel()
    multipliers = ca.SX.sym("l", g.numel())
    hessian = ca.hessian(nlp.problem["f"] + ca.dot(multipliers, g), x)[0]
    i, j = (np.array(v) for v in hessian.sparsity().get_triplet())
    assert (stage_of[i] == stage_of[j]).all()


def model_error(epsilon: float) -> tuple[float, float]:
    """Landing of the smoothed model in the NLP against the exact one: x [m], theta."""
    scene = tp.load_scene("hand-flip")
    mesh = dataclasses.replace(scene.mesh, epsilon=epsilon, opening=20, substeps=6)
    throw = tp.plan(scene.replace(mesh=mesh)).throw
    assert throw is not None
    planned, exact = throw.planned_landing, throw.exact.landing
    return abs(planned[0] - exact.x), abs(planned[2] - exact.theta)


def test_nlp_lands_where_the_exact_model_does_as_the_rounding_goes() -> None:
    """Two implementations: shooting with the rounded law, and stepping with the sharp one."""
    for epsilon, position, degrees in ((0.03, 3e-4, 0.3), (0.01, 5e-5, 0.03)):
        x_error, theta_error = model_error(epsilon)
        assert x_error <= position
        assert math.degrees(theta_error) <= degrees


def test_bounds_come_from_the_limits_less_the_margins() -> None:
    scene = tp.load_scene("pose")
    mover, nlp = make_mover(scene), nlp_of(scene)
    low, high = bounds(nlp, scene, mover)
    dq = nlp.block(high, "dq", 3)
    assert dq == pytest.approx(0.99 * np.array([2.175, 2.175, 2.61]))
    assert nlp.block(low, "q", 0) == pytest.approx(np.array([-1.7628, -3.0718, -0.0175]) + 0.01)
    assert nlp.block(low, "T", 0) == pytest.approx(0.05)
    assert nlp.block(high, "dq", 0) is None
    assert (low < high).all()


def test_position_limits_hold_between_nodes() -> None:
    """A start near a limit with few, long intervals: the whole curve stays inside."""
    scene = tp.load_scene("pose")
    mesh = dataclasses.replace(scene.mesh, carry=3)
    plan = tp.plan(scene.replace(mesh=mesh))
    assert plan.solved and plan.throw is not None
    limits = plan.mover.planning
    times = np.linspace(0, plan.throw.opening_time, 2000)
    q, dq, ddq = plan.throw.planned.at(times)
    assert (limits.q_min - 1e-9 <= q.T).all() and (limits.q_max + 1e-9 >= q.T).all()
    assert (np.abs(dq.T) <= limits.dq + 1e-9).all()
    assert (np.abs(ddq.T) <= limits.ddq + 1e-9).all()


def test_guess_lands_near_its_own_release() -> None:
    """Table, guess and NLP agree: the guess's gaps and landing are nearly closed."""
    scene = tp.load_scene("pose")
    nlp = nlp_of(scene)
    x, p = point_of(scene, nlp)
    names = np.array(nlp.row_names)
    function = ca.Function("g", [nlp.problem["x"], nlp.problem["p"]], [nlp.problem["g"]])
    g = np.array(function(x, p)).ravel()
    opening_gaps = [f"gap {k}" for k in range(scene.mesh.carry + 1, len(nlp.nx) - 1)]
    assert np.abs(g[np.isin(names, opening_gaps)]).max() < 0.05
    landed = np.array(nlp.landing(x, p)).ravel()
    assert landed[1] == pytest.approx(scene.target.z, abs=0.01)
    assert landed[0] == pytest.approx(scene.target.x, abs=0.1)
    assert landed[2] == pytest.approx(scene.target.theta, abs=math.radians(20))
