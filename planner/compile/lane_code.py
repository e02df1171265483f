"""CasADi functions as C loops over lanes: the same step for several throws side by side.

A lane is one throw of a block. Values of a block are arrays [rows][LANES], so that the
compiler turns each loop into vector instructions. No branch is left in a loop: a choice
is a conditional expression.
"""

from __future__ import annotations

import casadi as ca

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

#: What the loops below need. glibc's libmvec has sines of several lanes; GCC uses them for
#: functions declared like this, but not for its own built-in ones (-fno-builtin-sin).
HEAD = """\
#include <math.h>
#if defined __GLIBC__ && defined __x86_64__ && defined __GNUC__ && !defined __clang__
__attribute__((simd("notinbranch"), const)) double sin(double);
__attribute__((simd("notinbranch"), const)) double cos(double);
#endif
#define LANES {lanes}
#define EACH_LANE for (int l = 0; l < LANES; l++)
typedef double lane[LANES];
"""

#: -O3 would unroll the short loops before they can be vectorised. The other flags give up
#: errno and floating-point exceptions, which nobody reads; NaN keeps its meaning.
FLAGS = (
    "-O2",
    "-ftree-vectorize",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-builtin-sin",
    "-fno-builtin-cos",
)


def lane_function(f: ca.Function) -> str:
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
static void {f.name()}({", ".join(places)})
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
