"""Loads of a motion with the held object on the grip and on an arm's throwing joints."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np

from ...core import Structure
from ...models import Array, HandSamples, Trajectory, held_wrench, read_only
from ...models.release import Release
from ...models.robot import PlanarArm, PlanarDynamics
from ...problems import Scene, Torque
from .manipulator import Manipulator
from .sent_samples import TICK

_dynamics = lru_cache(maxsize=8)(PlanarDynamics)


def friction_use(scene: Scene, hand: HandSamples) -> Array:
    """Use (K,) of the full grip's limit surface by a held bar; above 1 it slips."""
    wrench = held_wrench(scene.body, scene.gravity, hand.motion, scene.grasp.angle)
    full = scene.gripper.profile().full
    use = scene.patch.utilisation_squared(*wrench, full)
    return np.asarray(np.sqrt(use))


def torque_limits(scene: Scene) -> Array | None:
    """Limits (n,) [N m] of an arm's throwing joints; None without an arm or its masses."""
    limits = _limits(scene)
    return None if limits is None else np.array(limits)


def _limits(scene: Scene) -> tuple[float, ...] | None:
    robot, arm = scene.robot, scene.arm
    if robot is None or arm is None or not arm.links:
        return None
    section = scene.torque or Torque()
    return section.of(arm, robot.throwing_joints or arm.throwing_joints)


def torque_uses(scene: Scene, manipulator: Manipulator, path: Trajectory, opening: float) -> Array:
    """Share (N, n) of the joints' torque limits at every sample of a motion whose grip force starts
    to fall at `opening` [s].

    The object is held until then; while the pads open the hand may bear all of it or nothing.
    """
    limits, times = torque_limits(scene), np.arange(0.0, path.end + TICK / 2, TICK)
    assert limits is not None
    hand, detach = manipulator.hand(path).at(times), opening + scene.gripper.profile().opening
    load = held_wrench(scene.body, scene.gravity, hand.motion, scene.grasp.angle)
    held, free = (
        np.abs(_torques(scene, manipulator, path.at(times), on).T) * where[:, None]
        for on, where in ((load, times <= detach), (None, times >= opening))
    )
    return np.asarray(np.maximum(held, free) / limits)


def load_torques(
    scene: Scene, manipulator: Manipulator, path: Trajectory, times: Array
) -> tuple[Array, Array]:
    """Torques (n, K) [N m] with an empty hand at times (K,) [s], and how they grow (3, n, K) with
    force along x, along z [per N] and torque [per N m] that the hand gives to an object."""
    motion = path.at(times)
    free = _torques(scene, manipulator, motion, None)
    units = np.eye(3)[..., None] * np.ones(len(times))
    return free, np.array([_torques(scene, manipulator, motion, u) - free for u in units])


def load_steps(
    scene: Scene, manipulator: Manipulator, path: Trajectory, opening: float, release: Release
) -> Array:
    """Largest change (n,) [N m] within `TICK` of the torques by which the object loads the joints,
    from the start of the opening at `opening` [s] to its end.

    The load is the rate of the released object's momentum. It falls steeply: friction holds the
    full weight until little of the grip force is left.
    """
    gravity, body = np.array([0.0, scene.gravity]), scene.body
    times, middle = release.times, (release.times[1:] + release.times[:-1]) / 2
    change = np.diff(release.com_twist, axis=1) / np.diff(times)
    f_x, f_z = body.mass * (change[:2] + gravity[:, None])
    hand = manipulator.hand(path).at(opening + middle)
    x_r, z_r = (release.com[:2, 1:] + release.com[:2, :-1]) / 2 - hand.pose[:2]
    wrench = np.array([f_x, f_z, body.inertia * change[2] - f_x * z_r + f_z * x_r])
    _, by_force = load_torques(scene, manipulator, path, opening + middle)
    torques = np.einsum("wjk,wk->jk", by_force, wrench)
    # Held before, empty after.
    knots = np.concatenate([[0.0], middle, [times[-1]]])
    torques = np.column_stack([torques[:, 0], torques, np.zeros(len(torques))])
    begin = np.arange(-TICK, times[-1], TICK / 20)
    loads = [[np.interp(begin + late, knots, row) for late in (0.0, TICK)] for row in torques]
    return read_only(np.abs(np.diff(loads, axis=1)).max(axis=(1, 2)))


def rest_torques(scene: Scene, manipulator: Manipulator, q: Array, *, held: bool) -> Array:
    """Torques (n, K) [N m] that hold the arm at rest at coordinates q (n, K), with the object or
    with an empty hand."""
    still = np.zeros_like(q)
    load = None
    if held:
        hand = HandSamples(np.zeros(q.shape[1]), *manipulator.motion(q, still, still))
        load = held_wrench(scene.body, scene.gravity, hand.motion, scene.grasp.angle)
    return _torques(scene, manipulator, (q, still, still), load)


def _torques(scene: Scene, manipulator: Manipulator, motion: Iterable[Array], load: Any) -> Array:
    """Torques (n, K) [N m] for coordinates, rates and accelerations, each (n, K); load: as of
    `PlanarDynamics.torques`."""
    kinematics = manipulator.kinematics
    assert isinstance(kinematics, PlanarArm)
    angles, rates, turns = map(kinematics.link_angles, motion)
    torques = _dynamics(kinematics).torques(angles, rates, turns, scene.gravity, load)
    return np.array(torques)


def core_torques(scene: Scene, manipulator: Manipulator) -> Structure | None:
    """The arm's masses and limits as the compiled core takes them; None without limits."""
    kinematics, limits = manipulator.kinematics, _limits(scene)
    if limits is None or not isinstance(kinematics, PlanarArm):
        return None
    return _core_torques(kinematics, limits)


@lru_cache(maxsize=8)
def _core_torques(kinematics: PlanarArm, limits: tuple[float, ...]) -> Structure:
    found = Structure("torques")
    for i, body in enumerate(_dynamics(kinematics).bodies):
        found.mass[i], found.inertia[i], found.limit[i] = body.mass, body.inertia, limits[i]
        found.along[i], found.up[i] = body.com
    return found
