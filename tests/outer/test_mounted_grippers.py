"""Imported arms: grippers that meet the wrist, hands that are there, proposed tools, meshes."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.models.robot import SpatialArm, segment_distance
from throwplan.problems import arm_files as arms
from throwplan.problems.arm_files import load_arm

from oracle.shapes import to_box

OPTIONS = ["--acceleration", "10", "--jerk", "1000"]
#: Axes of the joints, and where each is in the frame before it [m].
AXES = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
PLACES = ["0 0 .3", "0 0 .05", "0 0 .4", ".1 0 .03", ".3 0 0", ".08 0 0"]
#: x axis out of the flange as z axis of the tool.
OUT = "0 1.5707963267948966 0"


def six_axes(
    folder: Path, wide: float = 0.07, hand: str = "", mesh: str = "", rod: float = 0.0
) -> Path:
    """An arm whose forearm, a box that wide [m], ends 60 mm beyond its wrist's centre, 20 mm before
    the flange; hand: links on tool0; mesh: of link 2; rod: a length [m] behind the flange."""
    lines = ['<robot name="six"><link name="base"/>']
    size = {4: f'<origin xyz=".18 0 0"/><geometry><box size=".36 {wide} {wide}"/>'}
    if mesh:
        size[2] = f'<geometry><mesh filename="{mesh}"/>'
    if rod:
        size[6] = f'<origin xyz="-.01 0 0"/><geometry><box size=".02 .02 {rod}"/>'
    parent = "base"
    for n, (axis, place) in enumerate(zip(AXES, PLACES, strict=True), start=1):
        shape = f"<collision>{size[n]}</geometry></collision>" if n in size else ""
        lines += [
            f'<link name="link_{n}">{shape}</link><joint name="j{n}" type="revolute">'
            f'<parent link="{parent}"/><child link="link_{n}"/><origin xyz="{place}"/>'
            f'<axis xyz="{axis}"/><limit lower="-2" upper="2" velocity="6" effort="100"/></joint>'
        ]
        parent = f"link_{n}"
    for name, origin in [("tool0", f'rpy="{OUT}"'), *((n, 'xyz="0 0 .1"') for n in hand.split())]:
        lines += [
            f'<link name="{name}"/><joint name="to_{name}" type="fixed"><parent link="{parent}"/>'
            f'<child link="{name}"/><origin {origin}/></joint>'
        ]
        parent = "tool0"
    path = folder / "six.urdf"
    path.write_text("\n".join([*lines, "</robot>"]))
    return path


def scene_with(folder: Path) -> Path:
    """A scene with the shipped gripper on the arm of `arm.toml`."""
    text = tp.scene_text("pose").replace('arm = "panda"', 'arm = "arm.toml"')
    text = text.replace('file = "franka-hand"', 'file = "robotiq-2f-85"')
    text = re.sub(r"start_deg = .*", "", text)
    (folder / "scene.toml").write_text(text)
    return folder / "scene.toml"


def test_a_clearance_to_a_hand_without_palm_and_shapes_is_refused() -> None:
    scene = tp.load_scene("pose")
    tool = dataclasses.replace(scene.arm.tool, palm_half_width=0.0)
    links = tuple(one for one in scene.arm.capsules if one.link <= scene.arm.joints)
    for capsules in ((), links):
        with pytest.raises(tp.InputError, match=r"\[workspace\] palm_clearance = 0.005: .*panda"):
            tp.plan(varied(scene, arm={"tool": tool, "capsules": capsules}))


def test_a_palm_from_back_to_front_is_refused(tmp_path, refused) -> None:
    text = tp.scene_text("pose").replace('file = "franka-hand"', 'file = "hand.toml"')
    (tmp_path / "scene.toml").write_text(text)
    hand = (Path(arms.__file__).parent / "grippers" / "robotiq-2f-85.toml").read_text("utf-8")
    for end, value in (("back", "0.05"), ("front", "0.145")):
        hand = re.sub(rf"^palm_{end} = \S+", f"palm_{end} = {value}", hand, flags=re.M)
    (tmp_path / "hand.toml").write_text(hand, encoding="utf-8")
    said = refused("plan", tmp_path / "scene.toml")
    assert "palm_front = 0.145: must be below 0.05" in said


def test_a_gripper_inside_the_wrist_is_refused_with_its_depth(tmp_path, run, refused) -> None:
    words = ["--tool", "tool0", *OPTIONS, "--out", tmp_path / "arm.toml"]
    assert run("import-robot", six_axes(tmp_path, wide=0.3), *words).status == 0
    line = refused("plan", scene_with(tmp_path))
    assert re.search(r"arm.toml.*Robotiq 2F-85 is \d+ mm deep in link 4.*shorten", line)


@pytest.mark.parametrize("wide", [0.08, 0.14])
def test_capsules_overlap_as_deeply_as_the_meshes_are_apart_or_import_says_so(
    wide, tmp_path, run
) -> None:
    """A rod behind the flange sweeps past the forearm's end, or through it."""
    out = tmp_path / "arm.toml"
    urdf = six_axes(tmp_path, wide, rod=0.16)
    said = run("import-robot", urdf, "--tool", "tool0", *OPTIONS, "--out", out, "--json").json
    arm, (overlap,) = load_arm(str(out)), said["overlaps"]
    assert overlap["links"] == "4-6" and overlap["told"] == bool(arm.overlaps) == (wide < 0.1)
    forearm, rod = arm.capsules
    low, high = np.array(arm.limits.position_min), np.array(arm.limits.position_max)
    frames = SpatialArm(arm).frames(np.random.default_rng(5).uniform(low, high, (400, 6)))
    begin, end = (frames[6, :, :3] @ [*point, 1.0] for point in (rod.begin, rod.end))
    placed = [frames[4, :, :3] @ [*point, 1.0] for point in (forearm.begin, forearm.end)]
    depth = forearm.radius + rod.radius - segment_distance(*placed, begin, end)
    # The rod's axis against the box, in the frame of joint 4, whose z is along the box.
    back = np.linalg.inv(frames[4])
    ends = (np.einsum("nij,nj->ni", back, np.c_[at, np.ones(400)])[:, :3] for at in (begin, end))
    half = np.array([wide / 2, wide / 2, 0.18])
    apart = to_box(*ends, np.array([0.0, 0.0, 0.18]), np.eye(3), half)
    # The rod is 20 mm thick.
    meet, clear = depth[apart < 0.01], depth[apart > 0.0142]
    assert len(meet) > 40
    if overlap["told"]:
        assert (meet > overlap["depth"]).all() and np.mean(clear <= overlap["depth"]) > 0.5


@pytest.mark.parametrize(
    ("tool", "more"),
    [("my_hand_tcp", []), ("tool0", ["--tcp", "0.1"]), ("tool0", ["--palm", ".1", ".04", ".03"])],
)
def test_no_gripper_is_mounted_on_a_hand(tool, more, tmp_path, run, refused) -> None:
    urdf, out = six_axes(tmp_path, hand="my_hand my_hand_tcp"), tmp_path / "arm.toml"
    said = run("import-robot", urdf, "--tool", tool, *more, *OPTIONS, "--out", out)
    assert f"includes the hand on {tool}" in said.out
    assert "import with --tool tool0, without --tcp and --palm" in said.out
    line = refused("plan", scene_with(tmp_path))
    assert f"hand = '{tool}'" in line and "import the arm with --tool FLANGE" in line
    bare = run("import-robot", urdf, "--tool", "tool0", *OPTIONS, "--force", "--out", out)
    assert "includes the hand" not in bare.out
    assert tp.load_scene(scene_with(tmp_path)).arm.tool.tcp == pytest.approx(0.145)
