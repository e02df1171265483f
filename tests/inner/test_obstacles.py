"""Obstacles and the arm itself: distances, the check, and throws planned around. Judge: MuJoCo."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from builders import nlp_of, varied
from throwplan.models import Trajectory
from throwplan.models.robot import ArmCapsules, Solid, about_z, segment_distance
from throwplan.planner.clearance import (
    CollisionScene,
    KeepOut,
    SweptBodies,
    contacts,
    held_bar,
    overlap,
)
from throwplan.planner.show import serving, space_throw
from throwplan.planner.throw import Throw, make_manipulator
from throwplan.planner.verdict import collision
from throwplan.problems import Obstacle

from oracle import shapes

mujoco = pytest.importorskip("mujoco")

#: A wall over which the usual throw to 1.2 m does not go.
WALL = Obstacle("wall", "box", (0.1, 0.6, 0.44), (0.9, 0.0, 0.22))
TARGET = tp.Pose(1.2, 0.1, 0.0)


@pytest.fixture(scope="module")
def pose() -> tp.Scene:
    return tp.load_scene("pose")


@pytest.fixture(scope="module")
def free(pose) -> tp.Plan:
    return tp.Planner(pose).plan(TARGET)


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
    for where in (None, bar):
        found = overlap(pose, manipulator, q, where)
        track = CollisionScene(pose, (), capsules).bodies_at(np.zeros(300), q, where)
        expected = np.full(300, -np.inf)
        for i, j in itertools.combinations(range(len(track.names)), 2):
            # Neighbours meet at their joint; the bar is held by the hand.
            hand = j == len(capsules.number) and capsules.moved_by[i] == capsules.moved_by[-1]
            if hand or (j < len(capsules.number) and not_apart(capsules, i, j)):
                continue
            ends = (end.T for body in (i, j) for end in track.ends[body])
            lack = track.radius[i] + track.radius[j] - shapes.between_segments(*ends)
            expected = np.maximum(expected, lack)
        assert found == pytest.approx(expected, abs=1e-9)
        assert (found[:50] <= 0.0).all() and (found > 0.01).sum() > 10


def not_apart(capsules: ArmCapsules, i: int, j: int) -> bool:
    """Whether two links are one, or so near in the chain that they always meet."""
    return (
        capsules.moved_by[i] == capsules.moved_by[j]
        or abs(capsules.number[i] - capsules.number[j]) <= 2
    )


def clutter(rng: np.random.Generator, azimuth: float = 0.0) -> Obstacle:
    """One of any kind, before the robot and mostly off its way."""
    kind = str(rng.choice(["box", "sphere", "capsule"]))
    size = {"box": (0.1, 0.4, 3), "sphere": (0.05, 0.2, 1), "capsule": (0.03, 0.3, 2)}[kind]
    away, angle = rng.uniform(0.3, 1.3), azimuth + rng.uniform(-0.6, 0.6)
    position = (away * math.cos(angle), away * math.sin(angle), rng.uniform(0.0, 1.0))
    return Obstacle(
        *("clutter", kind, tuple(map(float, rng.uniform(*size))), tuple(map(float, position))),
        *(float(rng.uniform(-3, 3)), float(rng.uniform(-1.5, 1.5))),
    )


def mjcf(solid: Solid, obstacle: Obstacle) -> str:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(solid.axes.T).ravel())
    size = np.array(obstacle.size) / 2
    if obstacle.kind != "box":
        size = np.array([obstacle.size[0], obstacle.size[-1] / 2])
    words = " ".join(f"{v:.12g}" for v in size)
    pos, turned = (" ".join(f"{v:.12g}" for v in vector) for vector in (solid.centre, quat))
    return f'<geom type="{obstacle.kind}" size="{words}" pos="{pos}" quat="{turned}"/>'


class Judge:
    """A scene's obstacles, and the arm by its own chain and the bar as a box, in MuJoCo.

    The arm's capsules are set into the frames of the whole chain with the azimuth joint turned;
    nothing of the planner's planar kinematics or distances is used.
    """

    def __init__(self, scene: tp.Scene) -> None:
        arm, bar = scene.arm, scene.object
        assert arm is not None
        q = ca.SX.sym("q", arm.joints)
        self.scene, self.arm = scene, arm
        self.frames = ca.Function("frames", [q], arm.frames(q))
        bodies = "".join(mjcf(o.solid, o) for o in scene.obstacle)
        for capsule in arm.capsules:
            half = np.linalg.norm(np.subtract(capsule.end, capsule.begin)) / 2
            size = f'size="{capsule.radius + arm.cover} {half:.12g}"'
            bodies += f'<body mocap="true"><geom type="capsule" {size}/></body>'
        box = f'size="{bar.length / 2} {bar.width / 2} {bar.width / 2}"'
        bodies += f'<body mocap="true"><geom type="box" {box}/></body>'
        self.model = mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)

    def nearest(self, q: np.ndarray | None, com: np.ndarray | None) -> Iterator[tuple[int, float]]:
        """Distance less clearance [m] of each body that moves (its number, the bar's is -1), from
        the obstacles, and of the arm's from the floor."""
        arm, bar, scene = self.arm, self.scene.object, self.scene
        plane, moving = scene.target.plane, []
        if q is not None:
            joints = np.array(arm.posture)
            joints[arm.azimuth_joint - 1] = arm.azimuth_angle(plane.azimuth)
            joints[np.array(arm.throwing_joints) - 1] = q
            frames = [np.eye(4), *(np.array(f) for f in self.frames(joints))]
            hand = frames[-1].copy()
            hand[:3, 3] -= arm.tool.tcp * hand[:3, 2]
            frames = [*frames[: arm.joints + 1], hand]
            for i, capsule in enumerate(arm.capsules):
                frame = frames[capsule.link]
                ends = np.array([capsule.begin, capsule.end]) @ frame[:3, :3].T + frame[:3, 3]
                self.place(i, ends.mean(axis=0), ends[1] - ends[0])
                # The shoulder turns about its own axis.
                aside = np.abs([capsule.begin[:2], capsule.end[:2]]).max() > 0
                if capsule.link > 2 or (capsule.link == 2 and aside):
                    moving.append(i)
                    lowest = ends[:, 2].min() - capsule.radius - arm.cover
                    yield i, lowest - scene.workspace.floor
        if com is not None:
            along = np.array([math.cos(com[2]), 0.0, math.sin(com[2])])
            middle = np.array([com[0], plane.lateral, com[1]])
            middle += (bar.length / 2 - bar.com) * along
            turn = about_z(plane.azimuth)
            frame = np.column_stack([along, [0.0, 1.0, 0.0], np.cross(along, [0.0, 1.0, 0.0])])
            self.place(len(arm.capsules), turn @ middle, None, turn @ frame)
            moving.append(-1)
        mujoco.mj_kinematics(self.model, self.data)
        count, points = len(scene.obstacle), np.zeros(6)
        for body in moving:
            geom = count + (len(arm.capsules) if body < 0 else body)
            for k, obstacle in enumerate(scene.obstacle):
                away = mujoco.mj_geomDistance(self.model, self.data, k, geom, 2.0, points)
                yield body, away - obstacle.clearance

    def place(self, i: int, at: np.ndarray, axis: np.ndarray | None, frame=None) -> None:
        quat = np.zeros(4)
        if axis is not None:
            mujoco.mju_quatZ2Vec(quat, axis / np.linalg.norm(axis))
        else:
            mujoco.mju_mat2Quat(quat, np.ascontiguousarray(frame).ravel())
        self.data.mocap_pos[i], self.data.mocap_quat[i] = at, quat

    def worst(self, throw: Throw, step: float = 0.0023) -> float:
        """Least distance less clearance [m] from rest to rest and down to the landing."""
        rest, found = max(throw.until, throw.landing_time), []
        release = throw.release
        for time in np.arange(0.0, rest, step):
            q, com = throw.path.at([min(time, throw.until)]).pose[:, 0], None
            if time < throw.opening_time:
                com = held_bar(throw.scene, throw.hand([time]).pose)[:, 0]
            elif time < throw.detach_time:
                since = time - throw.opening_time
                com = np.array([np.interp(since, release.times, row) for row in release.com])
            elif time < throw.landing_time - 0.05:
                com = throw.flight(np.array([time - throw.detach_time]))[:, 0]
            found += [away for _, away in self.nearest(q, com)]
        return min(found)


def test_segments_against_dense_points():
    rng = np.random.default_rng(0)
    a, b, c, d = rng.normal(size=(4, 40, 3))
    b[:5], d[5:10], b[10:15] = a[:5], c[5:10], a[10:15] + (d - c)[10:15]
    shares = np.linspace(0.0, 1.0, 301)[:, None]
    apart = segment_distance(a, b, c, d)
    for i in range(40):
        one, other = a[i] + shares * (b - a)[i], c[i] + shares * (d - c)[i]
        dense = np.linalg.norm(one[:, None] - other, axis=2).min()
        assert dense - 0.015 < apart[i] <= dense + 1e-12


def test_distance_from_solids_against_mujoco(pose):
    bar = np.array([pose.object.width / math.sqrt(2)])
    rng, points = np.random.default_rng(1), np.zeros(6)
    for _ in range(60):
        obstacle = clutter(rng)
        begin, end = rng.uniform([-0.5, -0.5, -0.5], [1.5, 0.5, 1.5], (2, 3))
        capsule = (
            f'<geom type="capsule" size="0.01" fromto="{" ".join(map(str, [*begin, *end]))}"/>'
        )
        model = mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody>{mjcf(obstacle.solid, obstacle)}{capsule}</worldbody></mujoco>"
        )
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        known = mujoco.mj_geomDistance(model, data, 0, 1, 5.0, points)
        ends = np.array([begin, end])[None, ..., None]
        body = SweptBodies(("bar",), ends, bar, np.zeros(1), np.zeros(1), flying=False)
        around = CollisionScene(pose, (KeepOut("o", obstacle.solid, 0.01 - bar[0]),), None)
        found = around.min_clearance(body)[0]
        if known > 0:
            assert found == pytest.approx(known, abs=1e-5)
        else:
            assert found < 1e-5


def test_a_solid_reaches_as_far_as_its_points():
    solid = Obstacle("o", "box", (0.2, 0.3, 0.4), (1.0, 2.0, 3.0), 0.5, 0.3).solid
    corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T * solid.half @ solid.axes
    directions = np.random.default_rng(0).normal(size=(9, 3))
    far = (directions @ (solid.centre + corners).T).max(axis=1)
    assert solid.support(directions) == pytest.approx(far)
    turned = solid.turned(0.7)
    assert turned.support(directions @ about_z(0.7).T) == pytest.approx(far)


@pytest.mark.parametrize("arm", ["pose", "fr3", "ur5e", "gen3"])
def test_capsules_move_with_the_arms_own_chain(arm):
    """The planar chain puts them where the 4x4 matrices of all joints do, the base aside."""
    scene = tp.load_scene(arm)
    x, y = 1.2 * math.cos(0.9), 1.2 * math.sin(0.9)
    scene = scene.aimed_at(scene.target.changed(x=x, y=y))
    manipulator, judge = make_manipulator(scene), Judge(scene)
    capsules = CollisionScene.of(scene, manipulator).capsules
    limits = manipulator.hard
    for q in np.random.default_rng(0).uniform(limits.q_min, limits.q_max, (5, manipulator.size)):
        list(judge.nearest(q, None))
        x, y, z = capsules.at(q[:, None])[..., 0].mean(axis=1).T
        placed = scene.target.plane.points(x, z, y)
        assert judge.data.mocap_pos[:-1] == pytest.approx(placed, abs=1e-9)


def test_a_scene_without_obstacles_builds_the_same_nlp(pose):
    scenes = pose, varied(pose, arm={"capsules": ()}), pose.replace(obstacle=(WALL,))
    assert len({nlp_of(scene).size for scene in scenes}) == 1


def in_clutter(plan: tp.Plan, rng: np.random.Generator) -> Throw:
    final = plan.throw.deciding
    obstacles = tuple(clutter(rng) for _ in range(2))
    return dataclasses.replace(final, scene=final.scene.replace(obstacle=obstacles))


@pytest.mark.parametrize("arm", ["pose", "ur5e"])
def test_the_check_misses_nothing_that_mujoco_finds(arm, free):
    """Of random clutter around one throw: what the check passes is clear in MuJoCo."""
    rng, clear, hit = np.random.default_rng(2), 0, 0
    thrown = free if arm == "pose" else tp.plan(arm)
    while min(clear, hit) < 4:
        throw = in_clutter(thrown, rng)
        worst = Judge(throw.scene).worst(throw, step=0.011)
        if contacts(throw):
            hit += 1
        else:
            clear += 1
            assert worst > -1e-6
        # What MuJoCo finds inside by more than what the check keeps for the bar's corners.
        assert worst > -0.02 or contacts(throw)


@pytest.mark.slow
def test_the_check_misses_nothing_in_500_scenes(pose):
    """Of five throws, each among a hundred random obstacles by twos, on dense samples."""
    planner, rng, hits, wrongly = tp.Planner(pose), np.random.default_rng(4), 0, 0
    for x, theta in ((1.2, 0.0), (0.9, -1.0), (1.1, 1.2), (0.7, -1.6), (1.3, 0.5)):
        plan = planner.plan(tp.Pose(x, 0.1, theta), patience=60.0)
        assert plan.solved
        for _ in range(100):
            throw = in_clutter(plan, rng)
            worst, found = Judge(throw.scene).worst(throw, 0.0047), bool(contacts(throw))
            assert found or worst > -1e-6
            hits += found
            wrongly += found and worst > 0.005
    assert 100 < hits < 400
    # The bar's capsule, and what bodies may move between samples.
    assert wrongly < 25


def test_a_throw_goes_over_a_wall(free, around):
    assert free.solved and around.solved
    hit = dataclasses.replace(free.throw.deciding, scene=around.throw.deciding.scene)
    assert {c.other for c in contacts(hit)} == {"wall"}
    assert not contacts(around.throw.deciding)
    over = Judge(hit.scene).worst(around.throw.deciding)
    assert over > max(Judge(hit.scene).worst(hit), -1e-6)


def test_an_obstacle_stands_in_the_base_frame(free, pose):
    """A wall turned with the target is met by the same throw, one that stays is not."""
    angle = 0.9
    cos, sin = math.cos(angle), math.sin(angle)
    target = dataclasses.replace(TARGET, x=1.2 * cos, y=1.2 * sin)
    turned = dataclasses.replace(WALL, position=(0.9 * cos, 0.9 * sin, 0.22), yaw=angle)
    for wall, meets in ((turned, True), (WALL, False)):
        scene = pose.replace(obstacle=(wall,), target=target)
        throw = dataclasses.replace(free.throw.deciding, scene=scene)
        assert bool(contacts(throw)) == meets


def test_no_link_is_below_the_floor_from_rest_to_rest(pose) -> None:
    """A floor that all joints, hand and bar are above, but a link's cover is not."""
    links = tuple(capsule for capsule in pose.arm.capsules if capsule.link > 2)
    padded = varied(pose, arm={"capsules": links, "cover": 0.05})
    final = tp.Planner(padded).plan(TARGET).throw.deciding
    floor = pose.workspace.floor + Judge(final.scene).worst(final) + 0.02
    assert floor < min(final.measured.arm.value, final.measured.held.value) - 0.1
    higher = varied(padded, workspace={"floor": floor})
    hit = dataclasses.replace(final, scene=higher.aimed_at(TARGET))
    assert {c.other for c in contacts(hit)} == {"floor"}
    plan = tp.Planner(higher).plan(TARGET)
    assert plan.solved and Judge(higher.aimed_at(TARGET)).worst(plan.throw.deciding) > -1e-6


def in_the_way(throw: Throw) -> Obstacle:
    """A ball in the middle of a flight."""
    at = throw.flight(np.array([throw.landing.flight_time / 2]))[:, 0]
    place = throw.target.plane.points(at[0], at[1]).tolist()
    return Obstacle("ball", "sphere", (0.03,), tuple(place))


def test_a_hand_throws_around_an_obstacle() -> None:
    scene = tp.load_scene("hand-box")
    first = tp.Planner(scene).plan().throw.deciding
    blocked = scene.replace(obstacle=(in_the_way(first),))
    assert contacts(dataclasses.replace(first, scene=blocked))
    plan = tp.Planner(blocked).plan()
    assert plan.solved and not contacts(plan.throw.deciding)


@pytest.mark.slow
def test_a_robust_throw_goes_around_an_obstacle() -> None:
    """Early and late as well."""
    scene = tp.load_scene("delay")
    first = tp.Planner(scene).plan(robust="auto").throw.deciding
    blocked = scene.replace(obstacle=(in_the_way(first),))
    assert contacts(dataclasses.replace(first, scene=blocked))
    plan = tp.Planner(blocked).plan(robust="auto")
    assert plan.solved
    for delay in (-0.01, -0.005, 0.0, 0.005, 0.01):
        assert not contacts(plan.throw.deciding.delayed(delay)), delay


def test_the_bar_may_land_on_a_table(free, pose):
    """Its top is half the bar's width under the target."""
    for top, meets in ((0.09, False), (0.3, True)):
        table = Obstacle("table", "box", (0.5, 0.6, top), (1.3, 0.0, top / 2))
        throw = free.throw.deciding
        scene = throw.scene.replace(obstacle=(table,))
        assert bool(contacts(dataclasses.replace(throw, scene=scene))) == meets


def test_the_arm_meets_itself(free, pose):
    """A motion that folds the hand onto the base is found without any obstacle."""
    manipulator, final = make_manipulator(pose), free.throw.deciding
    folded = np.array([-1.5, -2.9, 0.2])
    limits = manipulator.hard
    assert ((folded > limits.q_min) & (folded < limits.q_max)).all()
    assert not contacts(final)
    begin, still = final.path.at([0.0]).pose.T, np.zeros((1, 3))
    rate = (folded - begin) / final.until
    path = Trajectory.cubics(np.array([0.0, final.until]), begin, rate, still, still)
    words = [collision(c).words for c in contacts(dataclasses.replace(final, path=path))]
    assert any("meets link" in word or "meets base" in word for word in words)


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        (dataclasses.replace(WALL, position=(1.2, 0.0, 0.1)), "the target's pose is inside"),
        (dataclasses.replace(WALL, position=(0.3, 0.0, 0.6)), "mm from the start pose's"),
        (Obstacle("peg", "sphere", (0.005,), (0.0, -0.05, 0.3)), "obstacle peg: inside link 1"),
    ],
)
def test_an_obstacle_that_holds_target_or_start(pose, obstacle, words):
    scene = varied(pose, robot={"start": (-0.8, -2.4, 1.6)}, obstacle=(obstacle,))
    with pytest.raises(tp.InputError, match=words):
        tp.Planner(scene).plan(TARGET)


def test_a_saved_plan_keeps_its_obstacles(around, tmp_path, free_port):
    around.save(tmp_path, draw=False)
    again = tp.read_plan(tmp_path)
    assert again.scene.obstacle == (WALL,)
    assert not contacts(again)
    with serving(space_throw(again), free_port()) as (_, panel):
        assert panel


@pytest.mark.parametrize(
    ("size", "words"),
    [((0.1,), "length, width and height"), ((0.1, 0.1, -0.1), "above 0"), ((), "length, width")],
)
def test_sizes_that_are_none(size, words):
    with pytest.raises(tp.InputError, match=words):
        Obstacle("o", "box", size, (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("kind", "size"), [("box", (0.2, 0.3, 0.4)), ("sphere", (0.2,)), ("capsule", (0.1, 0.5))]
)
def test_outline_encloses_the_side_view(kind, size):
    solid = Obstacle("o", kind, size, (0.5, 0.1, 0.4), 0.4, 0.6).solid
    low, high = solid.outline(360).min(axis=0), solid.outline(360).max(axis=0)
    ways = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    assert high == pytest.approx(solid.support(ways), abs=1e-6)
    assert -low == pytest.approx(solid.support(-ways), abs=1e-6)
