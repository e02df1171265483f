"""The section [uncertainty]: what it says and refuses; samples of it: laws, copula, repeatable."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats
from throwplan import InputError, load_scene
from throwplan.planner.sweep.uncertain import quantile, sampler_of
from throwplan.problems import USUAL_UNCERTAINTY, Distribution, Uncertainty, scene_text


def scene_with(tmp_path, section: str, base: str = "pose"):
    path = tmp_path / "scene.toml"
    path.write_text(scene_text(base) + f"\n[uncertainty]\n{section}\n")
    return load_scene(path)


def test_every_key_in_its_unit(tmp_path) -> None:
    scene = scene_with(
        tmp_path,
        """
        delay = { uniform = 0.01, mean = 0.003 }
        opening = { normal = 0.1, relative = true }
        friction = { samples = [0.8, 0.9, 1.2] }
        mass = { uniform = 0.012, mean = 0.25 }
        grasp_angle_deg = { uniform = 2.0 }
        hand_omega_deg = { normal = 10.0, mean = -5.0 }
        """,
    )
    names = ("delay", "opening", "friction", "mass", "grasp_angle", "hand_omega")
    assert scene.uncertainty.names == names
    spreads = dict(zip(names, sampler_of(scene, 0).spreads, strict=True))
    assert spreads["opening"].expected == pytest.approx(0.05)  # the scene's
    assert spreads["opening"].deviation == pytest.approx(0.005)
    assert spreads["friction"].reach == (0.8, 1.2)
    assert spreads["mass"].reach == pytest.approx((0.238, 0.262))
    assert spreads["grasp_angle"].reach == pytest.approx(np.radians((-2, 2)))
    assert spreads["hand_omega"].expected == pytest.approx(math.radians(-5))
    assert scene.mean_delay == pytest.approx(0.003)


def test_mean_of_measured_delays(tmp_path) -> None:
    scene = scene_with(tmp_path, "delay = { samples = [0.001, 0.002, 0.006] }")
    assert scene.mean_delay == pytest.approx(0.003)
    assert load_scene("pose").mean_delay == 0.0


def test_relative_is_the_same_as_absolute() -> None:
    scene = load_scene("pose")
    patch = scene.contact.patch_radius
    relative = Distribution(uniform=0.2, mean=0.9, relative=True).about(patch)
    absolute = Distribution(uniform=0.2 * patch, mean=0.9 * patch).about(patch)
    assert relative.reach == pytest.approx(absolute.reach)
    measured = Distribution(samples=(0.9, 1.2), relative=True).about(patch)
    assert measured.reach == pytest.approx((0.9 * patch, 1.2 * patch))


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ("", "nothing is uncertain"),
        ("delay = 3", "delay = 3: must be like"),
        ("frction = { uniform = 0.1 }", "'frction', did you mean 'friction'"),
        ("grasp_angle = { uniform = 1 }", "did you mean 'grasp_angle_deg'"),
        ("grasp_angle_deg = { uniform = -1 }", "grasp_angle_deg: uniform = -1: must be above 0"),
        ("grasp_angle_deg = { uniform = 400 }", r"grasp_angle_deg: reaches \[-400, 400\]"),
        ("delay = { uniform = 0.1, relative = true }", "delay: relative: only for"),
        ("delay = { uniform = nan }", "delay: uniform = nan: must be a finite number"),
        ("delay = { samples = [] }", "exactly one of"),
        ("delay = { samples = [0.01], mean = 0.01 }", "mean: not beside 'samples'"),
        # Values that cannot be: bounded ones are refused.
        ("friction = { uniform = 1.0 }", r"friction: reaches \[0, 2\]: must stay within \[0.01,"),
        ("friction = { uniform = 1.1, relative = true }", "friction: reaches"),
        ("mass = { samples = [0.2, -0.1] }", "mass: reaches"),
        ("opening = { samples = [0.0] }", "opening: is 0: must stay within"),
        ("opening = { uniform = 0.06 }", "opening: reaches"),
        ("inertia = { normal = 1e-5, mean = -1e-4 }", "inertia: is -0.0001"),
        ("com_offset = { uniform = 0.11 }", "com_offset: reaches"),
        # Correlations.
        ("delay = { normal = 1e-3 }\ncorrelation = 3", "correlation = 3: must be like"),
        ('delay = { normal = 1e-3 }\ncorrelation = [["delay", "mass"]]', "must be like"),
        (
            'delay = { normal = 1e-3 }\ncorrelation = [["delay", "mass", 0.5]]',
            "'mass' is not uncertain here",
        ),
        (
            'delay = { normal = 1e-3 }\ncorrelation = [["dlay", "mass", 0.5]]',
            "'dlay', did you mean 'delay'",
        ),
        (
            "delay = { normal = 1e-3 }\nmass = { normal = 1e-3 }\n"
            'correlation = [["delay", "mass", 1.0]]',
            "delay and mass = 1: must be between -1 and 1",
        ),
        (
            "delay = { normal = 1e-3 }\nmass = { normal = 1e-3 }\n"
            'correlation = [["delay", "mass", 0.1], ["mass", "delay", 0.2]]',
            "once",
        ),
        (
            "delay = { normal = 1e-3 }\nmass = { normal = 1e-3 }\nopening = { normal = 1e-3 }\n"
            'correlation = [["delay", "mass", 0.9], ["mass", "opening", 0.9], '
            '["delay", "opening", -0.9]]',
            "positive definite",
        ),
    ],
)
def test_wrong_sections_are_one_line(tmp_path, section: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        scene_with(tmp_path, section)
    assert str(caught.value).count("[uncertainty]") == 1
    assert "\n" not in str(caught.value)


def test_a_scene_in_python_is_checked_too() -> None:
    scene = load_scene("pose")
    with pytest.raises(InputError, match=r"\[uncertainty\] friction"):
        scene.replace(uncertainty=Uncertainty(friction=Distribution(uniform=2.0)))
    with pytest.raises(InputError, match="nothing is uncertain"):
        Uncertainty()


# Samples.


def sampled(section: Uncertainty, count: int, seed: int = 0):
    scene = load_scene("pose").replace(uncertainty=section)
    return sampler_of(scene, seed).draw(0, count)


def test_samples_follow_their_laws() -> None:
    section = Uncertainty(
        delay=Distribution(uniform=0.01, mean=0.002),
        friction=Distribution(normal=0.1, relative=True),
        mass=Distribution(samples=(0.2, 0.2, 0.3)),
    )
    delay, friction, mass = sampled(section, 4096).T
    assert stats.kstest(delay, stats.uniform(-0.008, 0.02).cdf).statistic < 0.002
    assert stats.kstest(friction, stats.norm(1.0, 0.1).cdf).statistic < 0.002
    assert np.mean(mass == 0.3) == pytest.approx(1 / 3, abs=1e-3)
    assert set(mass) == {0.2, 0.3}


def test_a_wide_normal_is_cut_off_and_keeps_its_shape() -> None:
    friction = sampled(Uncertainty(friction=Distribution(normal=1.0)), 4096)[:, 0]
    law = stats.truncnorm(0.01 - 1.0, 100.0 - 1.0, 1.0, 1.0)  # 1 % and 100 times the scene's
    assert friction.min() > 0.01
    assert stats.kstest(friction, law.cdf).statistic < 0.002


@pytest.mark.parametrize("rho", [-0.7, 0.0, 0.8])
def test_copula_couples_ranks_and_leaves_the_margins(rho: float) -> None:
    """Spearman's rank correlation of a Gaussian copula is 6/pi asin(rho/2)."""
    section = Uncertainty(
        friction=Distribution(uniform=0.2),
        patch_radius=Distribution(normal=0.0002),
        delay=Distribution(uniform=0.01),
        correlation=(("friction", "patch_radius", rho),),
    )
    delay, friction, patch = sampled(section, 8192).T
    expected = 6 / math.pi * math.asin(rho / 2)
    assert stats.spearmanr(friction, patch).statistic == pytest.approx(expected, abs=0.01)
    assert stats.spearmanr(friction, delay).statistic == pytest.approx(0.0, abs=0.01)
    assert stats.kstest(friction, stats.uniform(0.8, 0.4).cdf).statistic < 0.003
    assert stats.kstest(patch, stats.norm(0.0025, 0.0002).cdf).statistic < 0.003


def test_any_part_of_the_sequence_can_be_drawn_by_itself() -> None:
    sampler = sampler_of(load_scene("pose").replace(uncertainty=USUAL_UNCERTAINTY), 5)
    whole = sampler.draw(0, 512)
    parts = [sampler.draw(first, 128) for first in range(0, 512, 128)]
    assert np.array_equal(whole, np.vstack(parts))
    assert np.array_equal(whole[:100], sampler.draw(0, 100))


def test_seeds_differ_and_repeat() -> None:
    draws = [sampled(USUAL_UNCERTAINTY, 256, seed) for seed in (0, 0, 1)]
    assert np.array_equal(draws[0], draws[1])
    assert not np.allclose(draws[0], draws[2])
    # Low discrepancy: each 256th of the range is met once.
    cells = np.floor((draws[0][:, 0] + 0.01) / 0.02 * 256)
    assert sorted(cells) == list(range(256))


def test_quantiles_of_a_distribution_invert_its_law() -> None:
    shares = np.array([0.05, 0.5, 0.95])
    normal = quantile(Distribution(normal=2.0, mean=1.0), shares, (-100.0, 100.0))
    assert normal == pytest.approx(stats.norm(1.0, 2.0).ppf(shares))
    uniform = quantile(Distribution(uniform=2.0, mean=1.0), shares, (-100.0, 100.0))
    assert uniform == pytest.approx(1.0 + 2.0 * (2 * shares - 1))
    measured = quantile(Distribution(samples=(3.0, 1.0, 2.0)), shares, (-100.0, 100.0))
    assert list(measured) == [1.0, 2.0, 3.0]


def test_the_section_is_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        USUAL_UNCERTAINTY.delay = None  # type: ignore[misc]
