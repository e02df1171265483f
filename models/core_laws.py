"""The laws as C text, from the models' CasADi expressions: writes core/laws.h.

    python -m throwplan.models.core_laws

A law is a loop over lanes: one step of LANES throws side by side; a single throw has one lane.
Values are arrays [rows][LANES], so that the compiler turns each loop into vector instructions. No
branch is left in a loop: a choice is a conditional expression.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import casadi as ca

from .body import Body, HandSamples, Value, hand_of, held_wrench, sticking_state
from .flight import FlightLaw, FlightState
from .release.cases import LOST_SLIP
from .release.sliding_pivot import SlidingPivot
from .release.stepping import number_symbols, rk4_step
from .release.time_stepping import ITERATIONS, ImpulseProblem, Iterate, LimitSurfaceStepping
from .robot.dynamics import PlanarBody, joint_torque
from .robot.kinematics import flange_velocity, link_end

HEAD = """\
/* Written by `python -m throwplan.models.core_laws`: do not edit. */
#ifndef LAWS_H
#define LAWS_H

#include "lanes.h"

#define ITERATIONS {iterations}
/* Slip beyond the CoM's distance by which the body has left the pads [m]. */
#define LOST_SLIP {lost}
"""

#: C expressions of CasADi's operations.
_EXPRESSIONS = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_FABS: "fabs({0})",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_SIN: "sin({0})",
    ca.OP_COS: "cos({0})",
    ca.OP_NOT: "{0} == 0.0 ? 1.0 : 0.0",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_FMAX: "{0} > {1} ? {0} : {1}",
    ca.OP_FMIN: "{0} < {1} ? {0} : {1}",
    ca.OP_LT: "{0} < {1} ? 1.0 : 0.0",
    ca.OP_LE: "{0} <= {1} ? 1.0 : 0.0",
    ca.OP_IF_ELSE_ZERO: "{0} != 0.0 ? {1} : 0.0",
}


def _link_functions() -> list[ca.Function]:
    joint, link, turned = ca.SX.sym("joint", 6), ca.SX.sym("link", 2), ca.SX.sym("turned", 3)
    body, gravity, push = ca.SX.sym("body", 4), ca.SX.sym("gravity"), ca.SX.sym("push", 3)
    (hand, samples), held = _hand("hand"), ca.SX.sym("held", 4)
    length = ca.SX.sym("tool_length")
    moved = {"joint": joint, "turned": turned}
    mass, along, up, inertia = ca.vertsplit(body)
    given = ca.vertsplit(joint), ca.vertsplit(turned)
    end = link_end(given[0], ca.vertsplit(link), given[1])
    pushed = PlanarBody(mass, (along, up), inertia).push(*given, gravity)
    *bar, angle = ca.vertsplit(held)
    load = held_wrench(Body(*bar), gravity, samples.motion, angle)
    return [
        _function("link_end", {**moved, "link": link}, {"end": ca.vertcat(*end)}),
        _function(
            "link_push",
            {**moved, "body": body, "gravity": gravity},
            {"push": ca.vertcat(*pushed)},
        ),
        _function(
            "joint_torque",
            {"joint": joint, "push": push},
            {"torque": joint_torque(given[0], ca.vertsplit(push))},
        ),
        _function(
            "flange_velocity",
            {"hand": hand, "tool_length": length},
            {"velocity": ca.vertcat(*flange_velocity(length, hand[2], ca.vertsplit(hand[3:6])))},
        ),
        _function(
            "held_load",
            {"hand": hand, "held": held, "gravity": gravity},
            {"load": ca.vertcat(*load)},
        ),
    ]


def _flight_text() -> str:
    start, since, height = ca.SX.sym("start", 6), ca.SX.sym("since"), ca.SX.sym("height")
    gravity, state = ca.SX.sym("gravity"), FlightState(*ca.vertsplit(start))
    law = FlightLaw(gravity)
    end = law.after(state, since)
    pose = _function(
        "pose",
        {"start": start, "since": since, "gravity": gravity},
        {"pose": ca.vertcat(end.x, end.z, end.theta)},
    )
    time = _function(
        "time",
        {"start": start, "height": height, "gravity": gravity},
        {"time": law.fall_time(state, height)},
    )
    return f"""
/* x, z [m] and theta [rad] of a flying bar `since` [s] after x, z, theta and their rates. */
INLINE void flight_pose(const double start[6], double since, double gravity, double pose[3])
{{
    {_scalar(pose)}
}}

/* Time [s] until a bar with x, z, theta and their rates falls through `height`; NaN if never. */
INLINE double fall_time(const double start[6], double height, double gravity)
{{
    double time;
    {_scalar(time)}
    return time;
}}
"""


def _scalar(f: ca.Function) -> str:
    """The body of a function of numbers."""
    work = ", ".join(f"w{i}" for i in range(f.sz_w()))
    body = "\n    ".join([f"double {work};", *_statements(f)]).replace("[l]", "")
    return re.sub(r"(since|height|gravity|time)\[0\]", r"\1", body)


def text() -> str:
    """The text of core/laws.h."""
    head = HEAD.format(iterations=ITERATIONS, lost=LOST_SLIP)
    laws = [*_link_functions(), *_pivot_functions(), *_surface_functions()]
    return head + _flight_text() + "".join(map(_lane_function, laws)) + "\n#endif\n"


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
    gripped = ca.SX.sym("force")
    over = law.excess(ca.vertsplit(state), last.motion, gripped)
    return [
        _function(
            "pivot_step",
            {**moved, "force": force, "dt": dt, "law": p},
            {"next": ca.vertcat(*step)},
        ),
        _function(
            "pivot_excess",
            {"state": state, "end": end, "force": gripped, "law": p},
            {"excess": ca.vertcat(*over)},
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
    largest = ca.fmax(given.radius, 1e-300)
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
            "surface_friction",
            newton,
            {"friction": ca.vertcat(*(y / largest for y in given.trimmed(iterate, held)))},
        ),
        _function(
            "surface_after", {**moved, **newton, "dt": dt, "law": p}, {"next": ca.vertcat(*after)}
        ),
    ]


def _column(found: Iterate) -> Value:
    return ca.vertcat(found.shift, *found.y, found.norm)


def _lane_function(f: ca.Function) -> str:
    """C text of an SX function: void f(const lane in[rows], ..., lane out[rows], ...).

    Names are the function's own. An output must not be the same array as an input. Raises
    ValueError for an operation without a C expression here.
    """
    inputs = [(f.name_in(i), f.nnz_in(i)) for i in range(f.n_in())]
    outputs = [(f.name_out(i), f.nnz_out(i)) for i in range(f.n_out())]
    places = [f"const lane {name}[{rows}]" for name, rows in inputs]
    places += [f"lane {name}[{rows}]" for name, rows in outputs]
    body = "\n        ".join(_statements(f))
    work = ", ".join(f"w{i}" for i in range(f.sz_w()))
    return f"""
INLINE void {f.name()}({", ".join(places)})
{{
    LANES_APART
    EACH_LANE {{
        double {work};
        {body}
    }}
}}
"""


def _statements(f: ca.Function) -> list[str]:
    lines = []
    for k in range(f.n_instructions()):
        operation = f.instruction_id(k)
        operands, results = f.instruction_input(k), f.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            name = f.name_out(results[0])
            lines.append(f"{name}[{results[1]}][l] = w{operands[0]};")
        else:
            lines.append(f"w{results[0]} = {_expression(f, k, operation, operands)};")
    return lines


def _expression(f: ca.Function, k: int, operation: int, operands: list[int]) -> str:
    if operation == ca.OP_CONST:
        constant = float(f.instruction_constant(k))
        return "NAN" if math.isnan(constant) else repr(constant)
    if operation == ca.OP_INPUT:
        return f"{f.name_in(operands[0])}[{operands[1]}][l]"
    if operation not in _EXPRESSIONS:
        raise ValueError(f"{f.name()}: no C expression for CasADi's operation {operation}")
    return _EXPRESSIONS[operation].format(*(f"w{i}" for i in operands))


if __name__ == "__main__":
    (Path(__file__).resolve().parents[1] / "core" / "laws.h").write_text(text(), encoding="utf-8")
