"""Learning control: the quadratic program over splines that finds the motion to send."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array, Trajectory, low_pass
from ...problems import InputError
from ..follow import Response
from ..throw import TICK, Throw
from .constraints import LIMITS, Constraint, SplineMotion, constraints_of
from .recording import CUTOFF, Recording


@dataclass(frozen=True)
class ControlSettings:
    """Settings of the quadratic program.

    knot [s]: time between the splines' knots; run_up: knots before the opening beyond the plan's;
    stop: knots after the opening.
    before [s]: the joints follow the plan from this time before the opening until the pads are
    open; away [s]: time after that in which the hand gets out of the object's way.
    spacing: ticks between samples that linear limits are held at.
    window, after, elsewhere: errors of equal cost: joints [rad], rates [rad/s] and accelerations
    [rad/s^2] while the pads open, joints [rad] during `away`, joints [rad] at other times; ease:
    accelerations of that cost, over their limits.
    excess: cost of a use of 2, which exceeds a limit by its own size.
    max_iterations: of the solver.
    difference [rad]: step of the release's derivatives; rank: shapes of a joint's motion below this
    share of the largest are left out of these derivatives.
    """

    knot: float = 0.02
    run_up: int = 15
    stop: int = 45
    before: float = 0.02
    away: float = 0.15
    spacing: int = 4
    window: tuple[float, float, float] = (0.02, 0.2, 5.0)
    after: float = 0.1
    elsewhere: float = 0.5
    ease: float = 20.0
    excess: float = 1e4
    max_iterations: int = 5000
    difference: float = 1e-5
    rank: float = 1e-5


CONTROL = ControlSettings()


@dataclass(frozen=True, eq=False)
class LearningControl:
    """The program's numbers, on the clock of the motion to find.

    plan: the throw to measure. times (N,) [s]; basis: cubic splines (N, K) at these, and their
    first and second derivatives; variables are their coefficients (K, n), n throwing joints.
    reach (3, n, N, K): response of each joint to the splines, its rate and acceleration;
    disturbance (3, N, n): what is measured beside the response. window: samples at which the joints
    are to move as planned; after: those at which the hand gets out of the object's way.
    """

    plan: Throw
    opening_time: float
    times: Array
    basis: tuple[Array, Array, Array]
    reach: Array
    disturbance: Array
    window: slice
    after: slice

    @classmethod
    def of(cls, plan: Throw, recording: Recording) -> LearningControl:
        """The control for a plan, by the recording of a motion that was sent for it."""
        opening_time = plan.opening_time + CONTROL.knot * CONTROL.run_up
        opening = plan.scene.gripper.profile().opening
        pieces = int(np.ceil((opening_time + opening) / CONTROL.knot)) + CONTROL.stop
        times = np.linspace(0.0, pieces * CONTROL.knot, round(pieces * CONTROL.knot / TICK) + 1)
        basis = _splines(times, pieces)
        recorded, q, sent = recording.throwing(plan)
        response = Response.fitted(sent, q)
        # On the new clock, at rest before and after the recording.
        clock = times - opening_time + recording.opening_time(plan.scene)
        q, sent = (
            np.column_stack([np.interp(clock, recorded, column) for column in values.T])
            for values in (q, sent)
        )
        disturbance = low_pass(times, q - response.all(sent), CUTOFF)[1]
        reach = np.array([response.of(j, basis[0]) for j in range(q.shape[1])])
        instants = opening_time + np.array([-CONTROL.before, opening, opening + CONTROL.away])
        first, opened, end = np.searchsorted(times, instants).tolist()
        return cls(
            *(plan, opening_time, times, basis),
            _derivatives(reach, 1),
            _derivatives(disturbance, 0),
            window=slice(first, opened + 1),
            after=slice(opened + 1, end),
        )

    def joints(self, coefficients: Array) -> Array:
        """Expected joints, rates and accelerations (3, N, n)."""
        return np.asarray(self.disturbance + np.einsum("ojtk,kj->otj", self.reach, coefficients))

    def throw(self, coefficients: Array) -> Throw:
        """The expected throw of coefficients."""
        path = Trajectory.through(self.times, self.joints(coefficients)[0])
        return dataclasses.replace(self.plan, path=path, opening_time=self.opening_time)

    # The program.

    def cost(self, coefficients: Array) -> float:
        """Cost of the joints' errors against the plan, and of uses beyond their limits."""
        left, right = self._as_planned
        off = left @ coefficients.T.ravel() - right
        beyond = [
            max(limit.use.max() - LIMITS.share, 0.0) for limit in self._constraints(coefficients)
        ]
        return float(off @ off / 2 + CONTROL.excess * sum(beyond))

    def start(self) -> Array:
        """Coefficients (K, n) nearest to the plan within the linear limits."""
        left, right = self._as_planned
        found = _solved(left.T @ left, -left.T @ right, *self._limits, -np.inf)
        return found.reshape(len(self.reach[0]), -1).T

    def step_from(self, point: Array, step: float) -> tuple[Array, float]:
        """Coefficients (K, n) of less cost, with limits to first order about `point`; that cost.

        step: length of the trust region, in the weights of the program.
        """
        left, right = self._as_planned
        flown, here = self._flown(point), point.T.ravel()
        limits = [limit.rows(point, flown) for limit in self._constraints(point)]
        # The largest excess of each limit is a variable of its own.
        count, size = len(limits), point.size
        square, slope = np.eye(size + count), np.full(size + count, CONTROL.excess)
        # A step costs as much as the same error against the plan, over `step`.
        square[:size, :size] = (1 + step**-2) * left.T @ left
        slope[:size] = -left.T @ (right + step**-2 * (left @ here))
        rows, low, high = self._limits
        # Rounding may have put `point` outside.
        low, high = np.minimum(low, rows @ here), np.maximum(high, rows @ here)
        own = [-np.eye(count)[[k] * len(limit)] for k, (_, limit) in enumerate(limits)]
        used = np.column_stack([np.vstack([use for use, _ in limits]), np.vstack(own)])
        rows = np.vstack([np.column_stack([rows, np.zeros((len(rows), count))]), used])
        low = np.append(low, np.full(len(used), -np.inf))
        high = np.concatenate([high, *(limit for _, limit in limits)])
        lower = np.append(np.full(size, -np.inf), np.zeros(count))
        found = _solved(square, slope, rows, low, high, lower)
        off = left @ found[:size] - right
        cost = off @ off / 2 + CONTROL.excess * found[size:].sum()
        return found[:size].reshape(len(self.reach[0]), -1).T, float(cost)

    @cached_property
    def _as_planned(self) -> tuple[Array, Array]:
        """Least squares: joints, rates and accelerations as planned, and small accelerations."""
        every, at = slice(None, None, round(CONTROL.knot / TICK)), self.window
        clock = self.times - self.opening_time + self.plan.opening_time
        plan = list(self.plan.path.at(clock))
        ease, limit = self.basis[2][every], CONTROL.ease * self.plan.manipulator.hard.ddq
        left = [_blocks([ease / (one * np.sqrt(len(ease))) for one in limit])]
        right = [np.zeros(len(left[0]))]
        for order, weight, place in (
            (0, CONTROL.elsewhere, every),
            (0, CONTROL.after, self.after),
            *((order, weight, at) for order, weight in enumerate(CONTROL.window)),
        ):
            goal = plan[order][:, place] - self.disturbance[order][place].T
            scale = weight * np.sqrt(goal.shape[1])
            left.append(_blocks(self.reach[order][:, place]) / scale)
            right.append(goal.ravel() / scale)
        return np.vstack(left), np.concatenate(right)

    @cached_property
    def _limits(self) -> tuple[Array, Array, Array]:
        """Rows between bounds: positions, rates, accelerations and jerks of what is sent."""
        limits, n = self.plan.manipulator.hard, len(self.reach[0])
        assert limits.jerk is not None
        q, dq = (basis[:: CONTROL.spacing] for basis in self.basis[:2])
        ddq = self.basis[2][:: round(CONTROL.knot / TICK)]
        jerk = np.diff(ddq, axis=0) / CONTROL.knot
        middle, half = (limits.q_max + limits.q_min) / 2, (limits.q_max - limits.q_min) / 2
        # As shares of the limits.
        allowed = ((q, half), (dq, limits.dq), (ddq, limits.ddq), (jerk, limits.jerk))
        rows = np.concatenate([_blocks([v / one for one in limit]) for v, limit in allowed])
        between = np.zeros(len(rows))
        between[: n * len(q)] = (middle / half).repeat(len(q))
        return rows, between - LIMITS.share, between + LIMITS.share

    def _constraints(self, point: Array) -> Iterator[Constraint]:
        """The limits that are not linear in the coefficients."""
        sent = np.array([basis @ point for basis in self.basis])
        detach = self.throw(point).release.end
        n = len(self.reach[0])
        moves = (
            SplineMotion(sent, np.array([[basis] * n for basis in self.basis])),
            SplineMotion(self.joints(point), self.reach),
        )
        return constraints_of(self.plan, self.times, self.opening_time, *moves, detach)

    def _flown(self, point: Array) -> Array:
        """Derivatives (6, n K) of the CoM's pose and twist at detach by the coefficients."""
        at, joints = self.window, self.joints(point)[0][self.window]

        def detach(moved: Array) -> Array:
            path = Trajectory.through(self.times[at], moved)
            throw = dataclasses.replace(self.plan, path=path, opening_time=self.opening_time)
            return throw.release.end

        here, columns = detach(joints), []
        for j, reach in enumerate(self.reach[0]):
            # The motion of a joint in the window is a sum of a few shapes.
            shapes, sizes, amounts = np.linalg.svd(reach[at], full_matrices=False)
            count, slopes = int((sizes > CONTROL.rank * sizes[0]).sum()), []
            for shape in shapes.T[:count]:
                moved = joints.copy()
                moved[:, j] += CONTROL.difference * shape
                slopes.append((detach(moved) - here) / CONTROL.difference)
            columns.append(np.transpose(slopes) @ (sizes[:count, None] * amounts[:count]))
        return np.hstack(columns)


def _solved(
    square: Array, slope: Array, rows: Array, low: Array, high: Array, lower: Array | float
) -> Array:
    """The quadratic program's solution (K,); InputError if it is infeasible."""
    shapes = {"h": ca.Sparsity.dense(*square.shape), "a": ca.Sparsity.dense(*rows.shape)}
    options: dict[str, Any] = {
        "error_on_fail": False,
        "daqp": {"iter_limit": CONTROL.max_iterations},
    }
    solver = ca.conic("next", "daqp", shapes, options)
    found = solver(h=square, g=slope, a=rows, lba=low, uba=high, lbx=lower)
    if not solver.stats()["success"]:
        raise InputError("no corrected motion keeps the limits")
    return np.array(found["x"]).ravel()


def _derivatives(values: Array, axis: int) -> Array:
    """Samples at 1 kHz along `axis`, and their first and second derivatives."""
    rates = np.gradient(values, TICK, axis=axis)
    return np.array([values, rates, np.gradient(rates, TICK, axis=axis)])


def _blocks(parts: Iterable[Array]) -> Array:
    """A block-diagonal matrix."""
    from scipy.linalg import block_diag

    return np.asarray(block_diag(*parts))


def _splines(times: Array, pieces: int) -> tuple[Array, Array, Array]:
    """Cubic splines (N, K) at times (N,), and two derivatives; at rest at both ends."""
    from scipy.interpolate import BSpline

    splines = BSpline(CONTROL.knot * np.arange(-3, pieces + 4), np.eye(pieces + 3), 3)
    found = []
    for order in range(3):
        rows = splines(times, order)
        # At rest the first three coefficients are equal, and so are the last three.
        ends = rows[:, :3].sum(axis=1), rows[:, -3:].sum(axis=1)
        found.append(np.column_stack([ends[0], rows[:, 3:-3], ends[1]]))
    return found[0], found[1], found[2]
