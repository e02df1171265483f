"""What to send so that a throw is measured as it should be: a quadratic program over splines."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import HandSamples, Path, low_pass
from ...problems import InputError
from ..check import (
    TICK,
    Throw,
    friction_use,
    held_bar,
    lowest_of_bar,
    outline,
    palm_corners,
    palm_distance,
    tool_speeds,
    torque_limits,
    torques_of,
)
from .recording import CUTOFF, Recording
from .response import Response

Array = npt.NDArray[np.float64]

#: Between the splines' knots [s], and how many a motion has more before the opening than the
#: plan's, and after it.
KNOT, RUN_UP, STOP = 0.02, 15, 45
#: Joints are to move as planned from so long [s] before the opening on until the pads are open;
#: for so long after that the hand gets out of the object's way.
BEFORE, AWAY = 0.02, 0.15
#: Share of the limits that a motion uses, ticks between the places where it is held to them, and
#: the share from which on it is held to curved ones.
SHARE, PLACES, NEARLY = 0.99, 4, 0.8
#: Share of grip and torque that is used: accelerations have corners at knots, sharper than samples
#: show.
FORCE = 0.97
#: So many of the limits are linear, the first ones.
LINEAR = 4
#: Room [m] that counts as a whole use of a clearance, and how much of a use a round mends.
ROOM, MENDED = 0.1, 0.1
#: Kept back [m] of the hand's clearance: the flight is another one after each round.
MORE = 0.006
#: What weighs alike in the program: joints, rates and accelerations off the plan's while the pads
#: open [rad, rad/s, rad/s^2], joints off it after that and elsewhere [rad], the landing off the
#: target [m, rad], and accelerations as shares of their limits.
WINDOW, AFTER, ELSEWHERE = (0.02, 0.2, 5.0), 0.1, 0.5
LANDING, EASE = (2e-4, 2e-3), 20.0
#: Steps [rad, rad/s, rad/s^2] of the landing's derivatives.
SMALL = (1e-5, 1e-4, 1e-3)


@dataclass(frozen=True, eq=False)
class Lesson:
    """The program's numbers, on the clock of the motion that is looked for.

    plan: the throw that is wanted. times (N,) [s]; basis: cubic splines (N, K) at these, and their
    first and second derivatives; variables are their coefficients (K, n), n throwing joints.
    reach (3, n, N, K): what each joint does of the splines, its rate and acceleration; anyway
    (3, N, n): what would be measured beside that; last (K, n): nearly what was sent. window: the
    samples at which the joints are to
    move as planned; after: those at which the hand gets out of the object's way.
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

    def better(self, near: Array | None = None, step: float = 1.0) -> Array:
        """The program's solution; what is not linear in it is linearised about coefficients.

        step: how far it may go from there.
        """
        terms = [*self._as_planned()]
        if near is not None:
            terms += [self._landing(near), *self._steps(near, step)]
        left, right = (np.concatenate(part) for part in zip(*terms, strict=True))
        square, slope = left.T @ left, -left.T @ right
        every = [*self._limits(near)]
        # Where what is curved asks for too much from here, the rounds that follow mend it.
        for some in (every, every[:LINEAR]):
            limits, low, high = map(np.concatenate, zip(*some, strict=True))
            shapes = {"h": ca.Sparsity.dense(*square.shape), "a": ca.Sparsity.dense(*limits.shape)}
            solver = ca.conic("next", "daqp", shapes, {"error_on_fail": False})
            found = solver(h=square, g=slope, a=limits, lba=low, uba=high)
            if solver.stats()["success"]:
                return np.array(found["x"]).reshape(len(self.reach[0]), -1).T
        raise InputError("no corrected motion keeps the limits")

    def _as_planned(self) -> Iterator[tuple[Array, Array]]:
        """Joints, rates and accelerations as planned in the window, joints elsewhere; and ease."""
        every, at = slice(None, None, round(KNOT / TICK)), self.window
        clock = self.times - self.opening_time + self.plan.opening_time
        plan = list(self.plan.path.at(clock))
        for order, weight, place in (
            (0, ELSEWHERE, every),
            (0, AFTER, self.after),
            *((order, weight, at) for order, weight in enumerate(WINDOW)),
        ):
            wanted = plan[order][:, place] - self.anyway[order][place].T
            scale = weight * np.sqrt(wanted.shape[1])
            yield _blocks(self.reach[order][:, place]) / scale, wanted.ravel() / scale
        ease, most = self.basis[2][every], EASE * self.plan.mover.hard.ddq
        blocks = _blocks([ease / (one * np.sqrt(len(ease))) for one in most])
        yield blocks, np.zeros(len(blocks))

    def _steps(self, near: Array, step: float) -> Iterator[tuple[Array, Array]]:
        """What is expected in the window moves little in one round."""
        for order, weight in enumerate(WINDOW):
            scale = step * weight * np.sqrt(self.window.stop - self.window.start)
            blocks = _blocks(self.reach[order][:, self.window]) / scale
            yield blocks, blocks @ near.T.ravel()

    def _landing(self, near: Array) -> tuple[Array, Array]:
        """The landing off the target, to first order in positions, rates and accelerations."""
        at, joints = self.window, self.joints(near)[0][self.window]
        since = self.times[at] - self.opening_time
        shapes = np.column_stack([since**0, since, since**2 / 2])

        def off(moved: Array) -> Array:
            path = Path.through(self.times[at], moved)
            throw = dataclasses.replace(self.plan, path=path, opening_time=self.opening_time)
            return np.array(throw.miss())

        here, scale = off(joints), np.array(LANDING)
        # Least squares of the shapes to what a spline does in the window.
        amounts = np.linalg.pinv(shapes)
        columns = []
        for j, reach in enumerate(self.reach[0]):
            slopes = []
            for shape, step in zip(shapes.T, SMALL, strict=True):
                moved = joints.copy()
                moved[:, j] += step * shape
                slopes.append((off(moved) - here) / step)
            columns.append(np.transpose(slopes) @ amounts @ reach[at])
        rows = np.hstack(columns)
        return rows / scale[:, None], (rows @ near.T.ravel() - here) / scale

    def _limits(self, near: Array | None) -> Iterator[tuple[Array, Array, Array]]:
        """Rows between bounds: positions, rates, accelerations, jerks; what is curved."""
        limits, n = self.plan.mover.hard, len(self.reach[0])
        assert limits.jerk is not None
        q, dq = (basis[::PLACES] for basis in self.basis[:2])
        ddq = self.basis[2][:: round(KNOT / TICK)]
        jerk = np.diff(ddq, axis=0) / KNOT
        middle, half = (limits.q_max + limits.q_min) / 2, (limits.q_max - limits.q_min) / 2
        for rows, lowest, highest in (
            (q, middle - SHARE * half, middle + SHARE * half),
            (dq, -SHARE * limits.dq, SHARE * limits.dq),
            (ddq, -SHARE * limits.ddq, SHARE * limits.ddq),
            (jerk, -SHARE * limits.jerk, SHARE * limits.jerk),
        ):
            yield _blocks([rows] * n), lowest.repeat(len(rows)), highest.repeat(len(rows))
        if near is None:
            return
        state, rows = [q @ near, dq @ near], np.array([[q] * n, [dq] * n])
        scene, mover = self.plan.scene, self.plan.mover
        if scene.arm is not None and scene.tool_speed is not None:
            tool, most = scene.arm.tool, scene.tool_speed

            def speed(place: Array, rate: Array) -> Array:
                pose, twist, _ = mover.motion(place, rate, 0 * rate)
                return np.asarray(tool_speeds(tool, pose, twist) / most)

            yield _held(speed, state, rows)
        if limits.slowing is not None:
            for j in range(n):
                one = np.eye(n)[j]

                def slowing(place: Array, rate: Array, one: Array = one) -> Array:
                    low, high = limits.velocity(place.T)
                    # Room to either side, as a share of the limit that is the same everywhere.
                    room = np.minimum(high - rate.T, rate.T - low) / limits.dq
                    return 1 - room @ one

                yield _held(slowing, state, rows)
        held = slice(0, int(np.searchsorted(self.times, self.opening_time)), PLACES // 2)

        def grip(place: Array, rate: Array, turn: Array) -> Array:
            hand = HandSamples(place[0], *mover.motion(place, rate, turn))
            return np.asarray(np.hypot(*friction_use(scene, hand)) / FORCE)

        joints = self.joints(near)
        yield _held(grip, [v[held] for v in joints], self.reach[:, :, held])
        every = slice(None, None, PLACES)
        if torque_limits(scene) is not None:

            def torque(place: Array, rate: Array, turn: Array) -> Array:
                path = Path.quintics(PLACES * TICK, place.T, rate.T, turn.T)
                torques = torques_of(scene, mover, path, self.opening_time)
                return np.asarray(torques.use[::PLACES].max(axis=1) / FORCE)

            yield _held(torque, [v[every] for v in joints], self.reach[:, :, every])
        if scene.workspace is not None:
            yield from self._clear(near, joints[0])

    def _clear(self, near: Array, joints: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Arm, hand and held bar above the floor; the bar in flight clear of the hand."""
        scene, mover, throw = self.plan.scene, self.plan.mover, self.throw(near)
        workspace, arm = scene.workspace, scene.arm
        assert workspace is not None and arm is not None
        floor, clearance = workspace.floor, workspace.palm_clearance
        if floor is not None:

            def arm_depth(place: Array) -> Array:
                pose, heights = outline(mover, place)
                lowest = np.minimum(heights, palm_corners(arm.tool, pose)[1].min(axis=1))
                return np.asarray(1 - (lowest - floor) / ROOM)

            def bar_depth(place: Array) -> Array:
                bar = held_bar(scene, outline(mover, place)[0])
                return 1 - (lowest_of_bar(scene.object, bar) - floor) / ROOM

            for depth, until in ((arm_depth, None), (bar_depth, self.window.stop)):
                at = slice(None, until, PLACES)
                yield _held(depth, [joints[at]], self.reach[:1, :, at])
        if clearance is not None and throw.lands:
            at = slice(self.window.stop, self.after.stop, PLACES)
            flown = throw.flight(self.times[at] - throw.detach_time)
            least = clearance + MORE

            def nearness(place: Array) -> Array:
                away = palm_distance(scene.object, arm.tool, flown, outline(mover, place)[0])
                return 1 - (away - least) / ROOM

            yield _held(nearness, [joints[at]], self.reach[:1, :, at])


def _held(
    use: Callable[..., Array], state: Sequence[Array], rows: Array
) -> tuple[Array, Array, Array]:
    """Rows that hold a use of something, 1 at most, where it is large, to first order.

    use: (P,) of joints and their derivatives, each (n, P); state: these, each (P, n); rows
    (derivatives, n, P, K): how they depend on the coefficients.
    """
    here, step, found = use(*(values.T for values in state)), 1e-6, []
    # What is broken by far is mended in several rounds.
    bound = np.maximum(SHARE - here, -MENDED)
    for j, unit in enumerate(np.eye(state[0].shape[1])):
        slopes = []
        for order in range(len(state)):
            moved = [v + step * unit * (k == order) for k, v in enumerate(state)]
            slopes.append((use(*(values.T for values in moved)) - here) / step)
            bound = bound + slopes[-1] * state[order][:, j]
        found.append(np.einsum("op,opk->pk", np.array(slopes), rows[:, j]))
    held = np.hstack(found)
    near = (here > NEARLY) & held.any(axis=1)
    return held[near], np.full(near.sum(), -np.inf), bound[near]


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
