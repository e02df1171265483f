"""Fails if an object does not go into its bin whole, or meets a wall that the verdict ignores."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from job_lists import TWO
from throwplan.cycles import load_jobs, plan_cycle
from throwplan.planner import Code, verdict_on
from throwplan.problems import scene_from_table

from oracle import broken_limits
from oracle.files import oracle_of, read_oracle, read_rows

#: A box in front of a Panda, and another object: a T of two capsules.
BOX = {"shape": "box", "length": 0.30, "width": 0.20, "rim": 0.20, "depth": 0.20, "x": 1.0}
ROUND = {"shape": "round", "radius": 0.13, "rim": 0.20, "depth": 0.20, "x": 1.0}
PARTS = (
    tp.OutlinePart(begin=(0.012, 0.0), end=(0.148, 0.0), radius=0.012),
    tp.OutlinePart(begin=(0.14, -0.03), end=(0.14, 0.03), radius=0.01),
)
TEE = tp.Object(mass=0.2, inertia=4e-4, length=0.16, com=0.09, outline=PARTS)
#: Of the distance that the oracle measures in space, and the verdict in the throw's plane.
NEAR = 2e-4


def into(**changes) -> tp.Scene:
    """The scene `box` with another bin."""
    return tp.load_scene("box").replace(bin=tp.Bin(**(BOX | changes)))


def by_hand(bin: dict, **changes) -> tp.Scene:
    """The scene `hand-box` with a bin."""
    bin = tp.Bin(**(bin | {"x": 1.2, "rim": 0.1}))
    return tp.load_scene("hand-box").replace(bin=bin, target=None, **changes)


def distance(plan: tp.Plan) -> float:
    """Least distance [m] from walls and rim, by the oracle, which finds nothing wrong."""
    assert plan.solved, plan.message
    judged = oracle_of(plan).judge(planned=True)
    assert judged.broken() == [()]
    return float(judged.found["bin"].value[0])


@pytest.fixture(scope="module")
def boxed() -> tp.Plan:
    """A plan into the box."""
    return tp.plan(into())


def test_an_object_with_an_outline_goes_in_turned_walls() -> None:
    scene = by_hand(BOX | {"yaw": math.radians(50.0)}, object=TEE, grasp=tp.Grasp())
    assert distance(tp.plan(scene)) >= scene.bin.clearance - NEAR


def test_a_round_bin_takes_a_whole_object() -> None:
    scene = by_hand(ROUND)
    assert distance(tp.plan(scene)) >= scene.bin.clearance - NEAR


def test_the_plan_keeps_as_far_from_the_walls_as_it_can(boxed) -> None:
    """Farther than one that lands where it is told to, nearly as far as the walls beside it."""
    told = distance(tp.plan(boxed.scene.replace(target=tp.Pose(x=1.08, z=0.20))))
    assert told < (free := distance(boxed))
    assert free > 0.9 * (0.10 - boxed.scene.object.width / 2)


def test_without_target_every_landing_in_the_bin_is_one() -> None:
    scene = into()
    target, beside = scene.target, scene.object.width / 2
    assert target.theta is None and (target.x, target.z) == (1.0, 0.20)
    assert target.half_widths == pytest.approx((0.15 - scene.bin.clearance, 0.0))
    # The nearest walls, where these are turned, and a bar's edges beside its plane.
    turned = into(yaw=math.radians(90.0)).target.half_widths[0]
    assert turned == pytest.approx(0.10 - scene.bin.clearance)
    radius, kept = 0.13 - scene.bin.clearance, into(**ROUND, length=None, width=None).target
    assert kept.half_widths[0] == pytest.approx(math.sqrt(radius**2 - beside**2))


def test_the_target_follows_its_bin_and_the_bin_its_target() -> None:
    scene = into()
    other = scene.replace(bin=tp.Bin(**(BOX | {"x": 0.8, "y": 0.3})))
    assert (other.target.x, other.target.y) == (0.8, 0.3)
    moved = scene.aimed_at(tp.Pose(x=0.6, y=0.6, z=0.30))
    assert (moved.bin.x, moved.bin.y, moved.bin.rim) == pytest.approx((0.6, 0.6, 0.30))
    assert "target" not in scene.table()
    again = scene_from_table(scene.table())
    assert (again.bin, again.target) == (scene.bin, scene.target)
    own = scene.replace(target=tp.Pose(x=1.05, z=0.20))
    assert scene_from_table(own.table()).target == own.target


def test_walls_are_obstacles_for_arm_and_object(plan_of) -> None:
    """A throw to a pose, judged among bins that stand where arm, held and flying object are."""
    plan = plan_of("pose")
    throw, scene = plan.throw.deciding, plan.scene
    tall = {"shape": "round", "radius": 0.3, "depth": 1.5, "rim": 1.5, "clearance": 0.0}
    held = tp.Bin(x=throw.hand(np.zeros(1)).pose[0, 0] + 0.3, **tall)
    bodies = set[str]()
    for one in (held, dataclasses.replace(held, x=0.9 * scene.target.x - 0.3)):
        around = scene.changed(bin=one.placed(scene.target.plane))
        found = verdict_on(throw.in_scene(around)).broken
        bodies |= {f.body for f in found if f.code is Code.COLLISION and f.other == "bin wall"}
    assert {"bar", "flying bar"} <= bodies
    assert any(name.startswith("link") or name == "hand" for name in bodies)


def test_a_throw_beside_the_bin_or_onto_its_rim_does_not_go_in(boxed) -> None:
    """By an arm, and by a hand whose bar, which has no width, falls level."""
    level = tp.plan(tp.load_scene("hand-box"))
    for plan, places in ((boxed, (1.6, 1.13)), (level, (0.6, 1.03, 1.6, 2.0))):
        for x in places:
            around = plan.scene.changed(bin=boxed.scene.bin.changed(x=x, plane_x=x))
            broken = verdict_on(plan.throw.deciding.in_scene(around)).codes
            assert broken & {Code.BIN_MISSED, Code.BIN_WALL}, x


@pytest.mark.slow
def test_a_sweep_counts_throws_into_the_bin(tmp_path: Path) -> None:
    """As the oracle does, wherever it is sure."""
    late = tp.Uncertainty(delay=tp.Distribution(uniform=0.04))
    plan = tp.plan(into(length=0.24).replace(uncertainty=late))
    plan.save(tmp_path)
    swept = tp.sweep(plan, samples=200)
    swept.save(tmp_path / "sweep")
    rows, found = read_rows(tmp_path)
    judged, success = read_oracle(tmp_path).judge(rows), found["success"] > 0
    assert "into the bin" in swept.summary()
    assert 0.0 < success.mean() < 1.0
    assert (success == judged.success)[judged.sure].all()


def test_the_object_comes_to_rest_in_the_bin() -> None:
    pytest.importorskip("mujoco")
    deep = into(depth=0.30, rim=0.30).replace(rest=tp.Rest(in_="bin"))
    plan = tp.plan(deep)
    assert plan.solved and plan.rests.share > 0.9
    from throwplan.lab import replay

    rest = replay(plan).objects[0].rest
    assert rest.inside and rest.entered and not rest.touched_rim


CYCLE = f"""{TWO.partition("[[pick]]")[0].partition("[[bin]]")[0]}
[[bin]]
name = "tray"
shape = "box"
length = 0.30
width = 0.22
depth = 0.12
rim = 0.15
x = 0.9
y = 0.4
[[pick]]{TWO.partition("[[pick]]")[2]}"""


@pytest.mark.slow
def test_a_cycle_throws_into_a_bin(tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(CYCLE)
    cycle = plan_cycle(load_jobs(tmp_path / "two.toml"))
    assert cycle.solved
    cycle.save(tmp_path / "out")
    assert broken_limits(tmp_path / "out") == []
    for one in cycle.motion.carries:
        assert one.throw.scene.bin.holds(one.throw.landing.pose[0], 0.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"shape": "oval"}, "shape = 'oval'"),
        ({"length": None}, "'length' is missing"),
        ({"radius": 0.1}, "radius = 0.1"),
        ({"width": 0.02}, "width = 0.02: must be above 0.03"),
        ({"length": 0.03}, "length = 0.03"),
        ({"depth": 0.0}, "depth = 0"),
        ({"rim": math.nan}, "rim = nan"),
        ({"clearance": -0.1}, "clearance = -0.1"),
        ({**ROUND, "length": None, "width": None, "yaw": 0.3}, "yaw_deg"),
    ],
)
def test_a_wrong_bin_is_refused(changes: dict, words: str) -> None:
    with pytest.raises(tp.InputError, match=words) as refusal:
        into(**changes)
    assert "\n" not in str(refusal.value)


def test_a_bin_beside_a_cup_a_plane_or_a_belt_is_refused() -> None:
    scene, own = into(), tp.Pose(x=1.0, z=0.20)
    cup = tp.Cup(x=1.0, rim=0.2, radius=0.1, depth=0.1)
    for words, changes in {
        "only one": {"cup": cup},
        "beside the throw's": {"target": tp.Pose(x=1.0, y=0.3, z=0.20)},
        "velocity": {"target": dataclasses.replace(own, velocity=(0.1,))},
        "outside": {"target": tp.Pose(x=1.3, z=0.20)},
        "bottom": {"target": tp.Pose(x=1.0, z=-0.20)},
        "has no": {"rest": tp.Rest(in_="cup")},
    }.items():
        with pytest.raises(tp.InputError, match=words) as refusal:
            scene.replace(**changes)
        assert "\n" not in str(refusal.value)
    hand = tp.load_scene("hand-box")
    with pytest.raises(tp.InputError, match=r"\[bin\] y"):
        hand.replace(bin=tp.Bin(**(BOX | {"y": 0.1})), target=None)
