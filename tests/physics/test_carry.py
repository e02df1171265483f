"""Fails if the grip's use or a joint's torque in space is not MuJoCo's, or if the verdict on a
carry misses a limit that it breaks, between samples too."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
import throwplan as tp
from builders import inertia_matrix, swinging, varied
from throwplan.models import PinchContact, pinch_use
from throwplan.planner.throw import Samples, friction_use, make_manipulator
from throwplan.planner.verdict import BAR, Code, SpatialScene, Verdict, grip_use, motion_verdict
from throwplan.problems import Obstacle
from throwplan.robots import joint_motion

from oracle.clearance import Solid
from oracle.cycles import Carried
from oracle.motion import frames_of


def space_of(scene: tp.Scene) -> SpatialScene:
    return SpatialScene(scene, make_manipulator(scene))


def judged(scene: tp.Scene, samples: Samples, held: bool = True) -> Verdict:
    return motion_verdict(space_of(scene), samples, held=held)


def leaning(name: str) -> tp.Scene:
    """The scene's bar is thick, grasped beside its end and at an angle."""
    return varied(tp.load_scene(name), object={"width": 0.05}, grasp={"angle": 0.4, "offset": 0.02})


def states(name: str, times: np.ndarray) -> tuple[np.ndarray, ...]:
    """All joints of a scene's arm swing: q, dq, ddq (N, joints)."""
    return swinging(name, every=True).joints.at(times)


def in_pads(scene: tp.Scene) -> tuple[np.ndarray, np.ndarray]:
    """CoM (3,) and inertia (3, 3) of the bar in the pads' frame, from the posture of a throw."""
    pads = scene.arm.placed(scene.arm.posture)[-1]
    theta = math.atan2(pads[2, 2], pads[0, 2]) + scene.grasp.angle
    along = pads[:3, :3].T @ [math.cos(theta), 0.0, math.sin(theta)]
    bar = scene.object
    tensor = bar.inertia * np.eye(3)
    tensor += (bar.mass * bar.width**2 / 6 - bar.inertia) * np.outer(along, along)
    return scene.com_offset * along, tensor


def hand_parts(scene: tp.Scene, vectors: np.ndarray) -> np.ndarray:
    """Vectors (3, N) in the pads' frame: along the hand, across it, along the pads' normal."""
    pads = scene.arm.placed(scene.arm.posture)[-1]
    along, across, normal = np.eye(3)[2], np.array([-pads[2, 2], 0.0, pads[0, 2]]), [0.0, -1.0, 0.0]
    return np.array([along, pads[:3, :3].T @ across, pads[:3, :3].T @ normal]) @ vectors


def expected_use(scene: tp.Scene, force: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Use of the grip by wrenches (3, N) in the pads' frame."""
    full = scene.gripper.profile().full
    parts = hand_parts(scene, force), hand_parts(scene, torque)
    return pinch_use(scene.patch, *parts, full).use


@pytest.mark.parametrize("name", ["gen3", "ur5e"])
def test_grip_and_torques_are_those_of_mujoco(name: str) -> None:
    """Its inverse dynamics of the arm's links with the bar welded to the hand.

    MuJoCo refuses the Panda's third link: no body has its published inertia.
    """
    scene, times = leaning(name), np.linspace(0.02, 0.38, 9)
    arm, (com, inertia) = scene.arm, in_pads(scene)
    spec = mujoco.MjSpec()
    spec.option.gravity = [0.0, 0.0, -scene.gravity]
    at_zero = [np.eye(4), *arm.placed([0.0] * arm.joints)]
    hand = at_zero[-1].copy()
    hand[:3, 3] -= arm.tool.tcp * hand[:3, 2]
    poses = [*at_zero[1 : arm.joints + 1], hand, at_zero[-1]]
    bodies = [(link.mass, link.com, inertia_matrix(link)) for link in arm.links]
    parent, before = spec.worldbody, np.eye(4)
    carried = scene.object.mass, com, inertia
    for i, (pose, body) in enumerate(zip(poses, (*bodies, carried), strict=True)):
        step, quat = np.linalg.solve(before, pose), np.empty(4)
        mujoco.mju_mat2Quat(quat, step[:3, :3].ravel())
        parent, before = parent.add_body(name=f"b{i}", pos=step[:3, 3], quat=quat), pose
        parent.mass, parent.ipos, tensor = body
        parent.explicitinertial = True
        parent.fullinertia = [*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]]
        if i < arm.joints:
            parent.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    sensors = {"force": mujoco.mjtSensor.mjSENS_FORCE, "torque": mujoco.mjtSensor.mjSENS_TORQUE}
    parent.add_site(name="pads")
    for sensor, kind in sensors.items():
        spec.add_sensor(name=sensor, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="pads")
    model = spec.compile()
    data, rows = mujoco.MjData(model), states(name, times)
    measured, torques = [], []
    for state in zip(*rows, strict=True):
        data.qpos, data.qvel, data.qacc = state
        mujoco.mj_inverse(model, data)
        measured.append([data.sensor(sensor).data.copy() for sensor in sensors])
        torques.append(data.qfrc_inverse.copy())
    force, torque = np.array(measured).transpose(1, 2, 0)
    found = grip_use(space_of(scene), Samples(*rows))
    np.testing.assert_allclose(found.use, expected_use(scene, force, torque), rtol=1e-9)
    # What the joints bear, by the largest use of their limits that the verdict names.
    weak = varied(scene, {"torque": (1e-3,) * arm.joints})
    shares = np.abs(torques).max(axis=0) / 1e-3
    named = {f.body: f.value for f in judged(weak, Samples(*rows)).broken if f.code is Code.TORQUE}
    for joint, share in enumerate(shares, start=1):
        assert named[f"joint {joint}"] == pytest.approx(share, rel=1e-9)


# The pinch.

CONTACT = PinchContact(0.9, 0.004, 0.6, 2)
FULL = 80.0


def wrenches(count: int, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Random forces [N] and torques [N m] (3, count) in the hand's axes."""
    rows = np.random.default_rng(5).normal(size=(6, count))
    return size * 50.0 * rows[:3], size * 0.2 * rows[3:]


@pytest.mark.parametrize("azimuth", [0.0, 0.7])
def test_in_the_throw_s_plane_it_is_the_throw_s_grip_use(planner_of, azimuth: float) -> None:
    planner = planner_of("pose")
    x = planner.scene.target.x
    target = tp.Pose(x * math.cos(azimuth), planner.scene.target.z, 0.0, y=x * math.sin(azimuth))
    motion = joint_motion(planner.plan(target))
    throw, samples = motion.throw, motion.samples
    found = grip_use(space_of(throw.scene), samples)
    expected = friction_use(throw.scene, throw.hand(throw.samples.times))
    assert expected.max() > 0.5
    np.testing.assert_allclose(found.use, expected, atol=1e-9)
    assert max(found.tilting.max(), found.lifting.max()) < 1e-9


def test_single_loads_hold_up_to_their_limits() -> None:
    """Two pads of 80 N: 144 N of friction, 160 N across, 4 mm of lever out of the plane."""
    pads = 2 * FULL
    limits = {
        0: 0.9 * pads, 1: 0.9 * pads, 2: pads, 3: 0.004 * pads, 4: 0.004 * pads,
        5: 0.6 * 0.004 * 0.9 * pads,
    }  # fmt: skip
    for row, limit in limits.items():
        wrench = np.zeros((6, 1))
        wrench[row] = limit
        assert pinch_use(CONTACT, wrench[:3], wrench[3:], FULL).use[0] == pytest.approx(1.0)


def test_pads_of_points_bear_what_the_use_allows() -> None:
    """A linear program of what two pads bear as points that press and rub, without adhesion.

    Points on both patches, the force of both pads in all, friction at each within an octagon
    inside Coulomb's cone.
    """
    from scipy.optimize import linprog

    contact = dataclasses.replace(CONTACT, torsion=0.5)
    angles = np.arange(8) * math.pi / 4
    rings = [(r, a) for r in (0.0, 0.4, 0.7, 0.9, 1.0) for a in angles]
    points = [(0.004 * r * math.cos(a), 0.004 * r * math.sin(a)) for r, a in rings]
    columns, press = [], []
    for side in (1.0, -1.0):
        for x, y in points:
            # Pads at one place along their normal: their thickness is left out.
            lever = np.array([x, y, 0.0])
            for a in angles:
                rub = 0.9 * np.array([math.cos(a), math.sin(a), 0.0]) + [0.0, 0.0, -side]
                columns.append(np.concatenate([rub, np.cross(lever, rub)]))
                press.append(1.0)
    force, torque = wrenches(60)
    scale = np.cos(math.pi / 8)
    for f, t, use in zip(
        force.T, torque.T, pinch_use(contact, force, torque, FULL).use, strict=True
    ):
        wrench = np.concatenate([f, t]) / use * scale
        found = linprog(press, A_eq=np.array(columns).T, b_eq=wrench, method="highs")
        assert found.status == 0 and found.fun <= 2 * FULL * (1 + 1e-9)


# The verdict.


def turning(base: float, seconds: float = 0.4) -> Samples:
    """The Panda, hand down, turns its base by `base` [rad] from rest to rest."""
    t = np.linspace(0.0, 1.0, round(seconds / 1e-3) + 1)[:, None]
    start, way = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785]), np.eye(7)[0] * base
    shape = (np.polynomial.Polynomial([0, 0, 0, 10, -15, 6]).deriv(k)(t) for k in range(3))
    q, dq, ddq = (s * way / seconds**k for k, s in enumerate(shape))
    return Samples(start + q, dq, ddq)


def test_a_slow_way_is_held_and_a_fast_one_turns_the_object() -> None:
    scene, way = tp.load_scene("pose"), turning(0.2, seconds=0.3)
    weak = varied(scene, gripper={"force": 30.0})
    assert judged(weak, turning(0.1)).ok and judged(weak, way, held=False).ok
    (found,) = judged(weak, way).broken
    assert found.code is Code.CARRY and found.body == "tilting out of the pads' plane"
    use = grip_use(space_of(weak), way).use
    # It may be found between two samples.
    assert 1.0 < use.max() <= found.value < 1.001 * use.max()
    assert abs(found.time - 1e-3 * use.argmax()) <= 1e-3


def hammer() -> tp.Scene:
    """A hammer with an outline: its head across, its handle along."""
    scene = tp.load_scene(Path(__file__).parents[2] / "examples" / "objects" / "hammer.toml")
    return scene.replace(obstacle=())


def head_and_handle(scene: tp.Scene, q: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Points (200, 3) along the axes of the outline's capsules, and their radii, at joints (n,)."""
    com, _ = in_pads(scene)
    pads = scene.arm.placed(scene.arm.posture)[-1]
    along = com / scene.com_offset
    # A quarter turn in the throw's plane, from x to z.
    x, _, z = pads[:3, :3] @ along
    across, begin = pads[:3, :3].T @ [-z, 0.0, x], com - scene.object.com * along
    pose, share = scene.arm.placed(q.tolist())[-1], np.linspace(0.0, 1.0, 200)[:, None]
    found = []
    for part in scene.object.outline:
        ends = [begin + e[0] * along + e[1] * across for e in (part.begin, part.end)]
        points = ends[0] + share * (ends[1] - ends[0])
        found.append((points @ pose[:3, :3].T + pose[:3, 3], part.radius))
    return found


def test_every_part_of_an_outline_is_kept_clear() -> None:
    scene, q = hammer(), states("pose", np.array([0.15]))[0]
    parts = head_and_handle(scene, q[0])
    still = Samples(np.repeat(q, 50, axis=0), *np.zeros((2, 50, q.shape[1])))
    lowest = min(float(points[:, 2].min()) - radius for points, radius in parts)
    found = judged(varied(scene, workspace={"floor": lowest + 0.01}), still)
    held = [f.value for f in found.broken if f.code is Code.FLOOR and f.body == BAR]
    assert held[0] == pytest.approx(lowest, abs=1e-9)
    away = [np.hypot(points[:, 0], points[:, 1]).min() - radius for points, radius in parts]
    column = {"column_radius": min(away) + 0.01, "column_height": 5.0}
    found = judged(varied(scene, workspace=column), still)
    (room,) = [f.value for f in found.broken if f.code is Code.COLUMN]
    assert room == pytest.approx(-0.01, abs=1e-3)
    # A ball at one end of the head meets an object with a head, and no bar.
    x, y, z = map(float, parts[0][0][0])
    ball = tp.Obstacle(name="ball", kind="sphere", size=(0.005,), position=(x, y, z))
    thin = {"outline": (), "width": 0.01, "mesh": None}
    for thing, meets in ((scene, True), (varied(scene, object=thin), False)):
        codes = judged(thing.replace(obstacle=(ball,)), still).codes
        assert (Code.COLLISION in codes) == meets


def test_limits_of_joints_tool_and_torques_are_found() -> None:
    scene, way = tp.load_scene("pose"), turning(1.2)
    codes = judged(scene, way, held=False).codes
    assert {Code.JOINT_VELOCITY, Code.JOINT_ACCELERATION, Code.TOOL_SPEED} <= codes
    rate = scene.replace(torque=tp.Torque(rate=2.0))
    assert Code.TORQUE_RATE in judged(rate, turning(0.1)).codes


def test_limits_that_are_broken_for_a_moment_are_found() -> None:
    """The torque's with its margin; column's and floor's between the extremes of a swing."""
    scene, swing = tp.load_scene("pose"), Samples(*states("pose", 1e-3 * np.arange(300)))
    weak = judged(varied(scene, {"torque": (1e-3,) * 7}), swing).broken
    peaks = [1e-3 * f.value / 0.95 for f in weak if f.code is Code.TORQUE]
    strong = varied(scene, {"torque": tuple(peaks), "torque_rate": None}, torque=None)
    for margin, broken in ((0.0, False), (0.1, True)):
        found = judged(strong.replace(torque=tp.Torque(margin=margin)), swing).codes
        assert (Code.TORQUE in found) == broken
    space = space_of(scene)
    pads = space.spatial.pads(*swing.rows)
    away, height = space.column_distance(pads, 0.0, 5.0), pads.pose[:, 2, 3] - 0.3
    for code, key, values in ((Code.COLUMN, "column_radius", away), (Code.FLOOR, "floor", height)):
        middle = {key: float(values.min() + values.max()) / 2, "column_height": 5.0}
        assert code in judged(varied(scene, workspace=middle), swing).codes
    near = {"column_radius": float(away.min()) - 0.01, "column_height": 5.0}
    assert Code.COLUMN not in judged(varied(scene, workspace=near), swing).codes


# Between samples.


@pytest.fixture(scope="module")
def carry(plan_of) -> tuple[SpatialScene, Samples]:
    """From rest to the last sample before the pads open."""
    motion = joint_motion(plan_of("pose"))
    one = motion.carries[0]
    return one.space, motion.samples[one.held : math.floor(1e3 * one.opening_time) + 1]


def test_the_grip_is_judged_between_samples_too() -> None:
    """The jerk of a joint changes in the middle between two samples: there it accelerates most."""
    scene = tp.load_scene("pose")
    space, jerk, tick = space_of(scene), 6000.0, 1e-3
    joints = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785])
    # Up in half a tick and down in the other, from the second sample to the third.
    ddq = np.zeros((3, 7))
    dq, q = np.zeros((3, 7)), np.tile(joints, (3, 1))
    peak = jerk * tick / 2
    dq[2, 0] = peak * tick / 2
    q[2, 0] += peak * tick**2 / 4
    samples = Samples(q, dq, ddq)
    at_samples, path = grip_use(space, samples).use.max(), samples.path.at(np.array([1.5e-3]))
    between = grip_use(space, Samples(*(rows.T for rows in path))).use.max()
    assert between > 1.02 * at_samples
    weaker = varied(scene, gripper={"force": 70.0 * (at_samples + between) / 2})
    assert Code.CARRY in judged(weaker, samples).codes
    enough = varied(scene, gripper={"force": 70.0 * 1.001 * between})
    assert Code.CARRY not in judged(enough, samples).codes


@pytest.mark.parametrize(("kind", "size"), [("sphere", (0.02,)), ("box", (0.03, 0.05, 0.02))])
@pytest.mark.parametrize(("room", "ok"), [(0.003, True), (-0.0005, False)])
def test_a_fast_motion_passes_as_near_as_the_clearance(kind, size, room, ok, carry) -> None:
    """Distances are those of the path, not of the places that bodies have every 10 ms."""
    space, samples = carry
    thing = Carried.of(space.scene)
    frames = frames_of(space.kinematics.arm, samples.q, samples.dq, samples.ddq)
    fastest = int(np.linalg.norm(frames[-1].v, axis=1).argmax())
    (end, _), *_ = thing.capsules
    tip = frames[-1].point(end[1])[0][fastest]
    place = tip + 0.1 * frames[-1].axes[fastest, :, 1]
    turn = (0.4, 0.6) if kind == "box" else (0.0, 0.0)
    post = Obstacle("post", kind, size, tuple(place.tolist()), *turn)
    (axis, radius), *_ = thing.placed(frames[-1])
    away = Solid.of(post).distance(*axis).min() - radius
    post = dataclasses.replace(post, clearance=float(away - room))
    scene = space.scene.replace(obstacle=(post,))
    assert judged(scene, samples).ok == ok


def test_a_held_bar_s_distance_from_the_column_is_that_of_all_its_points() -> None:
    """Of bars at random in space, long ones too: 2,000 points along each."""
    scene = varied(tp.load_scene("pose"), object={"length": 0.8, "com": 0.4, "width": 0.05})
    space = space_of(scene)
    q = np.random.default_rng(0).uniform(-2.5, 2.5, (400, scene.arm.joints))
    pads = space.spatial.pads(q, 0 * q, 0 * q)
    first, last = space.held_ends(pads)[0]
    points = first + np.linspace(0.0, 1.0, 2001)[:, None, None] * (last - first)
    away = np.hypot(points[:, 0], points[:, 1]) - 0.06
    expected = np.maximum(away, points[:, 2] - 0.45).min(axis=0) - 0.025
    found = space.column_distance(pads, 0.06, 0.45)
    assert found == pytest.approx(expected, abs=2e-4) and (found <= expected + 1e-9).all()
    assert (expected < 0.0).any() and (expected > 0.3).any()


def test_an_empty_hand_stays_above_the_floor() -> None:
    """Also of an arm whose data have no shapes."""
    scene = tp.load_scene("pose")
    scene = scene.replace(arm=dataclasses.replace(scene.arm, capsules=()))
    q = states("pose", np.array([0.1]))[0]
    still = Samples(np.repeat(q, 50, axis=0), *np.zeros((2, 50, q.shape[1])))
    height = space_of(scene).spatial.pads(*still.rows).pose[0, 2, 3]
    for above in (-0.01, 0.01):
        found = judged(varied(scene, workspace={"floor": float(height) + above}), still, held=False)
        broken = [(f.body, f.value) for f in found.broken if f.code is Code.FLOOR]
        assert broken == ([("hand", pytest.approx(height))] if above > 0 else [])
