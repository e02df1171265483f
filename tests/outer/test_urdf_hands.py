"""Imported arms keep masses and shapes of their file, whichever frame is the tool, at true size."""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
import yourdfpy
from imports import imported
from throwplan.models.robot import SpatialArm
from throwplan.problems.arm_files import load_arm, load_gripper

from oracle.shapes import to_segment

JOINTS = ["turn", "lift", "bend", "flick"]
OPTIONS = ["--acceleration", "10", "--jerk", "1000"]
#: By the frame that is the tool: what else is said about it.
TOOLS = {
    "forearm_end": ["--approach=x", "--closing", "y", "--tcp", "0.25"],
    "mount": ["--tcp", "0.2"],
    "gripper": ["--tcp", "0.15"],
    "pads": [],
}
#: The hand's links and their masses [kg].
HAND = {"gripper": 0.7, "left": 0.1, "right": 0.1, "pads": 0.0}
#: Largest way [m] of each finger.
OPEN = 0.06


def link(name: str, mass: float, size: str = "", at: str = "0 0 0") -> str:
    box = f'<geometry><box size="{size}"/></geometry>'
    shape = f'<collision><origin xyz="{at}"/>{box}</collision>' if size else ""
    body = (
        f'<inertial><origin xyz="{at}" rpy="0.1 0.2 0.3"/><mass value="{mass}"/><inertia '
        f'ixx="{0.002 * mass}" iyy="{0.003 * mass}" izz="{0.004 * mass}" ixy="{0.0003 * mass}" '
        'ixz="0" iyz="0"/></inertial>'
    )
    return f'<link name="{name}">{body if mass else ""}{shape}</link>'


def joint(name: str, kind: str, parent: str, child: str, at: str, more: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin {at}/>{more}</joint>'
    )  # fmt: skip


def handy(folder: Path, hand: bool = True) -> Path:
    """An arm of four joints with a camera beside its gripper, whose fingers are closed at 0."""
    turns = '<axis xyz="{}"/><limit lower="-2" upper="2" velocity="4" effort="200"/>'
    slides = f'<axis xyz="0 {{}} 0"/><limit lower="0" upper="{OPEN}" velocity="1" effort="9"/>'
    parts = [
        link("base", 3.0),
        link("column", 2.0),
        link("arm", 1.5),
        link("forearm", 1.2),
        link("forearm_end", 0.5, "0.1 0.05 0.05", "0.05 0 0"),
        link("mount", 0.0),
        link("camera", 0.3, "0.04 0.04 0.04", "0 0.06 0"),
        joint("turn", "revolute", "base", "column", 'xyz="0 0 0.1"', turns.format("0 0 1")),
        joint("lift", "revolute", "column", "arm", 'xyz="0 0 0.2"', turns.format("0 1 0")),
        joint("bend", "revolute", "arm", "forearm", 'xyz="0.4 0 0"', turns.format("0 1 0")),
        joint("flick", "revolute", "forearm", "forearm_end", 'xyz="0.35 0 0"',
              turns.format("0 1 0")),
        joint("screws", "fixed", "forearm_end", "mount",
              'xyz="0.1 0 0" rpy="0 1.5707963267948966 0"'),
        joint("bracket", "fixed", "mount", "camera", 'xyz="0 0 0"'),
    ]  # fmt: skip
    if hand:
        mimics = slides.format("-1") + '<mimic joint="left_slide"/>'
        parts += [
            link("gripper", 0.7, "0.06 0.12 0.08", "0 0 0.04"),
            link("left", 0.1, "0.02 0.02 0.08", "0 0.01 0.04"),
            link("right", 0.1, "0.02 0.02 0.08", "0 -0.01 0.04"),
            link("pads", 0.0),
            joint("coupling", "fixed", "mount", "gripper", 'xyz="0 0 0.05"'),
            joint("left_slide", "prismatic", "gripper", "left", 'xyz="0 0 0.08"',
                  slides.format("1")),
            joint("right_slide", "prismatic", "gripper", "right", 'xyz="0 0 0.08"', mimics),
            joint("centre", "fixed", "gripper", "pads", 'xyz="0 0 0.15"'),
        ]  # fmt: skip
    path = folder / "handy.urdf"
    path.write_text("\n".join(['<robot name="handy">', *parts, "</robot>"]))
    return path


@pytest.fixture(scope="module", params=TOOLS)
def handed(request, tmp_path_factory):
    """The arm by each of the frames that may be its tool, and its URDF."""
    urdf = handy(tmp_path_factory.mktemp("handy"))
    options = ["--tool", request.param, *TOOLS[request.param], *OPTIONS]
    return imported(urdf.parent, urdf, JOINTS, *options), urdf


def states(count: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(3)
    return tuple(rng.uniform(-1.5, 1.5, (count, 4)) for _ in range(3))


def test_torques_are_those_of_the_whole_file_whichever_frame_is_the_tool(handed) -> None:
    arm, urdf = handed
    model = mujoco.MjModel.from_xml_path(str(urdf))
    data, moving = mujoco.MjData(model), [model.joint(name).qposadr[0] for name in JOINTS]
    q, dq, ddq = states(5)
    found = SpatialArm(arm).torques(q, dq, ddq, 9.81, np.zeros((5, 6)))
    for row, *state in zip(found, q, dq, ddq, strict=True):
        data.qpos[moving], data.qvel[moving], data.qacc[moving] = state
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(row, data.qfrc_inverse[moving], rtol=1e-9, atol=1e-9)
    assert arm.links[-1].mass == pytest.approx(sum(HAND.values()))
    assert set(arm.hand_links) == set(HAND)


def test_open_fingers_and_all_else_are_inside_the_capsules_of_each_tool(handed) -> None:
    arm, urdf = handed
    robot = yourdfpy.URDF.load(urdf, load_meshes=False)
    numbers = {"camera": 4, "forearm_end": 4} | dict.fromkeys(("gripper", "left", "right"), 5)
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    for q, opening in itertools.product(states(3)[0], (0.0, OPEN)):
        robot.update_cfg(dict(zip(JOINTS, q, strict=True)) | {"left_slide": opening})
        frames = SpatialArm(arm).frames(q[None])[:, 0]
        for name, number in numbers.items():
            (shape,) = robot.link_map[name].collisions
            corners = signs * shape.geometry.box.size + shape.origin[:3, 3]
            turn = np.linalg.inv(frames[number]) @ robot.get_transform(name, "base")
            points = corners @ turn[:3, :3].T + turn[:3, 3]
            own = [c for c in arm.capsules if c.link == number]
            away = [to_segment(points, *map(np.array, (c.begin, c.end))) - c.radius for c in own]
            assert np.min(away, axis=0).max() <= 1e-9


@pytest.mark.parametrize("hand", [True, False])
@pytest.mark.parametrize("tool", ["forearm_end", "mount"])
def test_a_gripper_file_replaces_the_hand_only_and_names_it(hand, tool, tmp_path, run) -> None:
    words = ["--approach=x", "--closing", "y"] if tool == "forearm_end" else []
    out = tmp_path / "arm.toml"
    said = run(
        "import-robot", handy(tmp_path, hand), "--tool", tool, *words, *OPTIONS, "--out", out
    )
    assert ("links of the hand: gripper, left, right, pads (0.9 kg)" in said.out) == hand
    own, gripper = load_arm("arm.toml", tmp_path), load_gripper("robotiq-2f-85")
    arm = load_arm("arm.toml", tmp_path, gripper)
    masses = [each.mass for each in arm.links]
    assert masses == pytest.approx([2.0, 1.5, 1.2, 0.8, gripper.mass])
    kept = [c for c in own.capsules if c.link <= 4]
    assert [c for c in arm.capsules if c in own.capsules] == kept
    notes = [note for note in arm.notes if "takes the place of the arm's own hand" in note]
    assert len(notes) == hand
    if hand:
        assert re.search(
            r"Robotiq 2F-85 .* \(gripper, left, right, pads, 0.9 kg, \d caps", notes[0]
        )
    # Without a gripper file the hand is there.
    assert own.links[-1].mass == pytest.approx(0.9 * hand)


# Units and extents of meshes.

#: A box of 0.2 x 0.1 x 0.3 m as COLLADA, in its unit.
COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>
<created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>
<unit name="one" meter="{unit}"/><up_axis>{up}_UP</up_axis></asset><library_geometries>
<geometry id="g"><mesh><source id="p"><float_array id="a" count="24">{places}</float_array>
<technique_common><accessor source="#a" count="8" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="12">
<input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="s"><node id="n">
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def with_mesh(
    folder: Path, unit: float = 1.0, up: str = "Z", declared: float | None = None
) -> Path:
    """The arm with a COLLADA box on its forearm, from the joint on along x."""
    box = trimesh.creation.box((0.2, 0.1, 0.3)).apply_translation((0.1, 0.0, 0.0))
    places, corners = (" ".join(map(str, a.ravel())) for a in (box.vertices / unit, box.faces))
    text = COLLADA.format(unit=declared or unit, up=up, places=places, corners=corners)
    (folder / "box.dae").write_text(text)
    urdf = handy(folder)
    shape = '<visual><geometry><mesh filename="box.dae"/></geometry></visual>'
    head = '<link name="forearm">'
    urdf.write_text(urdf.read_text().replace(head, head + shape))
    return urdf


def test_the_unit_of_a_collada_mesh_counts(tmp_path) -> None:
    options = ["--tool", "mount", *OPTIONS]
    shapes = []
    for unit in (1.0, 0.0254, 0.001):
        arm = imported(tmp_path, with_mesh(tmp_path, unit), JOINTS, *options)
        (capsule,) = (c for c in arm.capsules if c.link == 3)
        shapes.append([*sorted([capsule.begin, capsule.end]), capsule.radius])
    # The ball around the box is the largest sensible capsule.
    assert shapes[0][-1] <= math.hypot(0.1, 0.05, 0.15)
    for shape in shapes[1:]:
        np.testing.assert_allclose(np.hstack(shape), np.hstack(shapes[0]), atol=2e-3)


def test_a_mesh_larger_than_the_arm_is_refused_with_its_size(tmp_path, refused, untouched) -> None:
    """Inches without their unit: 39 times too large."""
    urdf = with_mesh(tmp_path, 0.0254, declared=1.0)
    untouched()
    line = refused(
        "import-robot", urdf, "--tool", "mount", *OPTIONS, "--out", tmp_path / "arm.toml"
    )
    far = math.hypot(0.2, 0.05, 0.15) / 0.0254
    # Joints 0.1, 0.2, 0.4 and 0.35 m apart from the base on, and 0.1 m to the flange.
    assert f"link 'forearm': its shape reaches {far:.3g} m" in line and "reach, 1.15 m" in line
