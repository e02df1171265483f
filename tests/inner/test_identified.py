"""Fails if identification misses the true contact or its uncertainty, or if a fitted contact does
not come back from a scene."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import numpy.typing as npt
import pytest
import throwplan as tp
from builders import MADE_PRODUCT, made_throws
from throwplan import load_scene, scene_text
from throwplan.lab import (
    Belief,
    Predictor,
    applied,
    compare,
    contact_text,
    identify,
    left_out,
    measured,
    parameter_sets,
    prior_of,
    thrown,
)
from throwplan.lab.throws import MeasuredThrow, Shared, ThrowData
from throwplan.models.release import TableGrip
from throwplan.problems import Distribution, Grasp, InputError, Object, Uncertainty

Array = npt.NDArray[np.float64]

MU, RADIUS, LATE = 0.8, 0.004, 0.006
NOISE = (0.002, 0.01)
BARS = (Object(0.24, 0.26, 0.10, 535e-6), Object(0.24, 0.26, 0.16, 802e-6))


def made(
    count: int,
    model: str = "sp",
    delay: float = 0.0,
    alike: bool = False,
    noise: tuple[float, float] = NOISE,
) -> ThrowData:
    """Synthetic throws of a free hand, with noise on the landings."""
    rng = np.random.default_rng(7)
    grip = TableGrip([0.0, 0.05, 0.10], [120.0, 120.0, 0.0])
    times = np.arange(-0.12, 0.16, 0.001)
    throws = []
    for number in range(count):
        draw = np.random.default_rng(1) if alike else rng
        twist = draw.uniform([1.0, 1.0, -2.0], [2.0, 2.0, 4.0])
        pull = draw.uniform([-6.0, -8.0, -40.0], [6.0, 4.0, 40.0])
        pose = np.array([0.0, 0.9, draw.uniform(-1.5, 0.2)])
        path = pose + times[:, None] * twist + times[:, None] ** 2 * pull / 2
        bar, factors = BARS[0 if alike else number % 2], {"com": str(number % 2)}
        throws.append(
            MeasuredThrow(
                f"t{number}", bar, Grasp(), times + 0.5, path, 0.45, grip, None, None, factors
            )
        )
    shared = Shared(landing_height=0.1, position_noise=noise[0], angle_noise=noise[1])
    truth = {"friction": MU, "patch_radius": RADIUS, "delay": delay}
    data = ThrowData("made", shared, tuple(throws), None, truth)
    real = thrown(data, model, truth)
    return with_landings(data, real + rng.normal(size=real.shape) * noise)


def with_landings(data: ThrowData, places: Array) -> ThrowData:
    """The throws with these landings."""
    landed = [
        dataclasses.replace(throw, landing=(float(x), 0.1, float(theta)))
        for throw, (x, theta) in zip(data.throws, places, strict=True)
    ]
    return dataclasses.replace(data, throws=tuple(landed))


@pytest.fixture(scope="module")
def patched() -> ThrowData:
    """Throws by the meshed patch, none of the models that are fitted."""
    return made(10, "patch", LATE)


def test_truth_is_recovered_within_five_per_cent(patched: ThrowData) -> None:
    belief = identify(patched, "sp", delay=True).posterior
    assert belief.product == pytest.approx(MU * RADIUS, rel=0.05)
    assert belief.value("delay") == pytest.approx(LATE, abs=0.0015)
    # The ridge: the product is known much better than either of its parts.
    for part in ("friction", "patch_radius"):
        assert belief.deviation(part) > 5 * belief.product_deviation
    assert belief.correlation("friction", "patch_radius") < -0.95


def test_the_truth_of_the_shipped_throws_is_in_the_interval() -> None:
    found = identify(made_throws().picked(list(range(0, 18, 2))), "ls-step")
    low, high = found.posterior.product_interval
    assert low < MADE_PRODUCT < high < 1.3 * low
    assert found.missed == 0 and found.error < 0.006


def test_throws_are_predicted_the_same_alone_and_together() -> None:
    """Also where one recording ends soon after the opening, and where forces fall differently."""
    data, sets = made(3), parameter_sets([0.4, 0.8], [RADIUS], [0.0, 0.02], [1.0, 1.1])
    short = data.throws[1]
    short = dataclasses.replace(short, times=short.times[:-85], motion=short.motion[:-85])
    bent = TableGrip([0.0, 0.05, 0.07, 0.12], [90.0, 90.0, 70.0, 0.0])
    other = dataclasses.replace(data.throws[2], grip=bent)
    data = dataclasses.replace(data, throws=(data.throws[0], short, other))
    together = Predictor.of(data).landings("sp", sets)
    for i in range(3):
        alone = Predictor.of(data.picked([i])).landings("sp", sets[1:])
        assert together[i, 1] == pytest.approx(alone[0, 0], abs=1e-9)
    # Only the product of friction and force is seen.
    same = Predictor.of(data).landings("sp", parameter_sets(0.88, RADIUS, 0.02))
    assert together[:, 1] == pytest.approx(same[:, 0], abs=1e-9)
    assert np.abs(np.diff(together[..., 1], axis=1)).min() > 1e-4


def test_models_are_compared_on_throws_left_out_of_their_fits() -> None:
    """The law that made the throws errs least; each error is that of the landings themselves."""
    data = made(8, "ls-step", noise=(2e-4, 1e-3))
    found, table = compare(data)
    assert [row["model"] for row in table.rows] == [one.model for one in found]
    for one, row in zip(found, table.rows, strict=True):
        off = thrown(data, one.model, one.posterior.values()) - measured(data)
        mean, low, high = row["pose error [mm]"]
        assert mean == pytest.approx(1e3 * np.mean(np.abs(off) @ [1.0, 0.13]), rel=1e-3)
        assert low < mean < high
    apart = {str(row["model"]): row["left out [mm]"][0] for row in table.rows}
    assert min(apart, key=lambda model: apart[model]) == "ls-step"


def test_throws_of_a_condition_are_left_out_together() -> None:
    """Two bars: each is predicted by the fit to the other."""
    data = made(8)
    found = left_out(identify(data, "sp"), lambda *_: None)
    for bar in (0, 1):
        mine, other = (data.picked(list(range(first, 8, 2))) for first in (bar, 1 - bar))
        contact = identify(other, "sp").posterior.values()
        off = np.abs(thrown(mine, "sp", contact) - measured(mine))
        assert found[bar::2] == pytest.approx(off @ [1.0, 0.13], abs=2e-4)


def test_noise_that_is_said_too_small_is_taken_from_the_throws() -> None:
    data = made(20)
    shared = dataclasses.replace(data.shared, position_noise=NOISE[0] / 5, angle_noise=NOISE[1] / 5)
    known, said = (
        identify(each, "sp").posterior for each in (data, dataclasses.replace(data, shared=shared))
    )
    assert said.product_deviation == pytest.approx(known.product_deviation, rel=0.3)


def test_a_prior_pulls() -> None:
    data = made(4, noise=(0.05, 0.5))
    names = ("friction", "patch_radius")
    mean = np.log([1.2, 0.006])
    loose, firm = (Belief(names, mean, width**2 * np.eye(2)) for width in (1.0, 0.001))
    free, held = (identify(data, "sp", prior=p).posterior for p in (loose, firm))
    assert held.values() == pytest.approx({"friction": 1.2, "patch_radius": 0.006}, rel=0.01)
    assert abs(math.log(free.product / (MU * RADIUS))) < abs(math.log(held.product / (MU * RADIUS)))
    assert free.product_deviation < 1.0 and held.deviation("friction") <= 0.001


def test_the_forces_scale_is_held_by_its_prior() -> None:
    belief = identify(made(6), "sp", grip_scale=True).posterior
    assert belief.deviation("grip_scale") == pytest.approx(0.1, rel=0.02)
    assert belief.product == pytest.approx(MU * RADIUS, rel=0.05)
    assert belief.effective.names == ("friction", "patch_radius")
    assert belief.effective.product == pytest.approx(belief.product)


def test_an_outlier_pulls_little() -> None:
    data = made(8)
    places = measured(data).copy()
    places[3] += [0.3, 2.0]
    belief = identify(with_landings(data, places), "sp").posterior
    assert belief.product == pytest.approx(MU * RADIUS, rel=0.05)


NAMES = ("friction", "patch_radius", "delay")
MEAN = np.array([math.log(0.9), math.log(0.003), 0.004])
COVARIANCE = np.array([[1e-2, -9.9e-3, 0.0], [-9.9e-3, 1e-2, 0.0], [0.0, 0.0, 1e-6]])


def test_the_contact_file_is_part_of_a_scene(tmp_path) -> None:
    belief = Belief(NAMES, MEAN, COVARIANCE)
    text = re.sub(r"\[contact\].*?(?=\n\[)", "", scene_text("pose"), flags=re.S)
    file = tmp_path / "pasted.toml"
    known = load_scene("pose").contact
    file.write_text(text + "\n" + contact_text(belief, known), encoding="utf-8")
    scene = load_scene(file)
    assert scene.contact.friction == pytest.approx(0.9)
    assert scene.mean_delay == pytest.approx(0.004)
    swept = tp.sweep(tp.Planner(scene).plan(), samples=2048)
    values = {n: swept.values[:, i] for i, n in enumerate(swept.sampler.names)}
    product = np.log(values["friction"] * values["patch_radius"])
    assert product.std() == pytest.approx(belief.product_deviation, rel=0.35)
    assert np.log(values["friction"]).std() == pytest.approx(belief.deviation("friction"), rel=0.2)
    none = Distribution(uniform=0.0)
    certain = applied(belief, scene.replace(uncertainty=Uncertainty(delay=none, opening=none)))
    assert "opening" not in certain.assumed_spreads
    again = prior_of(applied(belief, scene), belief.names)
    assert again.product == pytest.approx(belief.product, rel=0.01)


def test_a_prior_that_knows_a_value_exactly_holds_it() -> None:
    known = Uncertainty(delay=Distribution(samples=(0.004,)))
    prior = load_scene("pose").replace(uncertainty=known)
    found = identify(made(4, "sp", 0.004), "sp", prior=prior, delay=True)
    assert found.posterior.value("delay") == pytest.approx(0.004, abs=1e-5)


@pytest.mark.parametrize(("count", "alike"), [(5, True), (1, False)])
def test_throws_that_tell_too_little_are_refused_without_a_prior(count: int, alike: bool) -> None:
    with pytest.raises(InputError, match="friction, patch_radius"):
        identify(made(count, alike=alike), "sp")
    if alike:
        found = identify(made(count, alike=True), "sp", prior=load_scene("pose"))
        assert found.posterior.product_deviation < 0.2


def test_throws_over_several_surfaces_or_without_a_landing_are_refused() -> None:
    data = made(2)
    throws = [
        dataclasses.replace(throw, factors={"surface": label})
        for throw, label in zip(data.throws, ("paper", "steel"), strict=True)
    ]
    gone = dataclasses.replace(data.shared, landing_height=5.0)
    for change, words in (({"throws": tuple(throws)}, "paper, steel"), ({"shared": gone}, "= 5")):
        with pytest.raises(InputError, match=words):
            identify(dataclasses.replace(data, **change), "sp")
