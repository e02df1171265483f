"""Fails if the 3-D view shows arm, hand or object elsewhere than the throw has them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import throwplan as tp
from throwplan.pictures.space import motion_to_rest, serving, space_motion, space_throw

AZIMUTH = np.radians(20.0)


@pytest.fixture(scope="module")
def space(turned) -> Any:
    """A throw into the cup, out of the plane y = 0."""
    return space_throw(tp.read_plan(turned[1]))


@pytest.fixture(scope="module")
def panel(space: Any, free_port):
    with serving(space_motion(space.throw), free_port()) as (_, panel):
        yield panel


def test_the_arm_of_all_joints_holds_the_hand_of_the_planar_chain(space: Any) -> None:
    x, z, theta = space.line.hand
    across = np.array([np.cos(AZIMUTH), np.sin(AZIMUTH)])
    place = np.column_stack([np.outer(x, across), z])
    np.testing.assert_allclose(space.hand[:, :3, 3], place, atol=1e-9)
    approach = np.column_stack([np.outer(np.cos(theta), across), np.sin(theta)])
    np.testing.assert_allclose(space.hand[:, :3, 0], approach, atol=1e-9)
    # Joints are rigidly linked, and the last one carries the pads' centre.
    joints = space.joints[:, :, :3, 3]
    for one, other in zip(range(joints.shape[1] - 1), range(1, joints.shape[1]), strict=True):
        assert np.ptp(np.linalg.norm(joints[:, one] - joints[:, other], axis=1)) < 1e-9
    assert np.ptp(np.linalg.norm(joints[:, -1] - space.hand[:, :3, 3], axis=1)) < 1e-9


def test_the_bar_is_held_and_lands_at_the_target(space: Any) -> None:
    held = space.bar[0, :3, 3] - space.hand[0, :3, 3]
    assert np.linalg.norm(held) == pytest.approx(space.scene.com_offset, abs=1e-12)
    target, times = space.throw.target, space.line.times
    late = space.throw.landing_time - times[-1]
    rate = (space.bar[-1, :3, 3] - space.bar[-2, :3, 3]) / (times[-1] - times[-2])
    place = np.array([target.x, target.y, target.z])
    assert np.linalg.norm(space.bar[-1, :3, 3] + late * rate - place) < 1e-4
    np.testing.assert_allclose(space.target()[:3, 3], place, atol=1e-12)
    np.testing.assert_allclose(space.target()[:3, 0], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(space.bar[-1, :3, 0], [0, 0, -1], atol=0.02)


def test_the_pads_hold_until_detach_and_then_open(space: Any, panel: Any) -> None:
    view = panel.view
    for moment, opens in ((space.throw.opening_time, False), (space.throw.landing_time, True)):
        i = view.show(moment)
        np.testing.assert_allclose(view.hand.position, space.hand[i, :3, 3], atol=1e-12)
        pad = view.pads[0]
        gap = abs(pad.position[2]) - pad.dimensions[2] / 2 - space.scene.object.width / 2
        assert (gap > 0.01) if opens else (abs(gap) < 1e-12)


@pytest.mark.slow
def test_a_cycle_moves_each_object_from_its_pick_to_its_bin(cycled, free_port) -> None:
    """Each lies at its pick until it is held, is carried without a jump, and ends at its target;
    the arm goes on meanwhile."""
    space, _ = motion_to_rest(cycled)
    assert space.names == ("part", "other part")
    picks = (0.45, 0.1), (0.45, -0.1)
    for bar, throw, held, (x, y) in zip(space.bars, space.throws, space.held, picks, strict=True):
        before = bar[: space.index(held) + 1, :3, 3]
        np.testing.assert_allclose(before, np.broadcast_to(before[0], before.shape), atol=1e-12)
        # It hangs from the hand, which points down.
        place = x, y, 0.35 - throw.scene.com_offset
        np.testing.assert_allclose(before[0], place, atol=1e-6)
        assert np.linalg.norm(np.diff(bar[:, :3, 3], axis=0), axis=1).max() < 0.006
        target = throw.throw.target
        assert np.linalg.norm(bar[-1, :3, 3] - (target.x, target.y, target.z)) < 5e-3
    with serving(space, free_port()) as (_, panel):
        for time in (0.0, space.held[1], float(space.times[-1])):
            panel.go(time)
            i = space.index(time)
            np.testing.assert_allclose(panel.view.hand.position, space.hand[i, :3, 3])
            for one, bar in zip(panel.view.objects, space.bars, strict=True):
                np.testing.assert_allclose(one.bar.position, bar[i, :3, 3])
        assert panel.words.content.startswith("**other part: ")
