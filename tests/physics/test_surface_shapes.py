"""Limit surfaces of other shapes: where they are the plain ellipsoid, and dry friction's laws."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from release_cases import VALUES, order_of, reference_case
from scipy.optimize import minimize
from throwplan.models import HandSamples, SurfaceShape
from throwplan.models.release import ShapedRelease, SteppedRelease
from throwplan.models.release.limit_surface import LimitSurfaceStepping
from throwplan.models.surface import EXPONENTS

SPHERE = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
#: (x^2 + y^2 + t^2)^2.
ROUND = tuple(
    {(4,): 1.0, (2, 2): 2.0}.get(tuple(sorted((n for n in e if n), reverse=True)), 0.0)
    for e in EXPONENTS
)
#: x^4 + y^4 + t^4: flat at its axes, where its Hessian is singular.
FLAT = tuple(float(max(e) == 4) for e in EXPONENTS)
TILTED = (1.0, 1.2, 1.1, 0.1, 0.4, -0.3)
SHAPES = {
    "tilted": SurfaceShape.of("ellipsoid", TILTED),
    "flat": SurfaceShape.of("quartic", FLAT),
    "points": SurfaceShape.of("two-points", ()),
}


@pytest.mark.parametrize("name", VALUES)
@pytest.mark.parametrize("kind", ["ellipsoid", "quartic"])
def test_the_sphere_of_each_kind_is_the_plain_ellipsoid(name: str, kind: str) -> None:
    shape = SurfaceShape.of(kind, SPHERE if kind == "ellipsoid" else ROUND)
    case = reference_case(name)
    found, plain = (
        model.release(case) for model in (ShapedRelease(shape, 200), SteppedRelease(200))
    )
    np.testing.assert_allclose(found.com, plain.com, atol=1e-9)
    np.testing.assert_allclose(found.com_twist, plain.com_twist, atol=1e-9)
    assert (found.pivot, found.slide) == pytest.approx((plain.pivot, plain.slide), abs=1e-12)


@pytest.mark.parametrize("name", VALUES)
def test_an_ellipsoid_with_other_axes_is_a_plain_one_of_another_contact(name: str) -> None:
    """Twice the friction is A = 1/4; a larger torsion alone is a smaller A_33."""
    plain = reference_case(name)
    shape = SurfaceShape.of("ellipsoid", (0.25, 0.25, 0.25 / 1.5**2, 0.0, 0.0, 0.0))
    wider = replace(
        plain.contact, friction=2 * plain.contact.friction, torsion=1.5 * plain.contact.torsion
    )
    found = ShapedRelease(shape, 200).release(plain).end
    other = SteppedRelease(200).release(replace(plain, contact=wider)).end
    np.testing.assert_allclose(found, other, atol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", VALUES)
def test_friction_is_on_the_surface_while_the_bar_slips(name: str, shape: str) -> None:
    case = reference_case(name)
    found = ShapedRelease(SHAPES[shape], 400).release(case)
    assert found.wrench is not None
    middle = (found.times[1:] + found.times[:-1]) / 2
    angle = (case.hand.at(found.times).pose[2][1:] + case.hand.at(found.times).pose[2][:-1]) / 2
    force = case.grip.force(middle)
    used = SHAPES[shape].use(case.contact, found.wrench[:, 1:], force, angle)
    assert used.max() < 1 + 1e-3  # the wrench is from differences of the motion
    onset = min(time for time in (found.pivot, found.slide) if time is not None)
    late = (middle > onset + 0.2 * (case.grip.opening - onset)) & (force > 0.05 * case.grip.full)
    assert used[late].min(initial=1.0) > 0.98


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", VALUES)
def test_steps_are_those_of_a_general_minimiser(name: str, shape: str) -> None:
    """The impulse of largest dissipation by sequential quadratic programming, from the laws' own
    problem, over some large steps."""
    case, gauge = reference_case(name), SHAPES[shape].gauge
    law = LimitSurfaceStepping(case.body, case.contact, turned=True)
    steps, state = 12, case.start()
    run = ShapedRelease(SHAPES[shape], steps).release(case)
    for k, (begin, end) in enumerate(itertools.pairwise(np.linspace(0, case.grip.opening, 13))):
        tracks = (case.hand.at(np.array([t])) for t in (begin, end))
        hands = [HandSamples(0.0, *(rows[:, 0] for rows in track)) for track in tracks]
        lever, grip = law.lever(state, hands, end - begin), case.grip.force((begin + end) / 2)
        problem = law.problem(state, hands, lever, float(grip), end - begin)
        xx, zz, tt, xz, xt, zt = (float(value) for value in problem.matrix)
        matrix = np.array([[xx, xz, xt], [xz, zz, zt], [xt, zt, tt]])
        rhs, radius = np.array(problem.rhs, float), float(problem.radius)
        y = np.linalg.solve(matrix, rhs)
        if gauge(y) > radius:
            scale, size = np.sqrt(np.diag(matrix)), radius

            def cost(w, matrix=matrix, rhs=rhs, size=size):
                return (w @ matrix @ w / 2 - rhs @ w / size) / np.abs(rhs).max() * size

            limit = {"type": "ineq", "fun": lambda w: 1.0 - gauge(w)}
            best = min(
                (
                    minimize(
                        cost, start, constraints=limit, options={"ftol": 1e-15, "maxiter": 500}
                    )
                    for start in (y / gauge(y), 0.5 * rhs / scale / np.linalg.norm(rhs / scale))
                ),
                key=lambda found: found.fun,
            )
            y = radius * best.x
        state = np.array(law.after(state, hands, lever, y, end - begin))
        found = np.concatenate([run.com[:, k + 1], run.com_twist[:, k + 1]])
        scale = np.array([1, 1, 0.1, 1, 1, 0.1])
        np.testing.assert_allclose(state * scale, found * scale, atol=5e-5)
        state = found


@pytest.mark.parametrize("shape", ["tilted", "flat"])
@pytest.mark.parametrize("name", ["drop_h100_faces2", "throw_decelerating"])
def test_stepping_is_first_order_on_every_shape(name: str, shape: str) -> None:
    case, grids = reference_case(name), np.array([100, 200, 400])
    at = {n: ShapedRelease(SHAPES[shape], int(n)).release(case).end for n in (*grids, 800, 1600)}
    exact, h = 2 * at[1600] - at[800], case.body.com_offset
    scale = np.array([1, 1, h, 1, 1, h])
    errors = [np.linalg.norm((at[n] - exact) * scale) for n in grids]
    assert order_of(grids, errors) == pytest.approx(1.0, abs=0.3)


def test_a_surface_turns_with_the_hand() -> None:
    """A drop turned by 90 degrees, gravity aside: the body's motion turns with it."""
    case, model = reference_case(next(iter(VALUES))), ShapedRelease(SHAPES["tilted"], 300)
    ends = []
    for angle in (0.0, 0.5 * math.pi):
        cos, sin = math.cos(angle), math.sin(angle)
        pull = np.array([-sin * 9.81, cos * 9.81, 0.0])
        path = type(case.hand).accelerating((0, 0, angle), (0, 0, 0), pull)
        end = model.release(replace(case, hand=path, gravity=0.0)).end
        turn = np.array([[cos, sin], [-sin, cos]])
        ends.append([*(turn @ end[:2]), end[2] - angle, *(turn @ end[3:5]), end[5]])
    np.testing.assert_allclose(*ends, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "numbers", "words"),
    [
        ("ellipsoid", (1.0,) * 5, "6 numbers, not 5"),
        ("ellipsoid", (1.0, 1.0, 1.0, 2.0, 0.0, 0.0), "not bounded|not convex"),
        ("quartic", (-1.0, *ROUND[1:]), "not bounded"),
        ("quartic", (1.0, 0, 0, 9.0, 0, 2.0, 0, 0, 0, 0, 1.0, 0, 2.0, 0, 1.0), "not convex"),
        ("two-points", (1.0,), "0 numbers, not 1"),
    ],
)
def test_what_is_no_convex_surface_is_refused(kind, numbers, words) -> None:
    with pytest.raises(ValueError, match=words):
        SurfaceShape.of(kind, numbers)
