"""The laws as C text, from what the models do with CasADi symbols: writes core/laws.h.

    python -m throwplan.planner.compile.core_laws

A law is a loop over lanes: the same step for LANES throws side by side, one for a single throw.
Values are arrays [rows][LANES], so that the compiler turns each loop into vector instructions. No
branch is left in a loop: a choice is a conditional expression.
"""

from __future__ import annotations

from pathlib import Path

import casadi as ca

from ...models import (
    ITERATIONS,
    LOST_SLIP,
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

HEAD = """\
/* Written by `python -m throwplan.planner.compile.core_laws`: do not edit. */
#define ITERATIONS {iterations}
/* Slip beyond the CoM's distance by which the body has left the pads [m]. */
#define LOST_SLIP {lost}
"""

#: C expressions of CasADi's operations with one and with two operands.
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


def text() -> str:
    """The whole of core/laws.h."""
    laws = [*_pivot_functions(), *_surface_functions()]
    return HEAD.format(iterations=ITERATIONS, lost=LOST_SLIP) + "".join(
        _lane_function(law) for law in laws
    )


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
    #pragma GCC ivdep
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
        return repr(float(f.instruction_constant(k)))
    if operation == ca.OP_INPUT:
        return f"{f.name_in(operands[0])}[{operands[1]}][l]"
    if operation not in _EXPRESSIONS:
        raise ValueError(f"{f.name()}: no C expression for CasADi's operation {operation}")
    return _EXPRESSIONS[operation].format(*(f"w{i}" for i in operands))


if __name__ == "__main__":
    (Path(__file__).resolve().parents[2] / "core" / "laws.h").write_text(text(), encoding="utf-8")
