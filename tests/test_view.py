"""The 3-D view: where things are drawn, and the panel."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from throwplan.planner.result.files import read_plan
from throwplan.planner.show.view import View
from throwplan.planner.show.view_poses import SpaceThrow, in_space, link_pieces, placed, space_throw
from throwplan.planner.show.view_server import serving
from view_plans import AZIMUTH, cup_plan, free_port, hand_plan


@pytest.fixture(scope="module")
def space(tmp_path_factory) -> SpaceThrow:
    return space_throw(read_plan(cup_plan(tmp_path_factory)))


@pytest.fixture(scope="module")
def hand(tmp_path_factory) -> Path:
    return hand_plan(tmp_path_factory)


@pytest.fixture(scope="module")
def panel(space: SpaceThrow):
    with serving(space, free_port()) as (_, panel):
        yield panel


class Recorder:
    """Stands for a viser scene: keeps what is added, by name."""

    def __init__(self) -> None:
        self.nodes: dict[str, SimpleNamespace] = {}

    def __getattr__(self, kind: str) -> Any:
        def add(name: Any, *values: Any, **options: Any) -> SimpleNamespace:
            node = SimpleNamespace(name=name, kind=kind, values=values, **options)
            self.nodes[str(name)] = node
            return node

        return add


def drawn(space: SpaceThrow) -> tuple[View, dict[str, SimpleNamespace]]:
    scene = Recorder()
    server = SimpleNamespace(
        scene=scene, atomic=nullcontext, initial_camera=SimpleNamespace(), gui=None
    )
    return View(server, space), scene.nodes


def test_the_drawn_arm_ends_where_the_hand_is(space: SpaceThrow) -> None:
    """3-D kinematics of all joints against the planar chain of the throw."""
    expected = placed(space.line.hand, AZIMUTH)
    assert np.abs(space.hand - expected).max() < 1e-9
    arm = space.scene.arm
    assert arm is not None and space.joints is not None
    view, _ = drawn(space)
    for moment in (0.0, 0.3, space.throw.opening_time, space.throw.landing_time):
        i = view.show(moment)
        frames = [np.eye(4), *space.joints[i]]
        places = [frame[:3, 3] for frame in frames[1:]]
        ends = [
            f[:3, :3] @ row[-1][1] + f[:3, 3] if row else f[:3, 3]
            for f, row in zip(frames, link_pieces(arm), strict=True)
        ]
        # Each link ends at the next joint, the last one at the flange.
        np.testing.assert_allclose(ends[:-1], places, atol=1e-12)
        tcp = ends[-1] + arm.tool.tcp * space.joints[i][-1][:3, 2]
        np.testing.assert_allclose(tcp, in_space(*space.line.hand[:2, i], AZIMUTH), atol=1e-9)
        np.testing.assert_allclose(view.hand.position, tcp, atol=1e-9)


def test_the_bar_is_held_and_lands_at_the_target(space: SpaceThrow) -> None:
    held = space.bar[0, :3, 3] - space.hand[0, :3, 3]
    assert np.linalg.norm(held) == pytest.approx(space.scene.com_offset, abs=1e-12)
    target, times = space.throw.target, space.line.times
    late = space.throw.landing_time - times[-1]
    rate = (space.bar[-1, :3, 3] - space.bar[-2, :3, 3]) / (times[-1] - times[-2])
    landed = space.bar[-1, :3, 3] + late * rate
    place = np.array([target.x, target.y, target.z])
    assert np.linalg.norm(landed - place) < 1e-4
    np.testing.assert_allclose(space.target()[:3, 3], place, atol=1e-12)
    np.testing.assert_allclose(space.target()[:3, 0], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(space.bar[-1, :3, 0], [0, 0, -1], atol=0.02)


def test_the_cup_is_where_the_scene_has_it(space: SpaceThrow) -> None:
    _, nodes = drawn(space)
    cup = space.scene.cup
    assert cup is not None
    wall, rim = nodes["/cup/wall"], nodes["/cup/rim"]
    middle = [cup.x * np.cos(AZIMUTH), cup.x * np.sin(AZIMUTH), cup.rim]
    for node in (wall, rim):
        np.testing.assert_allclose(node.position, middle, atol=1e-12)
    vertices = wall.values[0]
    assert np.hypot(vertices[:, 0], vertices[:, 1]).max() == pytest.approx(cup.radius)
    assert (vertices[:, 2].min(), vertices[:, 2].max()) == pytest.approx((-cup.depth, 0.0))
    inner = np.hypot(rim.values[0][:, 0], rim.values[0][:, 1]).min()
    assert inner == pytest.approx(cup.radius)


def test_a_hand_scene_draws_a_hand_and_nothing_it_has_not(hand: Path) -> None:
    space = space_throw(read_plan(hand))
    view, nodes = drawn(space)
    assert space.joints is None
    assert not [n for n in nodes if n.startswith(("/arm", "/cup", "/column"))]
    view.show(0.2)
    i = space.index(0.2)
    np.testing.assert_allclose(nodes["/hand"].position, in_space(*space.line.hand[:2, i], 0.0))


def test_the_pads_hold_until_detach_and_then_open(space: SpaceThrow) -> None:
    view, nodes = drawn(space)
    for moment, opens in ((space.throw.opening_time, False), (space.throw.landing_time, True)):
        view.show(moment)
        thickness = nodes["/hand/pad1"].dimensions[2]
        gap = abs(nodes["/hand/pad1"].position[2]) - thickness / 2 - space.scene.object.width / 2
        assert (gap > 0.01) if opens else (abs(gap) < 1e-12)


def test_the_camera_sees_the_whole_throw(space: SpaceThrow) -> None:
    view, _ = drawn(space)
    camera = view.server.initial_camera
    forward = camera.look_at - camera.position
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    points = np.vstack([space.bar[:, :3, 3], space.joints.reshape(-1, 4, 4)[:, :3, 3]])
    away = points - camera.position
    depth = away @ forward
    half = np.tan(camera.fov / 2)
    assert depth.min() > 0.1
    assert np.abs(away @ up / depth).max() < half
    assert np.abs(away @ right / depth).max() < 1.15 * half


def test_the_slider_moves_and_colours_the_bar(panel: Any) -> None:
    throw, view = panel.throw, panel.view
    for name, colour in (("command", (138, 143, 152)), ("landing", (42, 157, 111))):
        moment = throw.line.marks[name]
        panel.slider.value = round(1e3 * moment)
        pose = throw.bar[throw.index(moment)]
        np.testing.assert_allclose(view.bar.position, pose[:3, 3], atol=1e-12)
        assert tuple(view.box.color) == colour
        assert f"{1e3 * moment:.0f} ms" in panel.words.content


def test_playing_takes_real_time_times_the_speed(panel: Any) -> None:
    panel.go(0.0)
    panel.play(True)
    for speed, factor in (("1", 1.0), ("1/5", 0.2), ("1/20", 0.05)):
        panel.speed.value = speed
        before = panel.time
        for _ in range(10):
            panel.advance(0.013)
        assert panel.time - before == pytest.approx(0.13 * factor, abs=1e-12)
    panel.play(False)
    panel.advance(1.0)
    assert panel.time == pytest.approx(0.13 * 1.25)
    panel.play(True)
    panel.speed.value = "1"
    panel.advance(100.0)
    assert panel.time == panel.end and not panel.playing
    panel.play(True)
    assert panel.time == 0.0
    panel.play(False)


def test_the_button_goes_to_the_release(panel: Any) -> None:
    panel.go(0.0)
    panel.release.value = True
    assert panel.time == panel.throw.throw.opening_time
    assert "**stick**" in panel.words.content
