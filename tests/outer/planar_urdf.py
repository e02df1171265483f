"""A planar throwing arm as a URDF whose frames lie as oddly as a URDF allows."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

#: In the world at rest: where the joints are (x, z) [m], and their axes.
PLACES = np.array([[0.0, 0.2], [0.05, 0.4], [0.45, 0.5], [0.8, 0.35]])
AXES = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
#: The tool link's origin (x, z) [m] and where the hand points, as an angle in the plane.
TOOL, POINTS = np.array([0.95, 0.3]), -0.4
JOINTS = ["turn", "lift", "bend", "flick"]
ODD_OPTIONS = [
    *["--tool", "hand", "--approach=-x", "--closing", "z", "--tcp", "0.08"],
    *["--acceleration", "10", "--jerk", "1000"],
]
XACRO = 'xmlns:xacro="http://ros.org/xacro"'


def point(place: np.ndarray) -> np.ndarray:
    return np.array([place[0], 0.0, place[1]])


def screw(axis: np.ndarray, through: np.ndarray, angle: float) -> np.ndarray:
    """4x4: the turn about an axis through a point."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(angle * axis).as_matrix()
    pose[:3, 3] = through - pose[:3, :3] @ through
    return pose


def moved(q: np.ndarray, joints: int) -> np.ndarray:
    """4x4: how the first `joints` joints move what is on them, by products of screws."""
    pose = np.eye(4)
    for axis, place, angle in zip(AXES[:joints], PLACES[:joints], q[:joints], strict=True):
        pose = pose @ screw(axis, point(place), angle)
    return pose


def hand_pose(q: np.ndarray, tcp: float) -> np.ndarray:
    """4x4: the pads' centre, z where the hand points, y across the plane."""
    z = np.array([np.cos(POINTS), 0.0, np.sin(POINTS)])
    y = np.array([0.0, 1.0, 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(y, z), y, z])
    pose[:3, 3] = point(TOOL) + tcp * z
    return moved(q, 4) @ pose


def planar_urdf() -> str:
    """The URDF: four joints, a fixed cover, a roll, two fingers.

    The tool link points along its -x and closes along its z.
    """
    rng = np.random.default_rng(5)
    lines = ['<robot name="odd">']
    frames = {"base": np.eye(4)}

    def link(name: str) -> None:
        spread = rng.uniform(0.01, 0.05, 3)
        inertia = rng.uniform(0.001, 0.004) + np.diag(spread)
        rpy, com, mass = rng.uniform(-1, 1, 3), rng.uniform(-0.1, 0.1, 3), rng.uniform(0.5, 3)
        xx, xy, xz, yy, yz, zz = map(float, inertia[np.triu_indices(3)])
        lines.append(
            f'<link name="{name}"><inertial><origin xyz="{words(com)}" rpy="{words(rpy)}"/>'
            f'<mass value="{float(mass)!r}"/><inertia ixx="{xx!r}" ixy="{xy!r}" ixz="{xz!r}" '
            f'iyy="{yy!r}" iyz="{yz!r}" izz="{zz!r}"/>'
            "</inertial></link>"
        )

    def joint(name, kind, parent, child, pose, axis):  # type: ignore[no-untyped-def]
        before = np.linalg.inv(frames[parent]) @ pose
        rpy = Rotation.from_matrix(before[:3, :3]).as_euler("xyz")
        own = pose[:3, :3].T @ axis
        frames[child] = pose
        lines.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{words(before[:3, 3])}" rpy="{words(rpy)}"/>'
            f'<axis xyz="{words(2.5 * own)}"/>'
            '<limit lower="-2" upper="2.2" velocity="3" effort="40"/></joint>'
        )
        link(child)

    def somewhere(at: np.ndarray) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = Rotation.random(rng=rng).as_matrix(), at
        return pose

    link("base")
    x, y = np.eye(3)[:2]
    parent = "base"
    for i, name in enumerate(JOINTS):
        if name == "flick":
            # On the way to it a joint that is not chosen.
            place = somewhere(point(PLACES[2] + [0.1, 0.0]))
            joint("roll", "revolute", parent, "forearm", place, x)
            parent = "forearm"
        place = somewhere(point(PLACES[i]))
        joint(name, "revolute", parent, f"after_{name}", place, AXES[i])
        parent = f"after_{name}"
    joint("screws", "fixed", "after_bend", "cover", somewhere(x), x)
    tool = np.eye(4)
    back = -np.array([np.cos(POINTS), 0.0, np.sin(POINTS)])
    tool[:3, :3], tool[:3, 3] = np.column_stack([back, np.cross(y, back), y]), point(TOOL)
    joint("flange", "fixed", parent, "hand", tool, x)
    for side in (1, -1):
        finger = somewhere(point(TOOL) + side * 0.02 * y)
        joint(f"finger{side}", "prismatic", "hand", f"pad{side}", finger, y)
    return "\n".join([*lines, "</robot>"])


def words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
