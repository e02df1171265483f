"""Fails if a mesh becomes other moments or an outline that does not cover it, or is no object."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import nlp_of
from throwplan import lab

trimesh = pytest.importorskip("trimesh")

EXAMPLES = Path(__file__).parents[2] / "examples" / "objects"


@pytest.fixture
def bar_mesh(tmp_path) -> Path:
    """A box of 200 x 20 x 30 mm, from x = 0 on."""
    file = tmp_path / "part.stl"
    trimesh.creation.box([200.0, 20.0, 30.0]).apply_translation([100.0, 0, 0]).export(file)
    return file


def imported(run, mesh: Path, *words: str) -> dict:
    """The tables of the file that import-object writes."""
    out = mesh.with_suffix(".toml")
    said = run("import-object", mesh, "--out", out, "--force", *words)
    assert said.status == 0, said.err
    return tomllib.loads(out.read_text())


def test_a_box_has_the_moments_of_a_box(run, bar_mesh) -> None:
    words = ("--unit", "mm", "--density", "2500", "--grasp", "20", "0", "0")
    found = imported(run, bar_mesh, *words)
    thrown, mass = found["object"], 2500 * 0.2 * 0.02 * 0.03
    assert thrown["mass"] == pytest.approx(mass)
    # Its thinnest way is across the plane.
    assert thrown["inertia"] == pytest.approx(mass * (0.2**2 + 0.03**2) / 12, rel=1e-5)
    assert thrown["com"] - found["grasp"]["offset"] == pytest.approx(0.08, abs=2e-5)


def test_a_direction_beside_the_com_becomes_the_grasps_angle(run, bar_mesh) -> None:
    words = ("--unit", "mm", "--mass", "0.3", "--grasp", "40", "0", "10", "--axis", "1", "0", "0")
    found = imported(run, bar_mesh, *words)
    # From the grasp the CoM is 60 mm ahead and 10 mm to one side of the hand's direction.
    expected = math.degrees(math.atan2(10, 60))
    assert abs(found["grasp"]["angle_deg"]) == pytest.approx(expected, abs=0.01)


Y = ("--across", "0", "1", "0")


def bodies(file: Path, *boxes: tuple[list[float], list[float]], inwards: int = -1) -> Path:
    """A mesh of boxes, each of a size and a centre [m]; the one of number `inwards` is a hole."""
    meshes = [trimesh.creation.box(size).apply_translation(centre) for size, centre in boxes]
    if inwards >= 0:
        meshes[inwards].invert()
    trimesh.util.concatenate(meshes).export(file)
    return file


HANDLE = ([0.2, 0.02, 0.02], [0.0, 0.0, 0.0])
HEAD = ([0.03, 0.1, 0.1], [0.115, 0.0, 0.0])
HOLE = ([0.02, 0.08, 0.08], [0.115, 0.0, 0.0])
WORDS = ("--density", "1000", "--grasp", "-0.05", "0", "0", *Y)


def box_moment(size: list[float], density: float, away: float) -> float:
    """Moment of inertia of a box about an axis along y, `away` [m] from its centre."""
    mass = density * float(np.prod(size))
    return mass * ((size[0] ** 2 + size[2] ** 2) / 12 + away**2)


@pytest.mark.parametrize(
    ("boxes", "density", "inwards"),
    [
        ([HANDLE, HEAD], [1000, 1000], -1),
        ([HANDLE, HEAD, HOLE], [1000, 1000, -1000], 2),
        # Two halves that share all corners of a face; two bars that share an edge.
        ([([0.1, 0.02, 0.04], [x, 0, 0]) for x in (-0.05, 0.05)], [1000, 1000], -1),
        ([([0.1, 0.02, 0.02], [x, 0, x / 5]) for x in (-0.05, 0.05)], [1000, 1000], -1),
    ],
)
def test_bodies_that_touch_and_cavities_count_as_they_are(
    run, tmp_path, boxes, density, inwards
) -> None:
    """Mass, CoM and inertia are those of boxes by the parallel axis theorem."""
    found = imported(run, bodies(tmp_path / "part.stl", *boxes, inwards=inwards), *WORDS)
    mass = sum(d * np.prod(size) for (size, _), d in zip(boxes, density, strict=True))
    com = (
        sum(
            d * np.prod(size) * np.array(centre)
            for (size, centre), d in zip(boxes, density, strict=True)
        )
        / mass
    )
    inertia = sum(
        box_moment(size, d, math.hypot(*(np.array(centre) - com)[::2]))
        for (size, centre), d in zip(boxes, density, strict=True)
    )
    assert found["object"]["mass"] == pytest.approx(mass, rel=1e-5)
    assert found["object"]["inertia"] == pytest.approx(inertia, rel=1e-5)
    ahead = found["object"]["com"] - found["grasp"]["offset"]
    assert ahead == pytest.approx(math.hypot(com[0] + 0.05, com[2]), abs=2e-5)


def test_what_no_throw_can_have_is_refused(refused, tmp_path, bar_mesh) -> None:
    """Nothing is written."""
    out = ("--out", tmp_path / "new.toml")
    at, mass = ("--grasp", "20", "0", "0"), ("--mass", "1")
    box = trimesh.creation.box([0.2, 0.02, 0.03])
    for name, keep in (("open", np.arange(len(box.faces)) > 0), ("turned", [*range(12)])):
        mesh = box.copy()
        mesh.update_faces(keep)
        if name == "turned":
            mesh.faces[[0, 3]] = mesh.faces[[0, 3], ::-1]
        mesh.export(tmp_path / f"{name}.obj")
    trimesh.creation.annulus(0.03, 0.05, 0.01).export(tmp_path / "ring.stl")
    deep = bodies(tmp_path / "deep.stl", HANDLE, (HEAD[0], [0.11, 0.0, 0.0]))
    inwards = bodies(tmp_path / "inwards.stl", HANDLE, HEAD, inwards=1)
    hammer, near = bodies(tmp_path / "hammer.stl", HANDLE, HEAD), ("--grasp", "0.02", "0", "0")
    beside = ("--grasp", "-0.05", "0", "0.03", *Y)
    for mesh, words, said in (
        (bar_mesh, at, "give --mass or --density"),
        (bar_mesh, (*mass, *at), "choose --unit"),
        (bar_mesh, (*mass, "--unit", "mm", "--grasp", "100", "0", "0"), "--axis: needed"),
        (bar_mesh, (*mass, "--unit", "mm", "--grasp", "900", "0", "0"), "from the object's CoM"),
        (bar_mesh, ("--mass", "400", "--unit", "mm", *at), "at most 50 kg"),
        (tmp_path / "open.obj", (*mass, *near), "not watertight"),
        (tmp_path / "turned.obj", (*mass, *near), "has no volume: its triangles must"),
        (tmp_path / "ring.stl", (*mass, *near), "--grasp: the pads close on nothing"),
        (hammer, (*mass, *beside), "--grasp: the pads close on nothing"),
        (deep, WORDS, "bodies that overlap"),
        (inwards, WORDS, "face inwards"),
    ):
        assert said in refused("import-object", mesh, *out, *words)
    assert not out[1].exists()


@pytest.mark.parametrize("name", ["hammer", "bottle", "box"])
def test_the_outline_covers_the_mesh(name: str) -> None:
    thrown = tp.load_scene(EXAMPLES / f"{name}.toml").object
    mesh = trimesh.load(thrown.mesh)
    points = np.vstack([mesh.vertices, trimesh.sample.sample_surface(mesh, 20_000, seed=1)[0]])
    away = []
    for x0, z0, x1, z1, radius in thrown.capsules:
        begin, along = np.array([x0, 0, z0]), np.array([x1 - x0, 0, z1 - z0])
        share = np.clip((points - begin) @ along / max(along @ along, 1e-12), 0, 1)
        away.append(np.linalg.norm(points - begin - share[:, None] * along, axis=1) - radius)
    # A float of STL has seven digits.
    assert np.min(away, axis=0).max() < 1e-6
    # It reaches beyond the mesh by less than its own radius.
    assert thrown.length < np.ptp(points[:, 0]) + 2 * max(thrown.capsules[:, 4])


OBJECT = {"mass": 0.2, "inertia": 5e-4, "length": 0.2, "com": 0.1}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"length": 0.3}, "outline: reaches along the axis from 0 to 0.2 m"),
        ({"width": 0.1}, "width = 0.1: must be 0.04"),
        ({"inertia": None}, "key 'inertia' is missing"),
        ({"inertia": 0.01}, "inertia = 0.01: must be at most"),
        ({"outline": ()}, "mesh: only with outline"),
    ],
)
def test_outlines_fit_their_object(changes, said) -> None:
    part = tp.OutlinePart(begin=(0.02, 0.0), end=(0.18, 0.0), radius=0.02)
    values = OBJECT | {"outline": (part,), "mesh": "part.stl"} | changes
    with pytest.raises(tp.InputError, match=said):
        tp.Object(**values)


def test_a_bar_has_no_parameter_of_an_outline() -> None:
    """An outline costs an NLP without one nothing."""
    assert "outline" not in nlp_of(tp.load_scene("near-cup")).parameters.blocks
    assert "outline" in nlp_of(tp.load_scene(EXAMPLES / "hammer.toml")).parameters.blocks


@pytest.mark.slow
def test_a_hammer_goes_past_a_fence_into_a_bin_as_the_verdict_says() -> None:
    """In MuJoCo, with the hammer's mesh, it touches nothing on its way and rests in the bin."""
    plan = tp.plan(EXAMPLES / "hammer.toml")
    assert plan.status == "solved", plan.message
    (replay,) = lab.replay(plan).objects
    assert abs(replay.off("limit_surface")[0]) < 1e-3
    assert not {"hand", "base column", "obstacle fence"} & {*replay.touched}
    assert replay.rest.entered
    assert not replay.rest.touched_rim
    assert replay.rest.inside
