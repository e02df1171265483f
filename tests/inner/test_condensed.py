"""Steps of the condensed NLP: inside all limits, at the target or as near as these allow."""

import numpy as np
import pytest
from throwplan.planner.ocp import CondensedQp, Step


def step(wanted: float, *, limits: int, ahead: float = 0.1) -> Step:
    """A step in four numbers whose sum is the landing, each of `limits` at most `ahead`."""
    size, rows = 4, np.eye(4)[:limits]
    none = np.full(limits, np.inf)
    condensed = CondensedQp(
        np.zeros(size),
        np.eye(size),
        np.ones((1, size)),
        np.array([wanted]),
        rows,
        -none,
        np.full(limits, ahead),
        np.ones(size),
        np.eye(size),
        np.zeros(limits, bool),
        (np.arange(limits), limits),
    )
    found = condensed.step(np.zeros(size))
    assert found is not None
    return found


def test_a_step_is_the_shortest_to_the_target() -> None:
    found = step(0.2, limits=0)
    assert found.du == pytest.approx(np.full(4, 0.05), abs=1e-6)
    assert found.slope == pytest.approx(np.full((4, 1), 0.25))


def test_limits_that_become_active_are_kept_and_the_rest_makes_up_for_them() -> None:
    found = step(1.0, limits=2)
    assert found.du == pytest.approx([0.1, 0.1, 0.4, 0.4], abs=1e-6)
    assert found.residual == pytest.approx(0.0, abs=1e-6)
    # From there on only what is free moves.
    assert found.slope.ravel() == pytest.approx([0.0, 0.0, 0.5, 0.5], abs=1e-6)


def test_one_free_number_alone_moves_to_the_target() -> None:
    found = step(0.8, limits=3)
    assert found.du == pytest.approx([0.1, 0.1, 0.1, 0.5], abs=1e-6)
    assert found.slope.ravel() == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-6)


def test_a_target_beyond_all_limits_is_missed_by_as_little_as_they_allow() -> None:
    found = step(1.0, limits=4)
    assert found.du == pytest.approx(np.full(4, 0.1), abs=1e-6)
    assert found.residual == pytest.approx(-0.6, abs=1e-6)


def test_no_number_moves_farther_than_a_step_may() -> None:
    found = step(5.0, limits=0)
    assert found.du == pytest.approx(np.ones(4), abs=1e-6)
    assert found.residual == pytest.approx(-1.0, abs=1e-6)
