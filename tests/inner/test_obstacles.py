"""Fails if a throw meets an obstacle or the arm itself, or the check sees another distance.

That the check misses nothing among random obstacles is in test_verdict_oracle.py.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.models import Trajectory
from throwplan.planner.throw import Throw, make_manipulator
from throwplan.planner.verdict import (
    Clearance,
    CollisionScene,
    collision,
    held_bar,
    measures_of,
    overlap,
)
from throwplan.problems import Obstacle

from oracle import oracle_of, shapes


def clearances(throw: Throw) -> list[Clearance]:
    """Pairs of bodies that come too near to each other in a throw."""
    return measures_of(throw).clearances()


#: A wall over which the usual throw to 1.2 m does not go.
WALL = Obstacle("wall", "box", (0.1, 0.6, 0.44), (0.9, 0.0, 0.22))
TARGET = tp.Pose(1.2, 0.1, 0.0)


@pytest.fixture(scope="module")
def pose() -> tp.Scene:
    return tp.load_scene("pose")


@pytest.fixture(scope="module")
def free(planner_of) -> tp.Plan:
    return planner_of("pose").plan(TARGET)


@pytest.fixture(scope="module")
def around(pose) -> tp.Plan:
    return tp.Planner(pose.replace(obstacle=(WALL,))).plan(TARGET, patience=30.0)


def test_a_throw_clears_the_arm_as_the_check_says(pose, free) -> None:
    """All its instants by themselves, beside distances of every pair of bodies."""
    manipulator, throw = make_manipulator(pose), free.throw.deciding
    rng = np.random.default_rng(0)
    limits = manipulator.planning
    q = rng.uniform(limits.q_min, limits.q_max, (300, manipulator.size)).T
    q[:, :50] = throw.path.at(np.linspace(0.0, throw.opening_time, 50)).pose
    bar = held_bar(pose, manipulator.motion(q, 0 * q, 0 * q)[0])
    capsules = manipulator.capsules
    # Neighbours meet at their joint. The bar comes last, and is held by the last link, the hand.
    (given,) = pose.arm.overlaps
    moved_by, number = (*capsules.moved_by, capsules.moved_by[-1]), (*capsules.number, math.inf)
    for where in (None, bar):
        found = overlap(pose, manipulator, q, where)
        track = CollisionScene(pose, (), capsules).bodies_at(np.zeros(300), q, where)
        expected = np.full(300, -np.inf)
        for i, j in itertools.combinations(range(len(track.names)), 2):
            links = number[i], number[j]
            if moved_by[i] == moved_by[j] or abs(links[0] - links[1]) <= 1:
                continue
            ends = (end.T for body in (i, j) for end in track.ends[body])
            lack = track.radius[i] + track.radius[j] - shapes.between_segments(*ends)
            allowed = given.depth if (i + 1, j + 1) == given.capsules else 0.0
            expected = np.maximum(expected, lack - allowed)
        assert found == pytest.approx(expected, abs=1e-9)
        assert (found[:50] <= 0.0).all() and (found > 0.01).sum() > 10


def test_a_throw_goes_over_a_wall(free, around):
    assert free.solved and around.solved
    hit = dataclasses.replace(free.throw.deciding, scene=around.throw.deciding.scene)
    assert {c.other for c in clearances(hit)} == {"wall"}
    assert not clearances(around.throw.deciding)
    assert oracle_of(around).judge(planned=True).broken() == [()]


def test_an_obstacle_stands_in_the_base_frame(free, pose):
    """A wall turned with the target is met by the same throw, one that stays is not."""
    angle = 0.9
    cos, sin = math.cos(angle), math.sin(angle)
    target = dataclasses.replace(TARGET, x=1.2 * cos, y=1.2 * sin)
    turned = dataclasses.replace(WALL, position=(0.9 * cos, 0.9 * sin, 0.22), yaw=angle)
    for wall, meets in ((turned, True), (WALL, False)):
        scene = pose.replace(obstacle=(wall,), target=target)
        throw = dataclasses.replace(free.throw.deciding, scene=scene)
        assert bool(clearances(throw)) == meets


def in_the_way(throw: Throw) -> Obstacle:
    """A ball in the middle of a flight."""
    at = throw.flight(np.array([throw.landing.flight_time / 2]))[:, 0]
    place = throw.target.plane.points(at[0], at[1]).tolist()
    return Obstacle("ball", "sphere", (0.03,), tuple(place))


def test_a_hand_throws_around_an_obstacle(plan_of) -> None:
    scene, first = tp.load_scene("hand-box"), plan_of("hand-box").throw.deciding
    blocked = scene.replace(obstacle=(in_the_way(first),))
    assert clearances(dataclasses.replace(first, scene=blocked))
    plan = tp.Planner(blocked).plan()
    assert plan.solved and not clearances(plan.throw.deciding)


@pytest.mark.parametrize("share", [0.31, 0.5, 0.73])
def test_a_distance_counts_between_the_samples_too(plan_of, share) -> None:
    """The bar's axis passes a ball beside the plane of the flight: the check sees it as near."""
    throw, radius, beside, clearance = plan_of("hand-box").throw.deciding, 0.01, 0.06, 0.1
    x, z = throw.flight(np.array([share * throw.landing.flight_time]))[:2, 0]
    place = (throw.target.plane.points(x, z)[0], beside, z)
    ball = Obstacle("ball", "sphere", (radius,), place, clearance=clearance)
    near = dataclasses.replace(throw, scene=throw.scene.replace(obstacle=(ball,)))
    (found,) = (one for one in clearances(near) if one.flying)
    nearest = beside - radius - throw.scene.object.width / 2
    assert 0.0 <= nearest - (clearance - found.penetration) < 0.01


def test_the_arm_meets_itself(free, pose):
    """A motion that folds the hand onto the base is found without any obstacle."""
    manipulator, final = make_manipulator(pose), free.throw.deciding
    folded = np.array([-1.5, -2.9, 0.2])
    limits = manipulator.hard
    assert ((folded > limits.q_min) & (folded < limits.q_max)).all()
    assert not clearances(final)
    begin, still = final.path.at([0.0]).pose.T, np.zeros((1, 3))
    rate = (folded - begin) / final.path.end
    path = Trajectory.cubics(np.array([0.0, final.path.end]), begin, rate, still, still)
    words = [collision(c).words for c in clearances(dataclasses.replace(final, path=path))]
    assert any("meets link" in word or "meets base" in word for word in words)


@pytest.mark.parametrize(
    "obstacle",
    [
        dataclasses.replace(WALL, position=(1.2, 0.0, 0.1)),
        dataclasses.replace(WALL, position=(0.3, 0.0, 0.6)),
        Obstacle("peg", "sphere", (0.005,), (0.0, -0.05, 0.3)),
    ],
)
def test_an_obstacle_that_holds_target_start_or_base(pose, obstacle):
    scene = varied(pose, robot={"start": (-0.8, -2.4, 1.6)}, obstacle=(obstacle,))
    with pytest.raises(tp.InputError, match=obstacle.name):
        tp.Planner(scene).plan(TARGET)


@pytest.mark.parametrize(("into", "free_of"), [(0.004, True), (0.012, False)])
def test_a_bar_may_land_on_an_obstacle_but_not_inside(free, into, free_of):
    """into [m]: how far its lower face, 10 mm from its axis, is below the obstacle's top."""
    final = free.throw.deciding
    bar, landing = final.scene.object, final.landing
    ends = landing.z + np.sin(landing.theta) * np.array([-bar.com, bar.length - bar.com])
    top = ends.min() - bar.width / 2 + into
    table = Obstacle("table", "box", (0.3, 0.3, 0.05), (landing.x, 0.0, top - 0.025), clearance=0.0)
    throw = dataclasses.replace(final, scene=final.scene.replace(obstacle=(table,)))
    assert (not clearances(throw)) == free_of
