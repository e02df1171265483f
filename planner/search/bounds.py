"""Formulas that prove that nothing reaches a target.

Without one, a search that finds no throw says nothing about the world.
"""

from __future__ import annotations

import math

import numpy as np

from ...models.robot import PlanarArm
from ...problems import Pose, Scene
from ..result import Bound
from ..throw import Manipulator, column_of
from ..verdict import column_distance, reach_of_bar

#: Poses of the target that are looked at, in x and in theta.
GRID = 181


def bound_of(scene: Scene, manipulator: Manipulator, target: Pose) -> Bound | None:
    """The bound that proves that no throw lands within the tolerance of the target; None without.

    The object is inside the base column there; it is higher than any throw rises, v^2 / 2g above
    the highest place where the pads can let go; or farther than any throw from there flies,
    v / g sqrt(v^2 + 2 g h) for a fall of h.
    """
    if (room := _room_in_column(scene, target)) is not None and room < 0.0:
        return Bound("base column", "overlap with the object at the target", -room)
    (x, z, reach), speed = _reach(scene, manipulator), _fastest(scene, manipulator)
    away = reach + speed * scene.gripper.profile().opening
    high, g = z + away, scene.gravity
    if g <= 0.0:
        return None
    top = high + speed**2 / (2 * g)
    if target.z > top:
        words = f"highest place of letting go {high:.2f} m + v^2 / 2g, v = {speed:.2f} m/s"
        return Bound("landing height", words, top)
    far = away + speed / g * math.sqrt(speed**2 + 2 * g * (high - target.z))
    off = abs(target.plane_x - x) - target.half_widths[0] - scene.tolerance.position
    off -= abs((scene.flight.bias or (0.0, 0.0))[0])
    if off > far:
        words = f"reach {away:.2f} m + v / g sqrt(v^2 + 2 g h), v = {speed:.2f} m/s"
        return Bound("landing distance", words, far)
    return None


def _room_in_column(scene: Scene, target: Pose) -> float | None:
    """Room [m] between the object and the base column, at best of all poses that the tolerance
    allows, below 0 where they overlap; None without a column."""
    column, most = column_of(scene), scene.tolerance
    if column is None:
        return None
    dx, turn = target.half_widths
    turn = math.pi if target.theta is None else turn
    x = target.plane_x + dx * np.linspace(-1.0, 1.0, GRID if dx else 1)
    theta = (target.theta or 0.0) + turn * np.linspace(-1.0, 1.0, GRID if turn else 1)
    x, theta = np.array(np.meshgrid(x, theta)).reshape(2, -1)
    poses = np.array([x, np.full(x.size, target.z), theta])
    room = float(column_distance(scene.object, poses, *column).max())
    # Between two poses of the grid there may be more room.
    between = (dx + reach_of_bar(scene.object) * turn) / (GRID - 1)
    return room + between + most.position + most.angle * reach_of_bar(scene.object)


def _reach(scene: Scene, manipulator: Manipulator) -> tuple[float, float, float]:
    """Centre x, z and radius [m] of a circle that has the held object's CoM in all poses."""
    kinematics, limits = manipulator.kinematics, manipulator.hard
    held = abs(scene.com_offset)
    if isinstance(kinematics, PlanarArm):
        links = sum(math.hypot(*link) for link in kinematics.links)
        return (*kinematics.origin, links + held)
    (x, z), half = (limits.q_min + limits.q_max)[:2] / 2, np.ptp([limits.q_min, limits.q_max], 0)
    return float(x), float(z), float(np.hypot(*half[:2]) / 2) + held


def _fastest(scene: Scene, manipulator: Manipulator) -> float:
    """The highest speed [m/s] of the object's CoM at detach.

    That of the pads' centre, plus that of the CoM about it. In a frame that moves with the pads'
    centre friction takes energy, but for what its torque does as the hand turns; the frame's
    acceleration and gravity add to the speed in proportion to the opening time.
    """
    limits, body, patch = manipulator.hard, scene.body, scene.patch
    kinematics, grip = manipulator.kinematics, scene.gripper.profile()
    if isinstance(kinematics, PlanarArm):
        lengths = [math.hypot(*link) for link in kinematics.links]
        # Of each joint, the farthest that the pads' centre can be from it.
        levers = np.cumsum(lengths[::-1])[::-1]
        turn, speed = float(limits.dq.sum()), float(levers @ limits.dq)
        pull = float(levers @ limits.ddq) + turn * speed
    else:
        turn = float(limits.dq[2]) if manipulator.turns else 0.0
        speed, pull = (float(np.hypot(*most[:2])) for most in (limits.dq, limits.ddq))
    if scene.tool_speed is not None:
        speed = min(speed, scene.tool_speed)
    squared = body.com_offset**2 + body.inertia / body.mass
    # The grip force falls while the pads open: this counts all of it.
    twisting = patch.torsion_arm * patch.force_limit(grip.full) * turn * grip.opening
    about = math.sqrt(turn**2 * squared + 2 * twisting / body.mass)
    return speed + about + (pull + scene.gravity) * grip.opening
