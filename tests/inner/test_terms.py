"""Fails if a section that a scene does not have adds to the NLP, if the check misses a throw that
breaks one, or if a limit that binds does not change the throw."""

from __future__ import annotations

import collections
import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from builders import loud, nlp_of, varied
from throwplan.models import FlightLaw, FlightState
from throwplan.planner.throw import Throw, cup_entries, make_manipulator
from throwplan.planner.verdict import Code, bar_outline, measures_of, verdict_on
from throwplan.problems import Landing, Torque

G = 9.81
#: Under half of the Panda's torques [N m].
WEAK = (45.0, 30.0, 6.0)


def torques(throw: Throw) -> np.ndarray:
    """Largest share (n,) of each joint's torque limit."""
    return measures_of(throw).torque[0][0, : len(throw.manipulator.joints)]


def checked(plan: tp.Plan, **changes: object) -> Throw:
    """What a plan sends, in its scene with changes."""
    return dataclasses.replace(
        plan.throw.deciding.sliding_pivot, scene=varied(plan.scene, **changes)
    )


# What a section costs.


def test_what_each_section_costs() -> None:
    """Leaving a section out takes its variables, constraints and parameters away."""
    cup = tp.load_scene("near-cup")
    full = nlp_of(cup)
    no_cup = nlp_of(cup.replace(cup=None))
    # Four depths, and the rim: a time and its equation each, four walls, one for the corner.
    assert full.size[0] - no_cup.size[0] == 4 + 1
    assert full.size[1] - no_cup.size[1] == 4 * 5 + 2
    assert {"cup_x", "cup_rim", "lower_end"} <= set(full.parameters.blocks)
    assert not [name for name in no_cup.parameters.blocks if name.startswith("cup")]
    bare = nlp_of(cup.replace(cup=None, workspace=None))
    assert not {"floor", "column_radius", "ahead"} & set(bare.parameters.blocks)
    assert bare.size[0] == no_cup.size[0] and bare.size[1] < no_cup.size[1]
    free = nlp_of(cup.replace(cup=None, target=tp.Pose(x=0.9, z=0.2)))
    assert no_cup.size[1] - free.size[1] == 1
    assert not [name for name in full.parameters.blocks if name.startswith("palm")]


def test_every_limit_has_its_rows() -> None:
    """13 nodes of 12 intervals, half of them in the opening; three joints that throw."""
    scene = tp.load_scene("near-cup")
    limits = {"torque": Torque(limits=WEAK), "landing": Landing(speed_min=1.0, rate_max=5.0)}
    rows = collections.Counter(nlp_of(scene.replace(**limits)).row_names)
    for joint in (2, 4, 6):
        found = [rows[f"joint {joint} {kind}"] for kind in ("position", "velocity", "torque")]
        assert found == [12, 13, 30] and rows[f"joint {joint} room to brake"] == 1
    assert sum(rows[f"gap {k}"] for k in range(12)) == 5 * 10 + 9 + 6 * 15
    expected = {"tool speed": 40, "grip while carrying": 13, "sliding pivot": 6 * 6}
    expected |= {"floor": 19, "base column": 19, "cup depth": 5, "cup clearance": 17}
    landing = ("landing x", "landing z", "landing theta", "coming down", "landing speed")
    expected |= dict.fromkeys((*landing, "landing rate"), 1)
    assert {name: rows[name] for name in expected} == expected


# Throws that break something.


def test_a_solved_plan_breaks_nothing_and_harder_scenes_are_broken(cup_plan) -> None:
    assert cup_plan.solved and verdict_on(checked(cup_plan)).ok
    changes = {
        Code.CUP_MISSED: {"cup": {"rim": cup_plan.scene.cup.rim - 2.0}},
        Code.CUP_WALL: {"cup": {"clearance": 0.0481}},
        Code.FLOOR: {"workspace": {"floor": 0.4}},
        Code.COLUMN: {"workspace": {"column_radius": 0.5}},
        Code.PALM: {"workspace": {"palm_clearance": 0.2}},
        Code.LANDING_SPEED: {"landing": Landing(speed_min=50.0)},
        Code.LANDING_RATE: {"landing": Landing(rate_max=1e-3)},
        Code.TORQUE: {"torque": Torque(limits=(1.0, 1.0, 1.0))},
    }
    for code, change in changes.items():
        assert code in verdict_on(checked(cup_plan, **change)).codes


# Shapes.


def entry(scene: tp.Scene, state: FlightState, flight: float) -> float:
    """Least clearance of one flight's way into the scene's cup."""
    return float(cup_entries(scene, np.array([[*vars(state).values()]]), np.array([flight]))[0])


@pytest.mark.parametrize("seed", range(4))
def test_cup_entry_is_that_of_a_finely_drawn_outline(seed: int) -> None:
    scene, rng = tp.load_scene("near-cup"), np.random.default_rng(seed)
    cup, flight = scene.cup, 0.35
    theta, omega = rng.uniform(-1.9, -1.2), rng.uniform(-2, 2)
    v_x, z = rng.uniform(-0.2, 0.2), 0.2 + G * flight**2 / 2
    x = 0.90 + rng.uniform(-0.02, 0.02) - v_x * flight
    state = FlightState(x, z, theta - omega * flight, v_x, 0.0, omega)
    at = FlightLaw(G).after(state, np.linspace(0.0, flight + 0.3, 6000))
    outline = bar_outline(scene.object, np.array([at.x, at.z, at.theta]), 300)
    depth = cup.rim - outline[1].min(axis=1)
    inside = (depth >= 0) & (depth <= cup.insertion)
    chord = math.sqrt(cup.radius**2 - (scene.object.width / 2) ** 2)
    across, over = outline[0, inside] - cup.x, outline[1, inside] - cup.rim
    wall = np.where(over <= 0, chord - np.abs(across), np.inf).min()
    rim = min(np.hypot(across - side * chord, over).min() for side in (-1, 1))
    # An outline that crosses the rim has none left.
    least = min(wall, rim) if wall > 0 else wall
    assert entry(scene, state, flight) == pytest.approx(least, abs=4e-4)


# Torques.


def test_limits_that_bind_change_the_throw(loud_plan_of) -> None:
    cup_plan = loud_plan_of("near-cup")
    most = torques(checked(cup_plan, torque=Torque(limits=WEAK)))
    section = Torque(limits=tuple(float(v) for v in 0.97 * most * np.array(WEAK)))
    tight = tp.plan(cup_plan.scene.replace(torque=section))
    assert tight.solved
    assert torques(checked(cup_plan, torque=section)).max() > 1.0
    assert torques(checked(tight)).max() <= 1.0


@pytest.mark.slow
def test_a_scenes_torque_rate_is_kept_and_judged() -> None:
    """Without it plans go far above; with it the plan keeps it and the same verdict says so."""
    free = tp.plan(loud("fr3").replace(torque=Torque(rate=1e6)))
    scene = free.scene.replace(torque=Torque(rate=2000.0))
    assert measures_of(free.throw.deciding).value("rate")[0] > 20000.0
    judged = verdict_on(free.throw.deciding.in_scene(scene))
    assert Code.TORQUE_RATE in judged.codes
    plan = tp.Planner(scene).plan(patience=20.0)
    assert plan.solved and 500.0 < measures_of(plan.throw.deciding).value("rate")[0] <= 2000.0
    # A scene that does not ask, or asks for more than there can be, has the arm's own limits.
    own = make_manipulator(free.scene).hard.jerk
    loose = free.scene.replace(torque=Torque(rate=1e6))
    assert (make_manipulator(loose).hard.jerk == own).all()
    assert (make_manipulator(scene).hard.jerk < 0.1 * own).all()


@pytest.mark.parametrize("name", ["speed_min", "speed_max", "rate_max"])
def test_bounds_of_the_landing_change_the_throw(name: str, plan_of) -> None:
    def value(plan: tp.Plan) -> float:
        end = plan.throw.deciding.landing.state
        return abs(end.omega) if name == "rate_max" else math.hypot(end.v_x, end.v_z)

    free, share = plan_of("hand-flip"), 1.1 if name == "speed_min" else 0.9
    bound = share * value(free)
    plan = tp.plan(free.scene.replace(landing=Landing(**{name: bound})))
    assert plan.solved, plan.message
    assert (value(plan) - bound) * (share - 1.0) >= 0.0


@pytest.mark.slow
def test_palm_enters_the_nlp_when_it_decides_and_goes_into_a_warm_start() -> None:
    """Thrown backwards over the base, the bar would hit the hand: solved all the same."""
    planner = tp.Planner(tp.load_scene("pose").replace(torque=Torque(rate=1e6, margin=0.0)))
    first = planner.plan(tp.Pose(x=-0.9, z=0.1, theta=0.0), patience=90.0)
    assert first.solved and verdict_on(checked(first)).ok
    assert first.constraints > nlp_of(planner.scene).size[1]
    again = planner.plan(tp.Pose(x=-0.905, z=0.1, theta=0.0), warm=first)
    assert again.solved and again.constraints == first.constraints


@pytest.mark.slow
def test_the_arms_own_limits_are_kept_with_rows_where_a_throw_breaks_them() -> None:
    """A Panda whose joint 2 is as weak as to hold `pose` no more as it is thrown otherwise."""
    scene = tp.load_scene("pose")
    use = tp.plan(scene).to_dict()["torque"]["use"]
    assert 0.5 < use <= 1.0
    weak = varied(scene, limits={"torque": tuple([87.0 * 0.9 * use] * 7)})
    assert nlp_of(weak).size == nlp_of(scene).size
    plan = tp.plan(weak)
    assert plan.solved and "torque" in plan.throw.refinement.lazy
    assert plan.constraints > nlp_of(weak).size[1]
    assert 0.8 < plan.to_dict()["torque"]["use"] <= 1.0 - scene.torque_margin
