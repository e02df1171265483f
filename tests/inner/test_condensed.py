"""Fails if a step of the condensed NLP leaves its limits or stops short of what these allow."""

import numpy as np
import pytest
from throwplan.planner.ocp import CondensedQp, Step


def step(wanted: float, *, limits: int, ahead: float = 0.1) -> Step:
    """A step in four numbers whose sum is the landing, each of `limits` at most `ahead`."""
    size, rows, none = 4, np.eye(4)[:limits], np.full(limits, np.inf)
    equations = np.zeros(size), np.eye(size), np.ones((1, size)), np.array([wanted])
    bounds = rows, -none, np.full(limits, ahead), np.ones(size), np.eye(size)
    found = CondensedQp(*equations, *bounds, np.zeros(limits, bool)).step(np.zeros(size))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("wanted", "limits", "du", "residual", "slope"),
    [
        # The shortest step to the target.
        (0.2, 0, [0.05] * 4, 0.0, [0.25] * 4),
        # Limits that become active are kept, the rest makes up for them; then only that moves.
        (1.0, 2, [0.1, 0.1, 0.4, 0.4], 0.0, [0.0, 0.0, 0.5, 0.5]),
        (0.8, 3, [0.1, 0.1, 0.1, 0.5], 0.0, [0.0, 0.0, 0.0, 1.0]),
        # A target beyond all limits is missed by as little as they allow.
        (1.0, 4, [0.1] * 4, -0.6, None),
        # No number moves farther than a step may.
        (5.0, 0, [1.0] * 4, -1.0, None),
    ],
)
def test_a_step_goes_as_near_as_its_limits_allow(wanted, limits, du, residual, slope):
    found = step(wanted, limits=limits)
    assert found.du == pytest.approx(du, abs=1e-6)
    assert found.residual == pytest.approx([residual, 0.0], abs=1e-6)
    if slope is not None:
        assert found.slope.ravel() == pytest.approx(slope, abs=1e-6)
