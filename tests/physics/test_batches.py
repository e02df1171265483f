"""Fails if throws of a batch (in the C core) land elsewhere than the models have them one by one,
or if extreme numbers give a NaN."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from release_cases import (
    VALUES,
    Values,
    extremes,
    order_of,
    reference_case,
    reference_values,
    single,
)
from throwplan.models import Body, FlightLaw, PinchContact, Trajectory, write_core_laws
from throwplan.models.release import (
    LinearGrip,
    ReleaseCase,
    SlidingPivotRelease,
    SteppedRelease,
    exact_pivot_release,
)
from throwplan.models.release.patch import PatchRelease
from throwplan.planner.throw import case_of

from benchmarks.plain_pivot import PlainPivot

DROP = tp.load_scene("drop")


def throws(count: int, seed: int = 0) -> Values:
    """Throws of bars of all sizes by a moving hand."""
    rng = np.random.default_rng(seed)
    mass = rng.uniform(0.1, 0.4, count)
    speed, up = rng.uniform(1, 3, count), rng.uniform(0, 1.2, count)
    spin = rng.uniform(-4, 4, count)
    return {
        "mass": mass,
        "inertia": mass * rng.uniform(0.03, 0.07, count) ** 2,
        "com_offset": rng.uniform(0.02, 0.2, count),
        "friction": rng.uniform(0.3, 1.0, count),
        "patch_radius": rng.uniform(0.0025, 0.01, count),
        "force": np.full(count, 100.0),
        "opening": rng.uniform(0.03, 0.1, count),
        "hand": {
            "pose": np.column_stack([np.zeros((count, 2)), rng.uniform(-1.5, 1.0, count)]),
            "twist": np.column_stack([speed * np.cos(up), speed * np.sin(up), spin]),
            "acceleration": rng.uniform(-1, 1, (count, 3)) * [10, 10, 20],
        },
    }


def landing(detach: np.ndarray) -> np.ndarray:
    return FlightLaw(9.81).land(detach, -0.9)


@pytest.mark.parametrize(
    ("model", "exact", "position", "angle"),
    [
        ("sp", PlainPivot(), 1e-4, 0.1),
        ("sp-paper", PlainPivot("paper", steps=2000), 1e-3, 0.2),
        ("ls-step", SteppedRelease(4000), 1e-3, 0.5),
    ],
)
def test_a_batch_lands_where_the_single_models_do(model, exact, position, angle) -> None:
    values = throws(5)
    batch = landing(tp.simulate_batch(DROP, model, **values).detach)
    for i in range(5):
        one = landing(exact.release(single(values, i)).end[None])[0]
        assert batch[i, 0] == pytest.approx(one[0], abs=position)
        assert batch[i, 1] == pytest.approx(one[1], abs=np.radians(angle))


@pytest.mark.parametrize("delayed", [False, True])
@pytest.mark.parametrize(
    ("model", "exact"), [("sp", SlidingPivotRelease(steps=200)), ("ls-step", SteppedRelease(4000))]
)
def test_sampled_hands_throw_as_each_by_itself(model, exact, delayed: bool) -> None:
    """Hands through samples of their own, and one hand that opens at other times."""
    rng, t, count = np.random.default_rng(0), np.linspace(-0.01, 0.15, 60), 3
    poses = np.column_stack([1.5 * t, 0.8 * t - t**2, 0.4 + 3.0 * t])[None]
    hand = {"times": t, "poses": poses + rng.uniform(-5, 5, (count, 1, 3)) * t[:, None] ** 2}
    delays = np.zeros(count)
    if delayed:
        hand, delays = {"times": t, "poses": poses}, rng.uniform(-0.009, 0.04, count)
    found = landing(tp.simulate_batch(DROP, model, hand=hand, delays=delays).detach)
    for i in range(count):
        own = poses[0] if delayed else hand["poses"][i]
        path = Trajectory.through(t, own).shifted(delays[i])
        case = case_of(DROP, path)
        one = landing(exact.release(case).end[None])[0]
        assert found[i, 0] == pytest.approx(one[0], abs=1e-3)
        assert found[i, 1] == pytest.approx(one[1], abs=np.radians(0.5))


def test_the_core_holds_the_laws_of_today() -> None:
    """`python -m throwplan.models.write_core_laws` has nothing to write."""
    written = Path(__file__).parents[2] / "core" / "laws.h"
    assert written.read_text(encoding="utf-8") == write_core_laws.text()


@pytest.mark.parametrize(("model", "stiffness"), [("patch", None), ("lugre", 1e7)])
def test_a_meshed_batch_is_its_cases_one_by_one(model, stiffness) -> None:
    found = tp.simulate_batch(DROP, model, steps=100, **reference_values()).detach
    for row, case in zip(found, VALUES, strict=True):
        release = PatchRelease(steps=100, stiffness=stiffness).release(reference_case(case))
        one = release.end
        np.testing.assert_allclose(row, one, rtol=1e-7, atol=1e-8)


def test_meshed_stepping_is_first_order() -> None:
    grids, values = (40, 80, 160, 320), reference_values()
    at = {
        n: tp.simulate_batch(DROP, "patch", steps=n, **values).detach for n in (*grids, 640, 1280)
    }
    exact = 2 * at[1280] - at[640]
    scale = np.array([1.0, 1.0, 0.1, 1.0, 1.0, 0.1])
    found = [np.linalg.norm((at[n] - exact) * scale, axis=1) for n in grids]
    assert np.median(order_of(grids, found)) == pytest.approx(1.0, abs=0.3)


def test_workers_and_chunks_do_not_change_a_digit() -> None:
    values = throws(5000)
    alone = tp.simulate_batch(DROP, **values).detach
    with ThreadPoolExecutor(2) as threads:
        spread = tp.simulate_batch(DROP, **values, executor=threads).detach
    assert np.array_equal(spread, alone)


def test_numbers_stand_for_the_scene_and_landing_is_given_at_its_height() -> None:
    scene = DROP.replace(target=tp.Pose(x=0.0, z=-1.0))
    result = tp.simulate_batch(scene, friction=np.array([0.4, 0.8, 1.6]))
    assert result.detach.shape == (3, 6)
    plain = tp.simulate(scene, "sp")["sp"].to_dict()
    assert result.detach[1, 5] == pytest.approx(plain["detach"]["omega"], rel=3e-4)
    assert result.landing[1, 0] == pytest.approx(plain["landing"]["x"], abs=1e-5)
    # More friction holds the bar longer: it leaves with a smaller rate.
    assert (np.diff(np.abs(result.detach[:, 5])) < 0).all()


def test_trouble_is_what_the_single_model_says() -> None:
    """A heavy bar in a slippery grip slides out of the pads; a light one is held."""
    values = throws(24, seed=3)
    values["mass"][::2] *= 20.0
    values["inertia"][::2] *= 20.0
    values["friction"][::4] = 0.02
    values["opening"][::4] = 0.3
    result = tp.simulate_batch(DROP, **values)
    alone = [PlainPivot().release(single(values, i)).trouble for i in range(24)]
    assert list(result.trouble) == alone
    assert 0 < (result.trouble == "").sum() < 24
    assert (tp.simulate_batch(DROP, "ls-step", **values).trouble == "").all()


@pytest.mark.parametrize(("model", "steps"), [("sp", 48), ("ls-step", 30), ("patch", 20)])
def test_extreme_throws_have_no_nan(model, steps) -> None:
    for gravity in (9.81, 0.0):
        values = extremes(50 if model == "patch" else 300, 1)
        found = tp.simulate_batch(DROP.replace(gravity=gravity), model, steps=steps, **values)
        assert np.isfinite(found.detach).all()


def test_a_body_that_slides_out_of_the_pads_is_reported() -> None:
    case = ReleaseCase(
        Body(5.0, 0.01, 0.05),
        PinchContact(0.05, 0.001, 0.6, 2),
        LinearGrip(1.0, 0.0, 1.0),
        Trajectory.accelerating((0.0, 0.0, 0.0)),
    )
    release = PlainPivot().release(case)
    assert "slid out" in release.trouble and "slid out" in exact_pivot_release(case).trouble
    # From then on it falls freely.
    late = release.times > 0.5
    fall = np.gradient(release.com_twist[1, late], release.times[late])
    assert fall == pytest.approx(np.full(fall.size, -9.81), rel=1e-3)
