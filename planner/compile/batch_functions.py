"""The laws of a batch as C text: what the models do with CasADi symbols, written out."""

from __future__ import annotations

import casadi as ca

from ...models import (
    ITERATIONS,
    HandSamples,
    ImpulseProblem,
    Iterate,
    LimitSurfaceStepping,
    SlidingPivot,
    Value,
    hand_of,
    number_symbols,
    rk4_step,
    sticking_state,
)
from .batch_text import BLOCKS, LIMIT_SURFACE, SLIDING_PIVOT
from .lane_code import HEAD, lane_function

#: Throws of a block: two vectors of the widest kind.
LANES = 16


def source() -> str:
    """C text of the functions sliding_pivot and limit_surface, which throw a batch."""
    head = HEAD.format(lanes=LANES) + f"#define ITERATIONS {ITERATIONS}\n"
    pivot = "".join(lane_function(f) for f in _pivot_functions())
    surface = "".join(lane_function(f) for f in _surface_functions())
    return head + BLOCKS + pivot + SLIDING_PIVOT + surface + LIMIT_SURFACE


def _hand(name: str) -> tuple[ca.SX, HandSamples]:
    """Pose, twist and acceleration (9,) of a hand, and these as the laws take them."""
    symbols = ca.SX.sym(name, 9)
    return symbols, hand_of(symbols)


def _function(name: str, inputs: dict[str, Value], outputs: dict[str, Value]) -> ca.Function:
    dense = [ca.cse(ca.densify(value)) for value in outputs.values()]
    return ca.Function(name, [*inputs.values()], dense, [*inputs], [*outputs])


def _pivot_functions() -> list[ca.Function]:
    p, body, contact, gravity = number_symbols()
    law = SlidingPivot(body, contact, gravity)
    state, force, dt = ca.SX.sym("state", 6), ca.SX.sym("force", 3), ca.SX.sym("dt")
    hands = [_hand(name) for name in ("start", "middle", "end")]
    (start, _), (middle, _), (end, last) = hands
    motions = [hand.motion for _, hand in hands]
    step = rk4_step(law.rates, state, motions, ca.vertsplit(force), dt)
    moved = {"state": state, "start": start, "middle": middle, "end": end}
    com = law.com_state(state, end[:3], end[3:6], last.motion)
    return [
        _function(
            "pivot_step",
            {**moved, "force": force, "dt": dt, "law": p},
            {"next": ca.vertcat(*step)},
        ),
        _function("pivot_lost", {"state": state, "law": p}, {"lost": law.lost(state)}),
        _function("pivot_end", {"state": state, "end": end, "law": p}, {"com": ca.vertcat(*com)}),
    ]


def _surface_functions() -> list[ca.Function]:
    p, body, contact, gravity = number_symbols()
    law = LimitSurfaceStepping(body, contact, gravity)
    state, grasp = ca.SX.sym("state", 6), ca.SX.sym("grasp")
    force, dt, held = ca.SX.sym("force"), ca.SX.sym("dt"), ca.SX.sym("held")
    (start, first), (end, last) = _hand("start"), _hand("end")
    begun = sticking_state(start[:3], start[3:6], grasp, body.com_offset)
    lever = law.lever(state, (first, last), dt)
    posed = law.problem(state, last, lever, force, dt)
    problem, found = ca.SX.sym("problem", 10), ca.SX.sym("found", 5)
    rows = ca.vertsplit(problem)
    given = ImpulseProblem(rows[:6], rows[6:9], rows[9])
    iterate = Iterate(found[0], ca.vertsplit(found[1:4]), found[4])
    sticking, moving = given.sticking(), ca.SX.sym("moving")
    newton = {"problem": problem, "found": found, "held": held}
    moved = {"state": state, "start": start, "end": end}
    after = law.after(state, (first, last), lever, given.trimmed(iterate, held), dt)
    return [
        _function(
            "surface_start",
            {"start": start, "grasp": grasp, "law": p},
            {"state": ca.vertcat(*begun)},
        ),
        _function(
            "surface_problem",
            {**moved, "force": force, "dt": dt, "law": p},
            {"problem": ca.vertcat(*posed.matrix, *posed.rhs, posed.radius)},
        ),
        _function(
            "surface_sticking",
            {"problem": problem},
            {"found": _column(sticking), "held": sticking.norm <= given.radius},
        ),
        _function("surface_moving", newton, {"moving": given.moving(iterate, held)}),
        _function(
            "surface_refined",
            {"problem": problem, "found": found, "moving": moving},
            {"better": _column(given.refined(iterate, moving))},
        ),
        _function(
            "surface_after", {**moved, **newton, "dt": dt, "law": p}, {"next": ca.vertcat(*after)}
        ),
    ]


def _column(found: Iterate) -> Value:
    return ca.vertcat(found.shift, *found.y, found.norm)
