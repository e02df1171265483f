"""Section `pushes`: the friction laws of `models` on real pushes of a slider on known supports.

The 492 pushes are those of Zhou, Paolini, Bagnell and Mason (ICRA 2016; licence beside the data): a
finger pushes an aluminium triangle 15 mm over hardboard or plywood. Each law is fitted on half of a
log and scored on the other half, both ways: the angle between the measured and the predicted twist
of the measured wrench, and between the measured and the predicted wrench of the measured twist.

Wrench and twist are in units in which the support under even pressure has the torsion arm 1: f_x,
f_y, tau / arm and d_x, d_y, arm d_theta.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares, minimize, nnls
from throwplan.models import Array, SurfaceShape
from throwplan.models.release.patch import Patch, PointSolver
from throwplan.planner.show import BLACK, BLUE, GREEN, GREY, ORANGE, RED, Row, Table

from .page import Effort, Picture, ReportSection, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The pushes: 492 rows.
PUSHES = Path(__file__).parent / "data" / "pushes.csv"
#: Points of the supports [mm] from the right angle along the legs; the patch is the whole face.
SUPPORTS = {
    "pts_wide": ((10, 10), (10, 130), (130, 10)),
    "pts_lopsided": ((10, 10), (90, 30), (10, 130)),
    "pts_inner": ((30, 30), (90, 30), (30, 90)),
    "pts_tight": ((30, 30), (63.33, 43.33), (43.33, 63.33)),
    "patch": (),
}
#: Legs of the triangle, place of its CoM from the right angle [mm], and rows of the face's mesh.
LEG, COM, ROWS = 150.0, 50.0, 7
#: Ellipsoids whose squares add up to the convex quartic.
SQUARES = 3
#: Weight of "on the surface" beside the directions of twists, in fits of quartics.
ON_SURFACE = 0.1
#: Share of the speed over which the corner of |u| is rounded where a twist is sought.
ROUNDED = 1e-4
#: Draws of the intervals: means of pushes drawn with replacement.
DRAWS, SEED = 2000, 33
#: About what errors of poses and the drift of the force within a push make of a twist [deg].
DATA = 3.0
#: Laws, by their colour in the picture.
COLOURS = {
    "sliding pivot": ORANGE,
    "ellipsoid, arm from geometry": GREY,
    "ellipsoid, arm fitted": BLUE,
    "rotated ellipsoid": GREEN,
    "convex quartic": RED,
    "Coulomb points, pressure of statics": "#8c6bb1",
    "Coulomb points, pressure fitted": BLACK,
    "two points": "#118ab2",
}


@dataclass(frozen=True)
class Log:
    """The pushes (N, 3) of one support on one surface: wrenches, twists; the support's points."""

    surface: str
    support: str
    wrench: Array
    twist: Array
    points: Patch

    def part(self, rows: Array) -> Log:
        """Some of its pushes."""
        return Log(self.surface, self.support, self.wrench[rows], self.twist[rows], self.points)


@dataclass(frozen=True)
class Law:
    """A fitted law: twists (N, 3) of wrenches, wrenches (N, 3) of twists; of any length."""

    twist: Callable[[Array], Array]
    wrench: Callable[[Array], Array]


def make(effort: Effort) -> ReportSection:
    """All laws on all logs."""
    logs = read_logs()
    step, errors, arms = effort.counter(len(logs)), dict[tuple[str, str, str], list[Array]](), []
    for log in logs:
        arms.append(1.0 / float(fitted_arm(log)))
        for name, twist, wrench in _scored(log):
            kind = "patch" if log.support == "patch" else "points"
            errors.setdefault((name, kind, "twist"), []).append(twist)
            errors.setdefault((name, kind, "wrench"), []).append(wrench)
        step()
    table = Table("pushes", "Mean angle [deg] to measured pushes", _rows(errors), short=True)
    words = (
        "492 real pushes of a slider on wood, ten logs; each law is fitted on half of a log and "
        f"scored on the other half. The data allow about {DATA:.0f}°. Intervals are 95 % of the "
        "mean, over pushes. `ls`, `ils` and `ls-step` have the ellipsoid; `patch` and, in steady "
        "slip, `lugre` have Coulomb points."
    )
    limits = (
        "A bar between two pads differs: no rubber here, no falling force, and little pure turning."
    )
    low, high = 100 * (min(arms) - 1), 100 * (max(arms) - 1)
    off = (
        f"The arm c r_p of the support's geometry under even pressure is off by {low:+.0f} to "
        f"{high:+.0f} % from the one that fits a log."
    )
    return ReportSection(
        "pushes",
        "Friction laws on real pushes",
        [words, off, limits],
        [table],
        [Picture("pushes", "Mean angle between predicted and measured twist", _draw(table))],
    )


# The data.


def read_logs() -> list[Log]:
    """The ten logs."""
    with PUSHES.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    logs = []
    for surface, support in dict.fromkeys((row["surface"], row["support"]) for row in rows):
        own = [r for r in rows if (r["surface"], r["support"]) == (surface, support)]
        values = np.array([[float(x) for x in list(row.values())[3:9]] for row in own])
        points, arm = support_of(support)
        unit = np.array([1.0, 1.0, arm])
        logs.append(Log(surface, support, values[:, :3] / unit, values[:, 3:] * unit, points))
    return logs


def support_of(name: str) -> tuple[Patch, float]:
    """A support as points of torsion arm 1, with the pressure of statics, and its arm [m].

    Three points bear the weight as the CoM between them says, a face evenly.
    """
    places = np.array(SUPPORTS[name] or list(_face()), float) - COM
    weights = np.full(len(places), 1.0 / len(places))
    if SUPPORTS[name]:
        weights = np.linalg.solve(np.vstack([places.T, np.ones(3)]), [0.0, 0.0, 1.0])
    arm = float(np.hypot(*places.T) @ weights)
    x, y = places.T / arm
    return Patch(x, y, weights), arm / 1e3


def _face() -> Iterator[tuple[float, float]]:
    """Centres of equal triangles in the face."""
    size = LEG / ROWS
    for i in range(ROWS):
        for j in range(ROWS - i):
            yield (i + 1 / 3) * size, (j + 1 / 3) * size
            if i + j < ROWS - 1:
                yield (i + 2 / 3) * size, (j + 2 / 3) * size


# The laws.


def quartic_law(shape: SurfaceShape) -> Law:
    """The twist is the normal of the surface; the wrench bears the largest power of a twist."""

    def normal(wrench: Array) -> Array:
        return np.array(shape.normal(list(wrench.T))).T

    def wrench(twist: Array) -> Array:
        found = []
        for v in _unit(twist):

            def cost(w: Array, v: Array = v) -> tuple[float, Array]:
                size, slope = float(shape.gauge(list(w))), normal(w[None])[0]
                return _ratio(float(np.log(size)), slope / (4 * size**4), w, v)

            found.append(minimize(cost, v, jac=True, method="BFGS").x)
        return np.array(found)

    return Law(normal, wrench)


def points_law(patch: Patch) -> Law:
    """Each point's friction is along its slip; the twist of a wrench costs the least power."""
    solver = PointSolver(patch)

    def wrench(twist: Array, rounded: float = 1e-12) -> Array:
        u = solver.slips(np.asarray(twist).T)
        size = np.sqrt(u[0] ** 2 + u[1] ** 2 + rounded**2 * (np.asarray(twist) ** 2).sum(axis=1))
        return solver.collect(u / np.maximum(size, 1e-300)).T

    def twist(wrenches: Array) -> Array:
        found = []
        for f in _unit(wrenches):

            def cost(v: Array, f: Array = f) -> tuple[float, Array]:
                force = wrench(v[None], ROUNDED)[0]
                power = max(float(force @ v), 1e-12)
                return _ratio(float(np.log(power)), force / power, v, f)

            found.append(minimize(cost, f, jac=True, method="BFGS").x)
        return np.array(found)

    return Law(twist, wrench)


def pivot_law(arm: float) -> Law:
    """The sliding pivot, whose limits of force and torque do not know each other.

    A wrench moves what is nearer to its own limit; a twist takes both limits.
    """

    def twist(wrench: Array) -> Array:
        turns = np.abs(wrench[:, 2]) / arm > np.hypot(wrench[:, 0], wrench[:, 1])
        return np.where(turns[:, None], wrench * [0.0, 0.0, 1.0], wrench * [1.0, 1.0, 0.0])

    def wrench(twist: Array) -> Array:
        return np.column_stack([_unit(twist[:, :2]), arm * np.sign(twist[:, 2])])

    return Law(twist, wrench)


def _ratio(log_size: float, slope: Array, at: Array, along: Array) -> tuple[float, Array]:
    """log(size(at) / (along . at)) and its slope; large where the power is not positive."""
    power = float(along @ at)
    if power <= 1e-9:
        return 1e6, -1e6 * along
    return log_size - float(np.log(power)), slope - along / power


# Fits.


def fitted_arm(log: Log) -> float:
    """Torsion arm of the plain ellipsoid whose normals are nearest to the twists."""

    def off(x: Array) -> Array:
        return (_unit(log.wrench * [1.0, 1.0, np.exp(-2 * x[0])]) - _unit(log.twist)).ravel()

    return float(np.exp(least_squares(off, [0.0]).x[0]))


def fitted_quartic(log: Log, squares: int) -> SurfaceShape:
    """Sum of squared ellipsoids, which is convex; one is a rotated ellipsoid."""
    sizes = np.linalg.norm(log.wrench, axis=1).mean()
    wrench, twist = log.wrench / sizes, _unit(log.twist)
    lower = np.tril_indices(3)

    def shape(x: Array) -> SurfaceShape:
        quartics = []
        for row in x.reshape(squares, 6):
            root = np.zeros((3, 3))
            root[lower] = row
            matrix = root @ root.T
            entries = [*np.diag(matrix), matrix[0, 1], matrix[0, 2], matrix[1, 2]]
            quartics.append(SurfaceShape.squared(entries).quartic)
        return SurfaceShape(tuple(np.sum(quartics, axis=0).tolist()))

    def off(x: Array) -> Array:
        law = quartic_law(shape(x))
        size = shape(x).gauge(list(wrench.T))
        return np.concatenate([(_unit(law.twist(wrench)) - twist).ravel(), ON_SURFACE * (size - 1)])

    # Each square starts longer along another axis.
    start = np.array([np.eye(3) + 0.5 * np.diag(np.eye(3)[k % 3]) for k in range(squares)])
    x0 = np.array([matrix[lower] for matrix in start]).ravel() * squares**-0.25
    return shape(least_squares(off, x0, max_nfev=200).x)


def fitted_pressure(log: Log) -> Patch:
    """Weights of the points, by least squares of the wrenches with none below 0."""
    points, columns = log.points, []
    for i in range(len(points.x)):
        one = Patch(points.x[i : i + 1], points.z[i : i + 1], np.ones(1))
        columns.append(points_law(one).wrench(log.twist).ravel())
    weights = nnls(np.array(columns).T, log.wrench.ravel())[0]
    return Patch(points.x, points.z, weights / weights.sum())


def fitted_points(log: Log) -> Patch:
    """Two points about the CoM: their direction and distance, by least squares of the wrenches."""

    def patch(x: Array) -> Patch:
        along, up = np.exp(x[0]) * np.cos(x[1]), np.exp(x[0]) * np.sin(x[1])
        return Patch(np.array([-along, along]), np.array([-up, up]), np.full(2, 0.5))

    def off(x: Array) -> Array:
        return (_unit(points_law(patch(x)).wrench(log.twist)) - _unit(log.wrench)).ravel()

    fits = [least_squares(off, [0.0, angle]) for angle in (0.0, 0.8, 1.6, 2.4)]
    return patch(min(fits, key=lambda fit: fit.cost).x)


def laws_of(log: Log) -> dict[str, Law]:
    """Every law, fitted on a log."""
    arm = fitted_arm(log)
    plain = [SurfaceShape.of("ellipsoid", (1, 1, a**-2, 0, 0, 0)) for a in (1.0, arm)]
    laws = [
        pivot_law(arm),
        *map(quartic_law, plain),
        quartic_law(fitted_quartic(log, 1)),
        quartic_law(fitted_quartic(log, SQUARES)),
        points_law(log.points),
        points_law(fitted_pressure(log)),
        points_law(fitted_points(log)),
    ]
    return dict(zip(COLOURS, laws, strict=True))


# Scores.


def _scored(log: Log) -> Iterator[tuple[str, Array, Array]]:
    """Each law's angles [deg] of twists and of wrenches on the half that it was not fitted on."""
    for half in (0, 1):
        fits = np.arange(len(log.wrench)) % 2 == half
        known, other = log.part(fits), log.part(~fits)
        for name, law in laws_of(known).items():
            twist = _angles(law.twist(other.wrench), other.twist)
            yield name, twist, _angles(law.wrench(other.twist), other.wrench)


def _rows(errors: dict[tuple[str, str, str], list[Array]]) -> list[Row]:
    rng, rows = np.random.default_rng(SEED), list[Row]()
    for name in COLOURS:
        row: Row = {"law": name}
        for kind in ("patch", "points"):
            for what in ("twist", "wrench"):
                values = np.concatenate(errors[name, kind, what])
                drawn = values[rng.integers(0, len(values), (DRAWS, len(values)))].mean(axis=1)
                low, high = np.percentile(drawn, [2.5, 97.5])
                row[f"{kind}: {what} [°]"] = float(values.mean()), float(low), float(high)
        rows.append(row)
    return rows


def _unit(rows: Array) -> Array:
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def _angles(one: Array, other: Array) -> Array:
    """Angles (N,) [deg] between rows."""
    cosines = (_unit(one) * _unit(other)).sum(axis=1)
    return np.asarray(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))))


def _draw(table: Table) -> Figure:
    figure, axes = panels(7.6, 3.6, 1, 2, sharey=True)
    for axis, kind in zip(axes[0], ("patch", "points"), strict=True):
        for i, row in enumerate(reversed(table.rows)):
            cell = row[f"{kind}: twist [°]"]
            assert isinstance(cell, tuple)
            value, low, high = cell
            colour = COLOURS[str(row["law"])]
            axis.plot([low, high], [i, i], color=colour, lw=2)
            axis.plot(value, i, "o", color=colour)
        axis.axvline(DATA, color=GREY, ls=":", lw=1)
        axis.set(xlabel="twist of a wrench [°]", title=f"on {kind}", xlim=(0, None))
        axis.set_yticks(range(len(table.rows)), [str(r["law"]) for r in reversed(table.rows)])
    return figure
