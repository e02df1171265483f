"""Derivative functions of a staged NLP for `casadi.nlpsol`, put together stage by stage.

The stages' functions come from `lifting`; here their non-zeros are laid out in the
sparse Jacobian and Hessian of the whole.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from ..compile import digest, source_of
from .assembly import Link, Nlp
from .lifting import differentiate

Places = tuple[list[npt.NDArray[np.int_]], list[npt.NDArray[np.int_]]]


def nlp_key(nlp: Nlp, solver: str) -> str:
    """What `nlp_functions` depends on, as a text."""
    kinds = {link.functions: link.functions.value.serialize() for link in nlp.links}
    chain = [(link.v, link.gap, link.rows, link.ahead, link.data) for link in nlp.links]
    made_by = digest(source_of(differentiate, nlp_functions))
    order = [list(kinds).index(link.functions) for link in nlp.links]
    return repr((solver, made_by, list(kinds.values()), order, chain))


def nlp_functions(nlp: Nlp, solver: str) -> dict[str, ca.Function]:
    """The functions that the solver plug-in would derive itself, by its names for them."""
    x, p, f, g = (nlp.problem[key] for key in ("x", "p", "f", "g"))
    found = {
        "nlp_f": ca.Function("nlp_f", [x, p], [f], ["x", "p"], ["f"]),
        "nlp_g": ca.Function("nlp_g", [x, p], [g], ["x", "p"], ["g"]),
        "nlp_jac_g": _jacobian(nlp),
        "nlp_hess_l": _hessian(nlp, solver),
        "nlp_grad": _lagrangian_gradient(nlp),
    }
    gradient = _gradient(nlp)
    if solver == "ipopt":
        names, outputs = ["f", "grad_f_x"], [f, gradient]
    else:
        names, outputs = ["grad_f_x"], [gradient]
    found["nlp_grad_f"] = ca.Function("nlp_grad_f", [x, p], outputs, ["x", "p"], names)
    return found


def _called(nlp: Nlp, link: Link) -> list[ca.MX]:
    """Arguments (v, d, p) of a stage's functions."""
    x, p = nlp.problem["x"], nlp.problem["p"]
    return [x[link.v], p[link.data], p]


def _gradient(nlp: Nlp) -> ca.MX:
    parts = [link.functions.cost_gradient(*_called(nlp, link)) for link in nlp.links]
    return ca.densify(ca.vertcat(*parts))


def _lagrangian_gradient(nlp: Nlp) -> ca.Function:
    """(x, p, lam_f, lam_g) -> f, g, and the Lagrangian's gradient in x (0 in p: not used)."""
    x, p, f, g = (nlp.problem[key] for key in ("x", "p", "f", "g"))
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", nlp.size[1])
    gradients: list[ca.MX] = []
    for k, link in enumerate(nlp.links):
        gradient = link.functions.gradient(*_called(nlp, link), _multipliers(link, lam_g), lam_f)
        gradients.append(_with_gap_before(nlp, k, gradient, lam_g))
    return ca.Function(
        "nlp_grad",
        [x, p, lam_f, lam_g],
        [f, g, ca.densify(ca.vertcat(*gradients)), ca.MX.zeros(p.numel())],
        ["x", "p", "lam_f", "lam_g"],
        ["f", "g", "grad_gamma_x", "grad_gamma_p"],
    )


def _multipliers(link: Link, lam_g: ca.MX) -> ca.MX:
    """Of a stage's outputs: -lam of the gap, for the gap has -F, and lam of the rows."""
    return ca.vertcat(-lam_g[link.gap], lam_g[link.rows])


def _with_gap_before(nlp: Nlp, k: int, gradient: ca.MX, lam_g: ca.MX) -> ca.MX:
    """A stage's gradient with the +1 of the gap before it."""
    if k == 0:
        return gradient
    states = nlp.nx[k]
    return ca.vertcat(gradient[:states] + lam_g[nlp.links[k - 1].gap], gradient[states:])


def _jacobian(nlp: Nlp) -> ca.Function:
    """(x, p) -> g and its Jacobian: in each gap -dF at its own stage and +1 at the next."""
    x, p = nlp.problem["x"], nlp.problem["p"]
    g: list[ca.MX] = []
    entries: list[ca.MX] = []
    places: Places = ([], [])
    for link in nlp.links:
        outputs, slope = link.functions.jacobian(*_called(nlp, link))
        gap = link.gap.stop - link.gap.start
        g += [x[link.ahead] - outputs[:gap], outputs[gap:]]
        rows, columns = (np.array(v, int) for v in slope.sparsity().get_triplet())
        sign = np.where(rows < gap, -1.0, 1.0)
        entries.append(ca.DM(sign) * _nonzeros(slope))
        _place(places, link.gap.start + rows, link.v.start + columns)
        entries.append(ca.MX(ca.DM.ones(gap)))
        _place(
            places,
            np.arange(link.gap.start, link.gap.stop),
            np.arange(link.ahead.start, link.ahead.stop),
        )
    matrix = _scattered(nlp.size[1], nlp.size[0], places, entries)
    return ca.Function("nlp_jac_g", [x, p], [ca.vertcat(*g), matrix], ["x", "p"], ["g", "jac_g_x"])


def _hessian(nlp: Nlp, solver: str) -> ca.Function:
    """(x, p, lam_f, lam_g) -> Hessian of the Lagrangian; FATROP wants its gradient too."""
    x, p = nlp.problem["x"], nlp.problem["p"]
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", nlp.size[1])
    entries: list[ca.MX] = []
    places: Places = ([], [])
    gradients: list[ca.MX] = []
    for k, link in enumerate(nlp.links):
        multipliers = _multipliers(link, lam_g)
        gradient, curvature = link.functions.hessian(*_called(nlp, link), multipliers, lam_f)
        gradients.append(_with_gap_before(nlp, k, gradient, lam_g))
        if solver == "ipopt":
            curvature = ca.triu(curvature)
        rows, columns = (np.array(v, int) for v in curvature.sparsity().get_triplet())
        entries.append(_nonzeros(curvature))
        _place(places, link.v.start + rows, link.v.start + columns)
    size = nlp.size[0]
    matrix = _scattered(size, size, places, entries)
    inputs, names = [x, p, lam_f, lam_g], ["x", "p", "lam_f", "lam_g"]
    if solver == "ipopt":
        return ca.Function("nlp_hess_l", inputs, [matrix], names, ["triu_hess_gamma_x_x"])
    outputs = [ca.densify(ca.vertcat(*gradients)), matrix]
    return ca.Function("nlp_hess_l", inputs, outputs, names, ["grad_gamma_x", "hess_gamma_x_x"])


def _nonzeros(matrix: ca.MX) -> ca.MX:
    """The non-zeros (nnz, 1), column by column."""
    return matrix.nz[:]


def _place(places: Places, rows: npt.NDArray[np.int_], columns: npt.NDArray[np.int_]) -> None:
    places[0].append(rows)
    places[1].append(columns)


def _scattered(height: int, width: int, places: Places, entries: list[ca.MX]) -> ca.MX:
    """Sparse matrix of all entries; a place occurs once."""
    rows, columns = np.concatenate(places[0]), np.concatenate(places[1])
    order = np.lexsort((rows, columns))
    pattern = ca.Sparsity.triplet(height, width, list(map(int, rows)), list(map(int, columns)))
    return ca.MX(pattern, ca.vertcat(*entries)[list(map(int, order))])
