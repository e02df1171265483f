"""Fails if a limit surface of another shape is not the plain ellipsoid where it equals one, or if
friction leaves it while the bar slips."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from release_cases import VALUES, order_of, reference_case
from throwplan.models import SurfaceShape
from throwplan.models.release import ShapedRelease, SteppedRelease
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


@pytest.mark.parametrize("name", ["drop_h020_faces1", "throw_decelerating"])
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


def test_an_ellipsoid_with_other_axes_is_a_plain_one_of_another_contact() -> None:
    """Twice the friction is A = 1/4; a larger torsion alone is a smaller A_33."""
    plain = reference_case("throw_decelerating")
    shape = SurfaceShape.of("ellipsoid", (0.25, 0.25, 0.25 / 1.5**2, 0.0, 0.0, 0.0))
    own = plain.contact
    wider = replace(own, friction=2 * own.friction, torsion=1.5 * own.torsion)
    found = ShapedRelease(shape, 200).release(plain).end
    other = SteppedRelease(200).release(replace(plain, contact=wider)).end
    np.testing.assert_allclose(found, other, atol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", ["drop_h020_faces1", "throw_decelerating"])
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


@pytest.mark.parametrize("shape", ["tilted", "flat"])
@pytest.mark.parametrize("name", ["throw_decelerating"])
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
    ("kind", "numbers"),
    [
        ("ellipsoid", (1.0,) * 5),
        ("ellipsoid", (1.0, 1.0, 1.0, 2.0, 0.0, 0.0)),
        ("quartic", (1.0, 0, 0, 9.0, 0, 2.0, 0, 0, 0, 0, 1.0, 0, 2.0, 0, 1.0)),
    ],
)
def test_what_is_no_convex_surface_is_refused(kind, numbers) -> None:
    with pytest.raises(ValueError):
        SurfaceShape.of(kind, numbers)
