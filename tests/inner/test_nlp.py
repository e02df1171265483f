"""The NLP: derivatives, FATROP's block form, consistency with the exact model, sizes."""

from __future__ import annotations

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.ocp import Request, ThrowNlp, build_nlp, nlp_functions
from throwplan.planner.search import guess_from
from throwplan.planner.search.samples import ReleaseSampler, starts
from throwplan.planner.throw import make_manipulator

#: (variables, constraints) of the built-in scenes: what a scene does not need is not there.
SIZES = {
    "hand-box": (127, 149),
    "hand-flip": (187, 211),
    "box": (223, 357),
    "flip": (223, 358),
    "pose": (226, 358),
    "cup": (228, 380),
}


def request_of(scene: tp.Scene) -> Request:
    return Request(scene, make_manipulator(scene), scene.target)


def nlp_of(scene: tp.Scene) -> ThrowNlp:
    return build_nlp(request_of(scene))


def point_of(scene: tp.Scene, nlp: ThrowNlp) -> tuple[np.ndarray, np.ndarray]:
    """A realistic decision vector and the scene's parameters."""
    manipulator = make_manipulator(scene)
    sampler = ReleaseSampler(scene, manipulator)
    releases = sampler.draw(6000)
    target = scene.target
    index = starts(releases, scene, target, "exact", 1)[0][0]
    flight = releases.flight_time(index, target.z, scene.flight)
    x = guess_from(nlp, scene, manipulator, releases, int(index), flight)
    return x, nlp.parameter_values(request_of(scene))


@pytest.mark.parametrize("name", SIZES)
def test_sizes(name: str) -> None:
    assert nlp_of(tp.load_scene(name)).size == SIZES[name]


@pytest.mark.parametrize("integrator", ["gauss", "rk4"])
@pytest.mark.parametrize("name", ["hand-flip", "hand-box", "cup"])
def test_derivatives_agree_with_differences(name: str, integrator: str) -> None:
    """First and second, through all the levels of intermediate values."""
    scene = tp.load_scene(name)
    scene = scene.replace(mesh=dataclasses.replace(scene.mesh, integrator=integrator))
    nlp = nlp_of(scene)
    x, p = point_of(scene, nlp)
    rng = np.random.default_rng(1)
    x, lam = x + 1e-3 * rng.standard_normal(x.size), rng.standard_normal(nlp.size[1])
    found = nlp_functions(nlp, "fatrop")

    def g(at: np.ndarray) -> np.ndarray:
        return np.append(np.array(found["nlp_g"](at, p)), float(found["nlp_f"](at, p)))

    def gradient(at: np.ndarray) -> np.ndarray:
        return np.array(found["nlp_grad"](at, p, 1.3, lam)[2]).ravel()

    slope = np.vstack([found["nlp_jac_g"](x, p)[1].full(), found["nlp_grad_f"](x, p).full().T])
    total, curvature = (part.full() for part in found["nlp_hess_l"](x, p, 1.3, lam))
    assert np.array_equal(curvature, curvature.T)
    assert gradient(x) == pytest.approx(slope.T @ np.append(lam, 1.3), abs=1e-9, rel=1e-9)
    assert gradient(x) == pytest.approx(total.ravel(), abs=1e-9, rel=1e-9)
    for _ in range(3):
        direction = rng.standard_normal(x.size)
        for function, exact in ((g, slope @ direction), (gradient, curvature @ direction)):
            # Fourth order: the rounded law bends sharply near sticking.
            near, far = (
                (function(x + step * direction) - function(x - step * direction)) / (2 * step)
                for step in (2e-7, 4e-7)
            )
            differences = (4 * near - far) / 3
            assert np.abs(differences - exact).max() <= 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("name", ["hand-box", "cup"])
def test_derivatives_agree_with_the_solver_plugins_own(name: str) -> None:
    """CasADi differentiates the whole composition at once and finds the same."""
    scene = tp.load_scene(name)
    nlp = nlp_of(scene)
    x, p = point_of(scene, nlp)
    problem = nlp.problem
    inputs = [problem["x"], problem["p"]]
    whole = ca.Function("whole", inputs, [problem["f"], problem["g"]]).expand()
    sx = [ca.SX.sym("x", x.size), ca.SX.sym("p", p.size)]
    lam = ca.SX.sym("l", nlp.size[1])
    f, g = whole(*sx)
    hessian = ca.triu(ca.hessian(f + ca.dot(lam, g), sx[0])[0])
    expected = ca.Function("h", [*sx, lam], [hessian, ca.jacobian(g, sx[0])])
    values = np.random.default_rng(2).standard_normal(nlp.size[1])
    found = nlp_functions(nlp, "ipopt")
    ours = found["nlp_hess_l"](x, p, 1.0, values), found["nlp_jac_g"](x, p)[1]
    for theirs, mine in zip(expected(x, p, values), ours, strict=True):
        scale = np.abs(theirs.full()).max()
        assert np.abs(theirs.full() - mine.full()).max() <= 1e-10 * scale


@pytest.mark.parametrize("name", ["hand-box", "cup"])
def test_block_form_that_fatrop_relies_on(name: str) -> None:
    """Gap rows are X_{k+1} - F(X_k, U_k); rows of a stage see that stage only; the
    Lagrangian's Hessian has no entry across stages."""
    nlp = nlp_of(tp.load_scene(name))
    states, controls, rows_of = nlp.sizes
    stage_of = np.repeat(np.arange(len(states)), np.add(states, controls))
    found = nlp_functions(nlp, "fatrop")
    x, p = 0.1 * np.ones(nlp.size[0]), np.ones(nlp.problem["p"].numel())
    jacobian = found["nlp_jac_g"](x, p)[1]
    rows, cols = (np.array(v) for v in jacobian.sparsity().get_triplet())
    numbers = jacobian.full()
    at, offset = 0, 0
    for k, (nx, nu, ng) in enumerate(zip(states, controls, rows_of, strict=True)):
        offset += nx + nu
        gaps = states[k + 1] if k + 1 < len(states) else 0
        for i in range(gaps):
            columns = cols[rows == at + i]
            assert set(stage_of[columns]) <= {k, k + 1}
            ahead = columns[stage_of[columns] == k + 1]
            assert list(ahead) == [offset + i] and numbers[at + i, offset + i] == 1.0
        for i in range(gaps, gaps + ng):
            assert set(stage_of[cols[rows == at + i]]) <= {k}
        at += gaps + ng
    assert at == nlp.size[1]
    hessian = found["nlp_hess_l"](x, p, 1.0, np.ones(nlp.size[1]))[1]
    i, j = (np.array(v) for v in hessian.sparsity().get_triplet())
    assert (stage_of[i] == stage_of[j]).all()


def model_error(epsilon: float) -> tuple[float, float]:
    """Landing of the smoothed model in the NLP against the exact one: x [m], theta."""
    scene = tp.load_scene("hand-flip")
    mesh = dataclasses.replace(
        scene.mesh, epsilon=epsilon, integrator="rk4", opening=20, substeps=6, grading=1.0
    )
    throw = tp.Planner(scene.replace(mesh=mesh)).plan(patience=90.0).throw
    assert throw is not None
    planned, exact = throw.planned_landing, throw.exact.landing
    return abs(planned[0] - exact.x), abs(planned[2] - exact.theta)


@pytest.mark.slow
def test_nlp_lands_where_the_exact_model_does_as_the_rounding_goes() -> None:
    """Two implementations: shooting with the rounded law, and stepping with the sharp one."""
    for epsilon, position, degrees in ((0.03, 3e-4, 0.3), (0.01, 5e-5, 0.03)):
        x_error, theta_error = model_error(epsilon)
        assert x_error <= position
        assert math.degrees(theta_error) <= degrees


@pytest.mark.parametrize("name", ["hand-flip", pytest.param("pose", marks=pytest.mark.slow)])
def test_collocation_lands_where_runge_kutta_does(name: str) -> None:
    """Two integrators of the same smooth law, along the same hand motion."""
    scene = tp.load_scene(name)
    landings = []
    for integrator, opening in (("gauss", 12), ("rk4", 12)):
        mesh = dataclasses.replace(
            scene.mesh, integrator=integrator, opening=opening, substeps=12, epsilon=0.3
        )
        variant = scene.replace(mesh=mesh)
        nlp = nlp_of(variant)
        x, p = point_of(variant, nlp)
        free = [where for block, _, where in nlp.layout if block.name in ("rel", "acc")]
        slopes = ca.Function(
            "slopes",
            [nlp.problem["x"], nlp.problem["p"]],
            [nlp.problem["g"], ca.jacobian(nlp.problem["g"], nlp.problem["x"])],
        )
        rows = [i for i, row in enumerate(nlp.row_names) if row == "sliding pivot"]
        for link in nlp.links[scene.mesh.carry :]:
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
        landings.append(np.array(nlp.landing(x, p)).ravel())
    one, other = landings
    assert one[0] == pytest.approx(other[0], abs=2e-4)
    assert one[2] == pytest.approx(other[2], abs=2e-3)


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


def test_position_limits_hold_between_nodes() -> None:
    """A start near a limit with few, long intervals: the whole curve stays inside."""
    scene = tp.load_scene("pose")
    mesh = dataclasses.replace(scene.mesh, carry=3)
    plan = tp.plan(scene.replace(mesh=mesh))
    assert plan.solved and plan.throw is not None
    limits = plan.manipulator.planning
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
    function = ca.Function("g", [nlp.problem["x"], nlp.problem["p"]], [nlp.problem["g"]])
    g = np.array(function(x, p)).ravel()
    opening = nlp.links[scene.mesh.carry + 1 : -1]
    assert max(np.abs(g[link.gap]).max() for link in opening) < 0.05
    landed = np.array(nlp.landing(x, p)).ravel()
    assert landed[1] == pytest.approx(scene.target.z, abs=0.01)
    assert landed[0] == pytest.approx(scene.target.x, abs=0.1)
    assert landed[2] == pytest.approx(scene.target.theta, abs=math.radians(20))
