"""The laws as C text, from the models' CasADi expressions: writes core/laws.h.

    python -m throwplan.models.write_core_laws

A law is a loop over lanes: one step of LANES throws side by side; a single throw has one lane.
Values are arrays [rows][LANES], so that the compiler turns each loop into vector instructions. No
branch is left in a loop: a choice is a conditional expression.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

from .backend import Value
from .body import Body, HandSamples, PinchContact, lowest_point, pivot_wrench, sticking_state
from .flight import FlightLaw, FlightState
from .release.cases import LOST_SLIP
from .release.integrators import rk4_step
from .release.limit_surface import ITERATIONS, ImpulseProblem, Iterate, LimitSurfaceStepping
from .release.sliding_pivot import SlidingPivot
from .robot.kinematics import PlanarBody, flange_velocity, joint_torque, link_end, turned_by

HEAD = """\
/* Written by `python -m throwplan.models.write_core_laws`: do not edit. */
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
    sizes = {"joint": 6, "link": 2, "turned": 3, "body": 4, "gravity": 1, "push": 3, "held": 4}
    sizes |= {"load": 3, "limit": 2, "place": 4, "box": 3}
    s = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    (s["hand"], samples), s["tool_length"] = _hand("hand"), ca.SX.sym("tool_length")
    joint, turned, twist = map(ca.vertsplit, (s["joint"], s["turned"], s["hand"][3:6]))
    mass, along, up, inertia = ca.vertsplit(s["body"])
    bar_mass, bar_inertia, *lever = ca.vertsplit(s["held"])
    end = link_end(joint, ca.vertsplit(s["link"]), turned)
    push = PlanarBody(mass, (along, up), inertia).push(joint, turned, s["gravity"])
    torque = joint_torque(joint, ca.vertsplit(s["push"]))
    velocity = flange_velocity(s["tool_length"], s["hand"][2], twist)
    hand = samples.motion
    # The inertia is that about the pads.
    load = pivot_wrench(Body(bar_mass, bar_inertia, 0.0), s["gravity"], hand, hand.omega, *lever)
    force, arm = ca.vertsplit(s["limit"])
    # A contact whose limits under a pad's force of 1 N are these.
    contact = PinchContact(friction=force, patch_radius=arm, torsion=1.0, faces=1.0)
    _, z, cos, sin = ca.vertsplit(s["place"])
    first, last, half = ca.vertsplit(s["box"])
    lowest = lowest_point(z, cos, sin, (first, last), half)
    f_x, f_z, torsion = ca.vertsplit(s["load"])
    use = contact.utilisation_squared(f_x, f_z, torsion, 1.0)
    return [
        _law("link_end", s, "joint turned link", end=end),
        _law("link_push", s, "joint turned body gravity", push=push),
        _law("joint_torque", s, "joint push", torque=[torque]),
        _law("flange_velocity", s, "hand tool_length", velocity=velocity),
        _law("held_load", s, "hand held gravity", load=load),
        _law("grip_use", s, "load limit", use=[use]),
        _law("box_lowest", s, "place box", lowest=[lowest]),
    ]


def _single_text() -> str:
    """Functions of numbers, not of lanes."""
    sizes = {"start": 6, "since": 1, "height": 1, "gravity": 1, "joint": 4, "link": 2}
    s = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    state, law = FlightState(*ca.vertsplit(s["start"])), FlightLaw(s["gravity"])
    end = law.after(state, s["since"])
    pose = _law("pose", s, "start since gravity", pose=[end.x, end.z, end.theta])
    time = _law("time", s, "start height gravity", time=[law.fall_time(state, s["height"])])
    x, z, cos, sin = ca.vertsplit(s["joint"])
    along, up = turned_by(ca.vertsplit(s["link"]), cos, sin)
    place = _law("place", s, "joint link", place=[x + along, z + up])
    return f"""
/* x, z [m] and theta [rad] of a flying bar `since` [s] after x, z, theta and their rates. */
INLINE void flight_pose(const double start[6], double since, double gravity, double pose[3])
{{
    {_scalar(pose)}
}}

/* A place on a link, or its end [m]; joint: x, z [m], cosine and sine of the link's angle. */
INLINE void link_place(const double joint[4], const double link[2], double place[2])
{{
    {_scalar(place)}
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
    return head + _single_text() + "".join(map(_lane_function, laws)) + "\n#endif\n"


def _hand(name: str) -> tuple[ca.SX, HandSamples]:
    """Pose, twist and acceleration (9,) of a hand, and these as the laws take them."""
    symbols: Value = ca.SX.sym(name, 9)
    return symbols, HandSamples(0.0, symbols[:3], symbols[3:6], symbols[6:9])


def _number_symbols() -> tuple[ca.SX, Body, PinchContact, ca.SX]:
    """Symbols of `law_numbers`: the column, and the body, contact and gravity it describes."""
    p = ca.SX.sym("p", 8)
    return p, Body(p[0], p[1], p[2]), PinchContact(p[3], p[4], p[5], p[6]), p[7]


def _law(
    name: str, symbols: dict[str, ca.SX], inputs: str, **outputs: Sequence[Value]
) -> ca.Function:
    """A law of the named `inputs`; outputs: the rows of each."""
    names = inputs.split()
    dense = [ca.cse(ca.densify(ca.vertcat(*rows))) for rows in outputs.values()]
    return ca.Function(name, [symbols[one] for one in names], dense, names, [*outputs])


def _pivot_functions() -> list[ca.Function]:
    p, body, contact, gravity = _number_symbols()
    law, paper = (SlidingPivot(body, contact, gravity, form) for form in ("continuous", "paper"))
    hands = {name: _hand(name) for name in ("start", "middle", "end")}
    s = {"state": ca.SX.sym("state", 6), "dt": ca.SX.sym("dt"), "law": p}
    s |= {name: symbols for name, (symbols, _) in hands.items()}
    forces, force = {"force": ca.SX.sym("force", 3)}, {"force": ca.SX.sym("force")}
    motions = [hand.motion for _, hand in hands.values()]
    grips = ca.vertsplit(forces["force"])
    step, paper_step = (
        rk4_step(one.rates, s["state"], motions, grips, s["dt"]) for one in (law, paper)
    )
    excess = law.excess(ca.vertsplit(s["state"]), motions[-1], force["force"])
    com = law.com_state(s["state"], s["end"][:3], s["end"][3:6], motions[-1])
    return [
        _law("pivot_step", s | forces, "state start middle end force dt law", next=step),
        _law("paper_step", s | forces, "state start middle end force dt law", next=paper_step),
        _law("pivot_excess", s | force, "state end force law", excess=excess),
        _law("pivot_lost", s, "state law", lost=[law.lost(s["state"])]),
        _law("pivot_end", s, "state end law", com=com),
    ]


def _surface_functions() -> list[ca.Function]:
    p, body, contact, gravity = _number_symbols()
    law = LimitSurfaceStepping(body, contact, gravity)
    sizes = {"state": 6, "problem": 10, "found": 5}
    sizes |= dict.fromkeys(("grasp", "force", "dt", "held", "moving"), 1)
    s = {name: ca.SX.sym(name, size) for name, size in sizes.items()} | {"law": p}
    (s["start"], first), (s["end"], last) = _hand("start"), _hand("end")
    state, dt, held, found = s["state"], s["dt"], s["held"], s["found"]
    begun = sticking_state(s["start"][:3], s["start"][3:6], s["grasp"], law.body.com_offset)
    lever = law.lever(state, (first, last), dt)
    posed = law.problem(state, (first, last), lever, s["force"], dt)
    rows = ca.vertsplit(s["problem"])
    given = ImpulseProblem(rows[:6], rows[6:9], rows[9])
    iterate = Iterate(found[0], ca.vertsplit(found[1:4]), found[4])
    sticking, trimmed = given.sticking(), given.trimmed(iterate, held)
    better = given.refined(iterate, s["moving"])
    friction = [y / ca.fmax(given.radius, 1e-300) for y in trimmed]
    after = law.after(state, (first, last), lever, trimmed, dt)
    newton, rhs = "problem found held", [*posed.matrix, *posed.rhs, posed.radius]
    return [
        _law("surface_start", s, "start grasp law", state=begun),
        _law("surface_problem", s, "state start end force dt law", problem=rhs),
        _law(
            "surface_sticking",
            s,
            "problem",
            found=[sticking.shift, *sticking.y, sticking.norm],
            held=[sticking.norm <= given.radius],
        ),
        _law("surface_moving", s, newton, moving=[given.moving(iterate, held)]),
        _law(
            "surface_refined",
            s,
            "problem found moving",
            better=[better.shift, *better.y, better.norm],
        ),
        _law("surface_friction", s, newton, friction=friction),
        _law("surface_after", s, f"state start end {newton} dt law", next=after),
    ]


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
