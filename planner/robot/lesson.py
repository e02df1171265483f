"""What to send so that a throw is measured as it should be: a quadratic program over splines."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array, Path, low_pass
from ...problems import InputError
from ..check import TICK, Throw
from ..follow import Response
from .recording import CUTOFF, Recording
from .uses import SHARE, SplineMotion, Use, uses_of

#: Between the splines' knots [s], and how many a motion has more before the opening than the
#: plan's, and after it.
KNOT, RUN_UP, STOP = 0.02, 15, 45
#: Joints are to move as planned from so long [s] before the opening on until the pads are open;
#: for so long after that the hand gets out of the object's way.
BEFORE, AWAY = 0.02, 0.15
#: Ticks between the places where a motion is held to linear limits.
PLACES = 4
#: What weighs alike in the program: joints, rates and accelerations off the plan's while the pads
#: open [rad, rad/s, rad/s^2], joints off it after that and elsewhere [rad], and accelerations as
#: shares of their limits.
WINDOW, AFTER, ELSEWHERE, EASE = (0.02, 0.2, 5.0), 0.1, 0.5, 20.0
#: What it costs to use something beyond its limit by as much as the limit allows.
EXCESS = 1e4
#: Iterations of the solver at most.
MOST = 5000
#: Step [rad] of the release's derivatives; shapes of a joint's motion that are smaller by this than
#: its largest are left out of them.
SMALL, RANK = 1e-5, 1e-5


@dataclass(frozen=True, eq=False)
class Lesson:
    """The program's numbers, on the clock of the motion that is looked for.

    plan: the throw that is wanted. times (N,) [s]; basis: cubic splines (N, K) at these, and their
    first and second derivatives; variables are their coefficients (K, n), n throwing joints.
    reach (3, n, N, K): what each joint does of the splines, its rate and acceleration; anyway
    (3, N, n): what would be measured beside that; last (K, n): nearly what was sent. window: the
    samples at which the joints are to move as planned; after: those at which the hand gets out of
    the object's way.
    """

    plan: Throw
    opening_time: float
    times: Array
    basis: tuple[Array, Array, Array]
    reach: Array
    anyway: Array
    last: Array
    window: slice
    after: slice

    @classmethod
    def of(cls, plan: Throw, recording: Recording) -> Lesson:
        """By a recording of something that was sent for it."""
        opening_time = plan.opening_time + KNOT * RUN_UP
        opening = plan.scene.gripper.profile().opening
        pieces = int(np.ceil((opening_time + opening) / KNOT)) + STOP
        times = np.linspace(0.0, pieces * KNOT, round(pieces * KNOT / TICK) + 1)
        basis = _splines(times, pieces)
        then, q, sent = recording.throwing(plan)
        response = Response.fitted(sent, q)
        # On the new clock, at rest before and after the recording.
        clock = times - opening_time + recording.opening_time(plan.scene)
        q, last = (
            np.column_stack([np.interp(clock, then, column) for column in values.T])
            for values in (q, sent)
        )
        anyway = low_pass(times, q - response.all(last), CUTOFF)[1]
        reach = np.array([response.of(j, basis[0]) for j in range(q.shape[1])])
        instants = opening_time + np.array([-BEFORE, opening, opening + AWAY])
        first, opened, end = np.searchsorted(times, instants).tolist()
        return cls(
            *(plan, opening_time, times, basis),
            _derivatives(reach, 1),
            _derivatives(anyway, 0),
            np.linalg.lstsq(basis[0], last, rcond=None)[0],
            window=slice(first, opened + 1),
            after=slice(opened + 1, end),
        )

    def joints(self, coefficients: Array) -> Array:
        """The joints that will be measured, their rates and accelerations (3, N, n)."""
        return np.asarray(self.anyway + np.einsum("ojtk,kj->otj", self.reach, coefficients))

    def throw(self, coefficients: Array) -> Throw:
        """What is expected of them."""
        path = Path.through(self.times, self.joints(coefficients)[0])
        return dataclasses.replace(self.plan, path=path, opening_time=self.opening_time)

    # The program.

    def cost(self, coefficients: Array) -> float:
        """How far the joints are off the plan's, and what uses beyond their limits cost."""
        left, right = self._as_planned
        off = left @ coefficients.T.ravel() - right
        beyond = [max(use.here.max() - SHARE, 0.0) for use in self._uses(coefficients)]
        return float(off @ off / 2 + EXCESS * sum(beyond))

    def starts(self) -> list[Array]:
        """Coefficients as planned, and as was sent, as the limits of what is sent allow."""
        left, right = self._as_planned
        wanted = ((left.T @ left, left.T @ right), (np.eye(self.last.size), self.last.T.ravel()))
        found = [_solved(square, -slope, *self._limits, -np.inf) for square, slope in wanted]
        return [values.reshape(len(self.reach[0]), -1).T for values in found]

    def better(self, near: Array, step: float) -> tuple[Array, float]:
        """Coefficients (K, n) that cost less, to first order of what is not linear in them.

        step: how far they go from `near` in what weighs alike. Also what they are then expected to
        cost.
        """
        left, right = self._as_planned
        flown, here = self._flown(near), near.T.ravel()
        held = [use.rows(near, flown) for use in self._uses(near)]
        # By how much a use is beyond its limit at most is a variable of its own.
        count, size = len(held), near.size
        square, slope = np.eye(size + count), np.full(size + count, EXCESS)
        # Steps weigh as much as what is off the plan, over `step`.
        square[:size, :size] = (1 + step**-2) * left.T @ left
        slope[:size] = -left.T @ (right + step**-2 * (left @ here))
        rows, low, high = self._limits
        # What was rounded a moment ago is no way out.
        low, high = np.minimum(low, rows @ here), np.maximum(high, rows @ here)
        own = [-np.eye(count)[[k] * len(most)] for k, (_, most) in enumerate(held)]
        used = np.column_stack([np.vstack([use for use, _ in held]), np.vstack(own)])
        rows = np.vstack([np.column_stack([rows, np.zeros((len(rows), count))]), used])
        low = np.append(low, np.full(len(used), -np.inf))
        high = np.concatenate([high, *(most for _, most in held)])
        least = np.append(np.full(size, -np.inf), np.zeros(count))
        found = _solved(square, slope, rows, low, high, least)
        off = left @ found[:size] - right
        cost = off @ off / 2 + EXCESS * found[size:].sum()
        return found[:size].reshape(len(self.reach[0]), -1).T, float(cost)

    @cached_property
    def _as_planned(self) -> tuple[Array, Array]:
        """Joints, rates and accelerations as planned in the window, joints elsewhere; and ease."""
        every, at = slice(None, None, round(KNOT / TICK)), self.window
        clock = self.times - self.opening_time + self.plan.opening_time
        plan = list(self.plan.path.at(clock))
        ease, most = self.basis[2][every], EASE * self.plan.mover.hard.ddq
        left = [_blocks([ease / (one * np.sqrt(len(ease))) for one in most])]
        right = [np.zeros(len(left[0]))]
        for order, weight, place in (
            (0, ELSEWHERE, every),
            (0, AFTER, self.after),
            *((order, weight, at) for order, weight in enumerate(WINDOW)),
        ):
            wanted = plan[order][:, place] - self.anyway[order][place].T
            scale = weight * np.sqrt(wanted.shape[1])
            left.append(_blocks(self.reach[order][:, place]) / scale)
            right.append(wanted.ravel() / scale)
        return np.vstack(left), np.concatenate(right)

    @cached_property
    def _limits(self) -> tuple[Array, Array, Array]:
        """Rows between bounds: positions, rates, accelerations and jerks of what is sent."""
        limits, n = self.plan.mover.hard, len(self.reach[0])
        assert limits.jerk is not None
        q, dq = (basis[::PLACES] for basis in self.basis[:2])
        ddq = self.basis[2][:: round(KNOT / TICK)]
        jerk = np.diff(ddq, axis=0) / KNOT
        middle, half = (limits.q_max + limits.q_min) / 2, (limits.q_max - limits.q_min) / 2
        # As shares of what is allowed.
        allowed = ((q, half), (dq, limits.dq), (ddq, limits.ddq), (jerk, limits.jerk))
        rows = np.concatenate([_blocks([v / one for one in most]) for v, most in allowed])
        between = np.zeros(len(rows))
        between[: n * len(q)] = (middle / half).repeat(len(q))
        return rows, between - SHARE, between + SHARE

    def _uses(self, near: Array) -> Iterator[Use]:
        """Of all limits that are not linear in the coefficients."""
        sent = np.array([basis @ near for basis in self.basis])
        detach = self.throw(near).release.end
        n = len(self.reach[0])
        moves = (
            SplineMotion(sent, np.array([[basis] * n for basis in self.basis])),
            SplineMotion(self.joints(near), self.reach),
        )
        return uses_of(self.plan, self.times, self.opening_time, *moves, detach)

    def _flown(self, near: Array) -> Array:
        """How the CoM's pose and twist at detach depend on the coefficients (6, n K)."""
        at, joints = self.window, self.joints(near)[0][self.window]

        def detach(moved: Array) -> Array:
            path = Path.through(self.times[at], moved)
            throw = dataclasses.replace(self.plan, path=path, opening_time=self.opening_time)
            return throw.release.end

        here, columns = detach(joints), []
        for j, reach in enumerate(self.reach[0]):
            # All that a joint can do in the window is a few shapes.
            shapes, sizes, amounts = np.linalg.svd(reach[at], full_matrices=False)
            count, slopes = int((sizes > RANK * sizes[0]).sum()), []
            for shape in shapes.T[:count]:
                moved = joints.copy()
                moved[:, j] += SMALL * shape
                slopes.append((detach(moved) - here) / SMALL)
            columns.append(np.transpose(slopes) @ (sizes[:count, None] * amounts[:count]))
        return np.hstack(columns)


def _solved(
    square: Array, slope: Array, rows: Array, low: Array, high: Array, least: Array | float
) -> Array:
    """The quadratic program's solution (K,); InputError where there is none."""
    shapes = {"h": ca.Sparsity.dense(*square.shape), "a": ca.Sparsity.dense(*rows.shape)}
    options: dict[str, Any] = {"error_on_fail": False, "daqp": {"iter_limit": MOST}}
    solver = ca.conic("next", "daqp", shapes, options)
    found = solver(h=square, g=slope, a=rows, lba=low, uba=high, lbx=least)
    if not solver.stats()["success"]:
        raise InputError("no corrected motion keeps the limits")
    return np.array(found["x"]).ravel()


def _derivatives(values: Array, axis: int) -> Array:
    """Samples at 1 kHz along `axis`, and their first and second derivatives."""
    rates = np.gradient(values, TICK, axis=axis)
    return np.array([values, rates, np.gradient(rates, TICK, axis=axis)])


def _blocks(parts: Iterable[Array]) -> Array:
    """Side by side on the diagonal."""
    from scipy.linalg import block_diag

    return np.asarray(block_diag(*parts))


def _splines(times: Array, pieces: int) -> tuple[Array, Array, Array]:
    """Cubic splines (N, K) at times (N,), and two derivatives; at rest at both ends."""
    from scipy.interpolate import BSpline

    splines = BSpline(KNOT * np.arange(-3, pieces + 4), np.eye(pieces + 3), 3)
    found = []
    for order in range(3):
        rows = splines(times, order)
        # At rest the first three coefficients are alike, and so are the last three.
        ends = rows[:, :3].sum(axis=1), rows[:, -3:].sum(axis=1)
        found.append(np.column_stack([ends[0], rows[:, 3:-3], ends[1]]))
    return found[0], found[1], found[2]
