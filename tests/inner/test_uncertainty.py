"""Fails if samples of uncertain values leave their laws or their copula, or are not repeated by the
seed, or if the delay that a throw bears is not that of a sweep."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from builders import only
from scipy import stats
from throwplan import load_scene
from throwplan.planner.uncertainty import sampler_of
from throwplan.problems import Distribution, Uncertainty


def sampled(section: Uncertainty, count: int, seed: int = 0):
    scene = load_scene("pose").replace(uncertainty=section)
    return sampler_of(scene, seed).draw(0, count)


def test_samples_follow_their_laws() -> None:
    section = only(
        delay=Distribution(uniform=0.01, mean=0.002),
        friction=Distribution(normal=0.1, relative=True),
        mass=Distribution(samples=(0.2, 0.2, 0.3)),
    )
    delay, friction, mass = sampled(section, 4096).T
    assert stats.kstest(delay, stats.uniform(-0.008, 0.02).cdf).statistic < 0.002
    # The command goes out early by the mean.
    scene = load_scene("pose").replace(uncertainty=section)
    assert sampler_of(scene, 0).openings(scene)[:2] == pytest.approx((-0.01, 0.01))
    assert stats.kstest(friction, stats.norm(1.0, 0.1).cdf).statistic < 0.002
    assert np.mean(mass == 0.3) == pytest.approx(1 / 3, abs=1e-3)
    assert set(mass) == {0.2, 0.3}


def test_a_wide_normal_is_cut_off_and_keeps_its_shape() -> None:
    friction = sampled(only(friction=Distribution(normal=1.0)), 4096)[:, 0]
    law = stats.truncnorm(0.01 - 1.0, 100.0 - 1.0, 1.0, 1.0)  # 1 % and 100 times the scene's
    assert friction.min() > 0.01
    assert stats.kstest(friction, law.cdf).statistic < 0.002


@pytest.mark.parametrize("rho", [-0.7])
def test_copula_couples_ranks_and_leaves_the_margins(rho: float) -> None:
    """Spearman's rank correlation of a Gaussian copula is 6/pi asin(rho/2)."""
    section = only(
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
    sampler = sampler_of(load_scene("pose").replace(uncertainty=Uncertainty.USUAL), 5)
    whole = sampler.draw(0, 512)
    parts = [sampler.draw(first, 128) for first in range(0, 512, 128)]
    assert np.array_equal(whole, np.vstack(parts))
    assert np.array_equal(whole[:100], sampler.draw(0, 100))


def test_seeds_differ_and_repeat() -> None:
    draws = [sampled(Uncertainty.USUAL, 256, seed) for seed in (0, 0, 1)]
    assert np.array_equal(draws[0], draws[1])
    assert not np.allclose(draws[0], draws[2])
    # Low discrepancy: each 128th of the range is met, twice in the mean.
    cells = np.floor((draws[0][:, 0] + 0.01) / 0.02 * 128)
    assert set(cells) == set(range(128))


@pytest.mark.parametrize("name", ["hand-flip"])
def test_the_delay_that_a_throw_bears_is_that_of_a_sweep(plan_of, name) -> None:
    """Of the same motion: none of 500 delays within it fails, half of those a bit beyond it do,
    and the landing moves as these say."""
    plan = plan_of(name)
    borne = plan.delay
    said = borne.to_dict()
    assert {key: said[key] for key in ("early", "late")} == vars(borne.scan)
    assert tp.sweep(plan, samples=1).to_dict()["delay_inside"] == vars(borne.scan)
    early, late = (0.05 if end is None else abs(end) for end in vars(borne.scan).values())

    def swept(low: float, high: float) -> tp.Sweep:
        # Samples about a mean of 0: the command stays in its place.
        delays = np.linspace(low, high, 500)
        spread = Distribution(samples=tuple(delays.tolist()))
        scene = plan.scene.changed(uncertainty=only(delay=spread))
        return tp.sweep(dataclasses.replace(plan, scene=scene), samples=500)

    most = min(early, late)
    assert swept(-0.999 * most, 0.999 * most).success.all()
    beyond = swept(-1.5 * most, 1.5 * most)
    assert 0.55 < beyond.success.mean() < 0.92
    ten = swept(-said["landing"]["delay"], said["landing"]["delay"])
    order = np.argsort(ten.values[:, 0])
    for row, end in ((order[0], "early"), (order[-1], "late")):
        moved = (ten.landings.pose - ten.nominal.pose)[row, :2]
        # A batch's releases are stepped.
        assert moved == pytest.approx(list(said["landing"][end].values()), rel=0.01, abs=2e-4)
