"""Steps on limit surfaces of other shapes than the plain ellipsoid, see `models/surface.py`.

`ImpulseProblem` of limit_surface.py, in the hand's axes, is given: slip K w - rhs for an impulse w
of gauge(w) <= R. Sticking, K w = rhs, is the answer if that is inside. Otherwise:

*A quartic.* Its gauge h is homogeneous: the ellipsoid w^T Q w = R^2, Q the Hessian of h^2 / 2,
touches the surface along the ray through w, with its normal and its curvature. The impulse of
largest dissipation on that ellipsoid, `ImpulseProblem` again, is the next w: a Newton iteration. In
the first iterations a share of the plane across w is added to Q, which keeps the normal: it bounds
the ellipsoid where the surface is flat, and makes the iterations converge from afar.

*Two points.* Newton's method with the shares of Coulomb's limit as unknowns of their own, as in
patch.py; its 7 unknowns are the slip and both points' shares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..backend import Value, backend
from ..surface import polynomial, quartic_gauge
from .limit_surface import ImpulseProblem, solve_symmetric
from .patch import CREEP

#: Newton iterations on a quartic; of 1500 random steps on random quartics one needs more.
QUARTIC_ITERATIONS = 30
#: Share of the plane across w in the first iteration's Q, and what is left of it in the next one.
FIRST_SHARE, LEFT = 1.0, 0.3
#: Newton iterations of the two points.
POINT_ITERATIONS = 60
#: Change of w, as a share of R, at which the iterations end.
SETTLED = 1e-11
#: Places of the entries of a symmetric matrix, as in `ImpulseProblem`.
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))

Vector = Sequence[Value]


@dataclass(frozen=True)
class QuarticStep:
    """A step on a quartic of 15 coefficients."""

    base: ImpulseProblem
    coefficients: Vector

    def tangent(self, w: Vector, share: Value) -> tuple[ImpulseProblem, Vector]:
        """The step on the ellipsoid that touches the quartic at w, and T (9 values, row by row),
        upper triangular, with w = T y and T T^T = Q^-1."""
        q = [self._curvature(w, share, i, j) for i, j in PAIRS]
        xp = backend(*q, *w)
        # Q = L L^T, T = L^-T.
        l11 = xp.sqrt(q[0])
        l21, l31 = q[3] / l11, q[4] / l11
        l22 = xp.sqrt(q[1] - l21 * l21)
        l32 = (q[5] - l21 * l31) / l22
        l33 = xp.sqrt(q[2] - l31 * l31 - l32 * l32)
        t11, t22, t33 = 1.0 / l11, 1.0 / l22, 1.0 / l33
        t12, t23 = -l21 * t11 * t22, -l32 * t22 * t33
        t13 = (l21 * l32 * t22 - l31) * t11 * t33
        rows = ((t11, t12, t13), (0.0, t22, t23), (0.0, 0.0, t33))
        columns = [[row[i] for row in rows] for i in range(3)]
        image = [_times(self.base.matrix, column) for column in columns]
        matrix = [_dot(columns[i], image[j]) for i, j in PAIRS]
        rhs = [_dot(column, self.base.rhs) for column in columns]
        return ImpulseProblem(matrix, rhs, self.base.radius), [x for row in rows for x in row]

    def _curvature(self, w: Vector, share: Value, i: int, j: int) -> Value:
        """Entry of Q at w: the Hessian of sqrt(H) / 2, and the share of the plane across w."""
        c, size = self.coefficients, backend(*w).sqrt(_dot(w, w) + 1e-300)
        u = [value / size for value in w]
        root = backend(*w).sqrt(polynomial(c, u) + 1e-300)
        bend = polynomial(c, u, i, j) / (4.0 * root)
        bend = bend - polynomial(c, u, i) * polynomial(c, u, j) / (8.0 * root * root * root)
        return bend + share * root * (float(i == j) - u[i] * u[j])

    def wrench(self, y: Vector, factor: Vector, w: Vector) -> tuple[list[Value], Value]:
        """T y, moved along its ray onto the quartic, and how far it is from w as a share of R."""
        radius = self.base.radius
        image = [_dot(factor[3 * i : 3 * i + 3], y) for i in range(3)]
        gauge = quartic_gauge(image, self.coefficients)
        scale = radius / backend(gauge).maximum(gauge, 1e-300)
        found = [scale * value for value in image]
        return found, _distance(found, w, radius)


@dataclass(frozen=True)
class PointsStep:
    """A step on two points; the unknowns: slip (3) and shares (2 each)."""

    base: ImpulseProblem

    def wrench(self, unknowns: Vector) -> list[Value]:
        """The impulse that leaves this slip: K^-1 (slip + rhs)."""
        total = [a + b for a, b in zip(unknowns[:3], self.base.rhs, strict=True)]
        return solve_symmetric(self.base.matrix, 0.0, total)

    def refined(self, unknowns: Vector) -> tuple[list[Value], Value]:
        """One Newton iteration, and how far w moved as a share of R."""
        slip, xp = list(unknowns[:3]), backend(*unknowns)
        half, old = 0.5 * self.base.radius, self.wrench(unknowns)
        units = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        inverse = [solve_symmetric(self.base.matrix, 0.0, unit) for unit in units]
        matrix, rest = [inverse[j][i] for i, j in PAIRS], list(old)
        points = []
        for side, share in ((-1.0, unknowns[3:5]), (1.0, unknowns[5:7])):
            u = slip[0], slip[1] + side * slip[2]
            speed = xp.sqrt(u[0] * u[0] + u[1] * u[1])
            steep = 1.0 / (CREEP + speed)
            exact = u[0] * steep, u[1] * steep
            way = [value / xp.maximum(speed, 1e-300) for value in u]
            # Derivative of the share by the point's slip, its symmetric part.
            s_xx = steep * (1.0 - share[0] * way[0])
            s_zz = steep * (1.0 - share[1] * way[1])
            s_xz = -0.5 * steep * (share[0] * way[1] + share[1] * way[0])
            points.append((side, exact, (s_xx, s_zz, s_xz)))
            added = (s_xx, s_zz, s_zz, s_xz, side * s_xz, side * s_zz)
            matrix = [a + half * b for a, b in zip(matrix, added, strict=True)]
            force = exact[0], exact[1], side * exact[1]
            rest = [a + half * b for a, b in zip(rest, force, strict=True)]
        step = solve_symmetric(matrix, 0.0, [-value for value in rest])
        found = [a + b for a, b in zip(slip, step, strict=True)]
        for side, exact, (s_xx, s_zz, s_xz) in points:
            d_x, d_z = step[0], step[1] + side * step[2]
            y_x, y_z = exact[0] + s_xx * d_x + s_xz * d_z, exact[1] + s_xz * d_x + s_zz * d_z
            size = xp.maximum(xp.sqrt(y_x * y_x + y_z * y_z), 1.0)
            found += [y_x / size, y_z / size]
        return found, _distance(self.wrench(found), old, self.base.radius)


def _dot(one: Vector, other: Vector) -> Value:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def _times(matrix: Vector, vector: Vector) -> list[Value]:
    """A symmetric matrix times a vector."""
    xx, zz, tt, xz, xt, zt = matrix
    return [_dot(row, vector) for row in ((xx, xz, xt), (xz, zz, zt), (xt, zt, tt))]


def _distance(one: Vector, other: Vector, radius: Value) -> Value:
    xp, away = backend(*one), [abs(a - b) for a, b in zip(one, other, strict=True)]
    largest = xp.maximum(xp.maximum(away[0], away[1]), away[2])
    return largest / xp.maximum(radius, 1e-300)
