"""The way to a motion's start pose: slow, within the arm's limits, and clear of all around it."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np

from ...models import Array
from ...models.robot import Arm
from ...problems import InputError, ThrowPlane
from ..clearance import (
    BAR,
    CollisionScene,
    SweptBodies,
    bar_ends,
    held_bar,
)
from ..throw import (
    TICK,
    Samples,
    joint_limits,
    within_limits,
)
from ..verdict import Code, Finding, collision
from .controllers import JointMotion

#: Shares of the limits on rate, acceleration and jerk of the way to the start pose.
SLOWLY = (0.2, 0.1, 0.1)
#: These shares are halved up to this number of times, until position-dependent limits hold.
HALVINGS = 6
#: Ticks between the samples at which clearances are measured; motion in between counts, too.
MEASURED = 10


def approach(motion: JointMotion, start: Array) -> Array:
    """All joints (N, joints) [rad] every millisecond, slowly from rest at `start` to the motion's.

    Straight, or else by a raised pose: the shoulder in the middle of its range, other joints as in
    the start pose. InputError if neither keeps the arm's limits, or if arm or held bar would come
    too close to the floor, an obstacle, or each other.
    """
    arm, goal = motion.arm, motion.q[0]
    raised, shoulder = goal.copy(), arm.throwing_joints[0] - 1
    raised[shoulder] = (arm.limits.position_min[shoulder] + arm.limits.position_max[shoulder]) / 2
    straight = _straight(arm, start, goal)
    collision_words = _collision(motion, straight)
    if not collision_words:
        return straight
    way = np.vstack([_straight(arm, start, raised), _straight(arm, raised, goal)[1:]])
    if _collision(motion, way):
        raise InputError(
            f"the way to the start pose is not clear: {collision_words}: guide the arm nearer to it"
        )
    return way


def _straight(arm: Arm, start: Array, goal: Array) -> Array:
    """Joints (N, joints) from rest to rest within all limits; InputError if there are none."""
    import ruckig

    n, limits = arm.joints, joint_limits(arm, range(1, arm.joints + 1))
    order, trajectory = ruckig.InputParameter(n), ruckig.Trajectory(n)
    order.current_position, order.target_position = start.tolist(), goal.tolist()
    for share in 0.5 ** np.arange(HALVINGS):
        order.max_velocity, order.max_acceleration, order.max_jerk = (
            (share * part * limit).tolist()
            for part, limit in zip(SLOWLY, (limits.dq, limits.ddq, limits.jerk), strict=True)
        )
        if ruckig.Ruckig(n).calculate(order, trajectory) != ruckig.Result.Working:
            break
        times = np.arange(0.0, trajectory.duration + TICK, TICK)
        states = np.array([trajectory.at_time(min(t, trajectory.duration)) for t in times])
        rows = np.moveaxis(states, 1, 0)
        # Joint by joint: an arm may have more joints than the core takes at once.
        if all(
            within_limits(joint_limits(arm, [j + 1]), Samples(*rows[:, :, j : j + 1]))
            for j in range(n)
        ):
            return states[:, 0]
    raise InputError("the way to the start pose breaks a limit: guide the arm nearer to it")


def _collision(motion: JointMotion, q: Array) -> str:
    """The first collision on a way (N, joints) to the start pose, in words; empty without one."""
    scene, capsules = motion.throw.scene, motion.throw.manipulator.capsules
    if capsules is None:
        return ""
    # The first link turns about its own axis; the flange turns with the hand.
    moved = (min(number, motion.arm.joints) - 1 for number in capsules.number)
    obstacles = dataclasses.replace(
        CollisionScene.of(scene, motion.throw.manipulator, ThrowPlane(0.0, 0.0)),
        arm=dataclasses.replace(capsules, moved_by=tuple(joint or -1 for joint in moved)),
    )
    places = np.unique(np.append(np.arange(0, len(q), MEASURED), len(q) - 1))
    track = _track(motion, q[places], TICK * places)
    for found in obstacles.clearances(track):
        return collision(found).words
    floor = None if scene.workspace is None else scene.workspace.floor
    if floor is None:
        return ""
    clearance = track.ends[-1, :, 2].min(axis=0) - track.radius[-1] - floor
    # At the start of a throw the capsule around the bar may be below the floor.
    lowest = (clearance - min(clearance[-1], 0.0)).min()
    return "" if lowest >= -1e-6 else Finding(Code.FLOOR, floor + lowest, floor, body=BAR).words


def _track(motion: JointMotion, q: Array, times: Array) -> SweptBodies:
    """Links, hand and held bar in the base frame, with joints q (N, joints) at times (N,) [s]."""
    throw, arm, capsules = motion.throw, motion.arm, motion.throw.manipulator.capsules
    assert capsules is not None
    angles = ca.SX.sym("q", arm.joints)
    frames = arm.frames(angles)
    hand = frames[-1] + 0
    hand[:3, 3] -= arm.tool.tcp * hand[:3, 2]
    links = ca.Function("links", [angles], [ca.vec(f) for f in (*frames[: arm.joints], hand)])
    # (links, N, 4, 4), the base first.
    found = [np.array(v).T.reshape(-1, 4, 4).swapaxes(1, 2) for v in links.map(len(q))(q.T)]
    at = np.array([np.broadcast_to(np.eye(4), (len(q), 4, 4)), *found])
    # The throw's start gives the pose of the bar in the hand.
    place = throw.path.at([0.0]).pose
    pose = throw.manipulator.motion(place, 0 * place, 0 * place)[0]
    ends = bar_ends(throw.scene.object, held_bar(throw.scene, pose))[0, :, :, 0]
    bar = throw.target.plane.points(ends[:, 0], ends[:, 2])
    grasp = np.array(links(motion.q[0])[-1]).reshape(4, 4, order="F")
    local = (bar - grasp[:3, 3]) @ grasp[:3, :3]
    bodies = [(c.link, np.array([c.begin, c.end])) for c in arm.capsules] + [(-1, local)]
    placed = [
        np.einsum("nij,kj->kin", at[link][:, :3, :3], two) + at[link][:, :3, 3].T
        for link, two in bodies
    ]
    width = throw.scene.object.width / np.sqrt(2)
    cover = np.append(np.full(len(arm.capsules), arm.cover), 0.0)
    radius = np.append(capsules.radius, width)
    return SweptBodies((*capsules.names, BAR), np.array(placed), radius, cover, times)
