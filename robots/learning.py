"""The next motion for a throw, learnt from the recording of the last one.

Iterative learning control on the reference: a response of the joints is fitted to the recording;
the rest is a disturbance that is expected again. A quadratic program over spline coefficients then
finds the motion to send: the measured throw lands at its target, its joints move nearly as planned
while the pads open, and the sent motion keeps the limits. It may begin earlier and elsewhere than
the plan's: an arm that lags needs a longer run-up.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import casadi as ca
import numpy as np

from ..models import Array, FlightState, HandSamples, Trajectory, low_pass
from ..planner import (
    TICK,
    Code,
    CollisionScene,
    Finding,
    Manipulator,
    Planner,
    Samples,
    SentMotion,
    Throw,
    Verdict,
    column_distance,
    column_of,
    friction_use,
    held_bar,
    lowest_of_bar,
    outline,
    palm_corners,
    palm_distance,
    tool_speeds,
    torque_limits,
    torque_uses,
    verdict_on,
)
from ..problems import InputError, Scene, Torque
from .following import Response
from .recording import CUTOFF, Recording, interpolated


@dataclass(frozen=True)
class LearningSettings:
    """Settings of a correction, and of its quadratic programs.

    rounds, min_gain: programs, at most, and share by which the cost must fall for another one.
    palm_clearance [m]: added to a plan whose correction collides with the hand.
    accurate [m]: pose error (position plus angle times half the length) that needs no correction;
    progress: a correction is sent if its expected error is below this share of the last throw's.

    knot [s]: time between the splines' knots; run_up: knots before the opening beyond the plan's;
    stop: knots after the opening.
    before [s]: the joints follow the plan from this time before the opening until the pads are
    open; away [s]: time after that in which the hand gets out of the object's way.
    window, after, elsewhere: errors of equal cost: joints [rad], rates [rad/s] and accelerations
    [rad/s^2] while the pads open, joints [rad] during `away`, joints [rad] at other times; ease:
    accelerations of that cost, over their limits.
    excess: cost of a use of 2, which exceeds a limit by its own size.
    difference [rad]: step of the release's derivatives; rank: shapes of a joint's motion below this
    share of the largest are left out of these derivatives.
    """

    rounds: int = 30
    min_gain: float = 1e-3
    palm_clearance: float = 0.01
    accurate: float = 4e-4
    progress: float = 0.7
    knot: float = 0.02
    run_up: int = 15
    stop: int = 45
    before: float = 0.02
    away: float = 0.15
    window: tuple[float, float, float] = (0.02, 0.2, 5.0)
    after: float = 0.1
    elsewhere: float = 0.5
    ease: float = 20.0
    excess: float = 1e4
    difference: float = 1e-5
    rank: float = 1e-5


LEARNING = LearningSettings()


@dataclass(frozen=True)
class ConstraintSettings:
    """Settings of a corrected motion's limits.

    share: of a limit that may be used; force_share: of grip and torque limits, because
    accelerations peak at knots between samples. spacing: ticks between samples that limits are
    held at. active: use below which a limit is left out of the program.
    free [m]: clearance whose use is 0; margin [m]: of a clearance, for motion between samples.
    landing [m, rad]: landing error whose use is 1. step: of the derivatives by differences.
    """

    share: float = 0.99
    force_share: float = 0.97
    spacing: int = 4
    active: float = 0.8
    free: float = 0.3
    margin: float = 0.002
    landing: tuple[float, float] = (0.02, 0.2)
    step: float = 1e-6


LIMITS = ConstraintSettings()


@dataclass(frozen=True, eq=False)
class SplineMotion:
    """Joints, rates and accelerations (3, N, n), and their derivatives (3, n, N, K) by the spline
    coefficients of each joint."""

    values: Array
    rows: Array


@dataclass(frozen=True, eq=False)
class Limit:
    """A limit on a motion at its samples `at`, P of them.

    of: its use (P,) by the first `orders` of joints, rates and accelerations, each (n, P), and, of
    a limit on the flight, by the CoM's pose and twist (6,) at `detach`.
    """

    of: Callable[..., Array]
    motion: SplineMotion
    at: slice | Array
    orders: int
    detach: tuple[Array, ...] = ()

    @cached_property
    def state(self) -> tuple[Array, ...]:
        """Joints, rates and accelerations (n, P) that it depends on."""
        return tuple(values[self.at].T for values in self.motion.values[: self.orders])

    @cached_property
    def use(self) -> Array:
        """The use (P,)."""
        return self.of(*self.state, *self.detach)

    def rows(self, point: Array, flown: Array) -> tuple[Array, Array]:
        """Rows and upper bounds of the active samples, to first order about `point` (K, n).

        flown (6, n K): derivatives of the CoM's pose and twist at detach by the coefficients.
        """
        some = np.flatnonzero(self.use > LIMITS.active)
        rows = np.zeros((some.size, point.size))
        for j, unit in enumerate(np.eye(point.shape[1])[:, :, None]):
            for order in range(len(self.state)):
                moved = [v + LIMITS.step * unit * (k == order) for k, v in enumerate(self.state)]
                slope = (self.of(*moved, *self.detach) - self.use) / LIMITS.step
                columns = slice(j * len(point), (j + 1) * len(point))
                jacobian = self.motion.rows[order, j, self.at]
                rows[:, columns] += slope[some, None] * jacobian[some]
        for detach in self.detach:
            for unit, row in zip(np.eye(len(detach)), flown, strict=True):
                slope = (self.of(*self.state, detach + LIMITS.step * unit) - self.use) / LIMITS.step
                rows += slope[some, None] * row
        return rows, LIMITS.share - self.use[some] + rows @ point.T.ravel()


def constraints_of(
    plan: Throw,
    times: Array,
    opening_time: float,
    sent: SplineMotion,
    measured: SplineMotion,
    detach: Array,
) -> Iterator[Limit]:
    """All nonlinear limits of a motion that is to throw as a plan does.

    times (N,) [s] of both motions; detach (6,): the CoM's pose and twist when the pads are open.
    """
    scene, manipulator = plan.scene, plan.manipulator
    opened = int(np.searchsorted(times, opening_time + scene.gripper.profile().opening)) + 1
    every, grips = slice(None, None, LIMITS.spacing), int(np.searchsorted(times, opening_time))
    yield from _speeds(scene, manipulator, sent)

    def grip(place: Array, rate: Array, turn: Array) -> Array:
        hand = HandSamples(place[0], *manipulator.motion(place, rate, turn))
        return friction_use(scene, hand) / LIMITS.force_share

    yield Limit(grip, measured, slice(0, grips, LIMITS.spacing // 2), 3)
    if torque_limits(scene) is not None:

        def torque(place: Array, rate: Array, turn: Array) -> Array:
            path = Trajectory.quintics(LIMITS.spacing * TICK, place.T, rate.T, turn.T)
            uses = torque_uses(scene, manipulator, path, opening_time)
            return np.asarray(uses[:: LIMITS.spacing].max(axis=1) / LIMITS.force_share)

        yield Limit(torque, measured, every, 3)
    for at, holding in (
        (slice(0, opened, LIMITS.spacing), True),
        (slice(opened, None, LIMITS.spacing), False),
    ):
        yield Limit(partial(_carried, scene, manipulator, times[at], holding), measured, at, 1)
    yield from _flights(plan, times, opened, measured, detach)


def _speeds(scene: Scene, manipulator: Manipulator, sent: SplineMotion) -> Iterator[Limit]:
    """Limits on the tool's speed, and on joint speeds where these depend on the position."""
    every, limits = slice(None, None, LIMITS.spacing), manipulator.hard
    if scene.arm is not None and scene.tool_speed is not None:
        tool, tool_speed = scene.arm.tool, scene.tool_speed

        def speed(place: Array, rate: Array) -> Array:
            pose, twist, _ = manipulator.motion(place, rate, 0 * rate)
            return np.asarray(tool_speeds(tool, pose, twist) / tool_speed)

        yield Limit(speed, sent, every, 2)
    if limits.slowing is not None:

        def slowing(joint: int, place: Array, rate: Array) -> Array:
            low, high = limits.velocity(place.T)
            # Distance to both limits, as a share of the largest limit.
            distance = np.minimum(high - rate.T, rate.T - low) / limits.dq
            return np.asarray(1 - distance[:, joint])

        for joint in range(manipulator.size):
            yield Limit(partial(slowing, joint), sent, every, 2)


def _carried(
    scene: Scene, manipulator: Manipulator, times: Array, holding: bool, place: Array
) -> Array:
    """Use of the clearances of arm, hand and held bar to all bodies around them."""
    assert scene.arm is not None
    (pose, heights), column = outline(manipulator, place), column_of(scene)
    bar = held_bar(scene, pose) if holding else None
    obstacles = CollisionScene.of(scene, manipulator)
    clearance = obstacles.min_clearance(obstacles.bodies_at(times, place, bar))
    if scene.workspace is not None and scene.workspace.floor is not None:
        lowest = np.minimum(heights, palm_corners(scene.arm.tool, pose)[1].min(axis=1))
        if bar is not None:
            lowest = np.minimum(lowest, lowest_of_bar(scene.object, bar))
        clearance = np.minimum(clearance, lowest - scene.workspace.floor)
    if column is not None and bar is not None:
        clearance = np.minimum(clearance, column_distance(scene.object, bar, *column))
    return 1 - (clearance - LIMITS.margin) / LIMITS.free


def _flights(
    plan: Throw, times: Array, opened: int, measured: SplineMotion, detach: Array
) -> Iterator[Limit]:
    """Limits on the landing, and on the clearances of the flying bar."""
    scene, manipulator, target = plan.scene, plan.manipulator, plan.target
    arm, obstacles, column = scene.arm, CollisionScene.of(scene, manipulator), column_of(scene)
    assert arm is not None

    def landing_use(side: int, which: int, state: Array) -> Array:
        landed = scene.flight.land(state[None], target.z)[0]
        goal = (target.plane_x, landed[1] if target.theta is None else target.theta)
        off = side * (landed[which] - goal[which]) - target.half_widths[which]
        use = LIMITS.share + off / LIMITS.landing[which]
        return np.asarray(np.nan_to_num([use], nan=np.inf))

    for side in (-1, 1):
        for which in (0, 1):
            yield Limit(partial(landing_use, side, which), measured, slice(0, 1), 0, (detach,))
    lasts = scene.flight.land(detach[None], target.z)[0, 2]
    if not math.isfinite(lasts):
        return
    since = np.arange(0.0, lasts, LIMITS.spacing * TICK)
    at = np.minimum(opened - 1 + LIMITS.spacing * np.arange(since.size), times.size - 1)
    allowed = scene.palm_clearance

    def depth(place: Array, state: Array) -> Array:
        com = scene.flight.after(FlightState(*state), since).pose
        clearance = obstacles.min_clearance(obstacles.bodies_at(since, place, com, flying=True))
        if allowed is not None:
            away = palm_distance(scene.object, arm.tool, com, outline(manipulator, place)[0])
            clearance = np.minimum(clearance, away - allowed)
        if column is not None:
            clearance = np.minimum(clearance, column_distance(scene.object, com, *column))
        return 1 - (clearance - LIMITS.margin) / LIMITS.free

    yield Limit(depth, measured, at, 1, (detach,))


@dataclass(frozen=True, eq=False)
class LearningControl:
    """The program's numbers, on the clock of the motion to find.

    plan: the throw to measure. times (N,) [s]; basis (3, N, K): cubic splines at these, and their
    first and second derivatives; variables are their coefficients (K, n), n throwing joints.
    reach (3, n, N, K): response of each joint to the splines, its rate and acceleration;
    disturbance (3, N, n): what is measured beside the response. window: samples at which the joints
    are to move as planned; after: those at which the hand gets out of the object's way.
    """

    plan: Throw
    opening_time: float
    times: Array
    basis: Array
    reach: Array
    disturbance: Array
    window: slice
    after: slice

    @classmethod
    def of(cls, plan: Throw, recording: Recording) -> LearningControl:
        """The control for a plan, by the recording of a motion that was sent for it.

        The plan's margins of torque and grip are reserves for what the arm does beside the plan:
        they may be used.
        """
        scene = plan.scene
        gripper = scene.gripper.changed(sticking_margin=0.0)
        torque = (
            (scene.torque or Torque()).changed(margin=0.0) if scene.torque_margin else scene.torque
        )
        plan = plan.in_scene(scene.changed(gripper=gripper, torque=torque))
        opening_time = plan.opening_time + LEARNING.knot * LEARNING.run_up
        opening = plan.scene.gripper.profile().opening
        pieces = int(np.ceil((opening_time + opening) / LEARNING.knot)) + LEARNING.stop
        times = np.linspace(0.0, pieces * LEARNING.knot, round(pieces * LEARNING.knot / TICK) + 1)
        basis = _splines(times, pieces)
        recorded, q, sent = recording.throwing(plan)
        response = Response.fitted(sent, q)
        # On the new clock, at rest before and after the recording.
        clock = times - opening_time + recording.opening_time(plan.scene)
        q, sent = (interpolated(clock, recorded, values) for values in (q, sent))
        disturbance = low_pass(times, q - response.all(sent), CUTOFF)[1]
        reach = np.array([response.of(j, basis[0]) for j in range(q.shape[1])])
        instants = opening_time + np.array([-LEARNING.before, opening, opening + LEARNING.away])
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

    def cost(self, coefficients: Array) -> float:
        """Cost of the joints' errors against the plan, and of uses beyond their limits."""
        left, right = self._as_planned
        off = left @ coefficients.T.ravel() - right
        uses = np.array([limit.use.max() for limit in self._constraints(coefficients)])
        beyond = np.maximum(uses - LIMITS.share, 0.0).sum()
        return float(off @ off / 2 + LEARNING.excess * beyond)

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
        square, slope = np.eye(size + count), np.full(size + count, LEARNING.excess)
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
        cost = off @ off / 2 + LEARNING.excess * found[size:].sum()
        return found[:size].reshape(len(self.reach[0]), -1).T, float(cost)

    @cached_property
    def _as_planned(self) -> tuple[Array, Array]:
        """Least squares: joints, rates and accelerations as planned, and small accelerations."""
        every, at = slice(None, None, round(LEARNING.knot / TICK)), self.window
        clock = self.times - self.opening_time + self.plan.opening_time
        plan = list(self.plan.path.at(clock))
        ease, limit = self.basis[2, every], LEARNING.ease * self.plan.manipulator.hard.ddq
        left = [_blocks([ease / (one * np.sqrt(len(ease))) for one in limit])]
        right = [np.zeros(len(left[0]))]
        for order, weight, place in (
            (0, LEARNING.elsewhere, every),
            (0, LEARNING.after, self.after),
            *((order, weight, at) for order, weight in enumerate(LEARNING.window)),
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
        q, dq = (basis[:: LIMITS.spacing] for basis in self.basis[:2])
        ddq = self.basis[2][:: round(LEARNING.knot / TICK)]
        jerk = np.diff(ddq, axis=0) / LEARNING.knot
        middle, half = (limits.q_max + limits.q_min) / 2, (limits.q_max - limits.q_min) / 2
        # As shares of the limits.
        allowed = ((q, half), (dq, limits.dq), (ddq, limits.ddq), (jerk, limits.jerk))
        rows = np.concatenate([_blocks([v / one for one in limit]) for v, limit in allowed])
        between = np.zeros(len(rows))
        between[: n * len(q)] = (middle / half).repeat(len(q))
        return rows, between - LIMITS.share, between + LIMITS.share

    def _constraints(self, point: Array) -> list[Limit]:
        """The limits that are not linear in the coefficients."""
        rows = np.broadcast_to(self.basis[:, None], self.reach.shape)
        sent, measured = (
            SplineMotion(self.basis @ point, rows),
            SplineMotion(self.joints(point), self.reach),
        )
        detach = self.throw(point).release.end
        return [*constraints_of(self.plan, self.times, self.opening_time, sent, measured, detach)]

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
            count, slopes = int((sizes > LEARNING.rank * sizes[0]).sum()), []
            for shape in shapes.T[:count]:
                moved = joints.copy()
                moved[:, j] += LEARNING.difference * shape
                slopes.append((detach(moved) - here) / LEARNING.difference)
            columns.append(np.transpose(slopes) @ (sizes[:count, None] * amounts[:count]))
        return np.hstack(columns)


def _solved(
    square: Array, slope: Array, rows: Array, low: Array, high: Array, lower: Array | float
) -> Array:
    """The quadratic program's solution (K,); InputError if it is infeasible."""
    shapes = {"h": ca.Sparsity.dense(*square.shape), "a": ca.Sparsity.dense(*rows.shape)}
    options: dict[str, Any] = {"error_on_fail": False, "daqp": {"iter_limit": 5000}}
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


def _splines(times: Array, pieces: int) -> Array:
    """Cubic splines at times (N,), and two derivatives, (3, N, K); at rest at both ends."""
    from scipy.interpolate import BSpline

    splines = BSpline(LEARNING.knot * np.arange(-3, pieces + 4), np.eye(pieces + 3), 3)
    rows = np.array([splines(times, order) for order in range(3)])
    # At rest the first three coefficients are equal, and so are the last three.
    first, last = (
        rows[..., ends].sum(axis=-1, keepdims=True) for ends in (slice(3), slice(-3, None))
    )
    return np.concatenate([first, rows[..., 3:-3], last], axis=-1)


@dataclass(frozen=True, eq=False)
class Proposal:
    """A motion to send and the throw expected of it.

    error: its pose error over `LearningSettings.accurate`; verdict: on whether it may be sent.
    """

    sent: Throw
    expected: Throw
    error: float
    verdict: Verdict

    @classmethod
    def of(cls, control: LearningControl, coefficients: Array) -> Proposal:
        """The motion of spline coefficients."""
        expected = control.throw(coefficients)
        samples = Samples(*(control.basis @ coefficients))
        sent = dataclasses.replace(expected, path=samples.path, samples=samples)
        # The next recording corrects the landing error, so that does not forbid sending.
        judged = verdict_on(expected, sent=sent).without(Code.LANDING, Code.ARRIVAL)
        return cls(sent, expected, _error(expected), judged)

    @property
    def good(self) -> bool:
        """Whether it may be sent and needs no further round."""
        return self.verdict.ok and self.error <= 1.0


def corrected(plan: SentMotion, recording: Recording) -> tuple[SentMotion, Throw]:
    """The motion to send next, by the recording of one that was sent for the same plan.

    Also the throw that is expected of it. If the bar would collide with the hand, which lags, a
    plan with more palm clearance is corrected instead. InputError if no motion within the limits
    lands nearer, or if the expected throw breaks a limit of the scene.
    """
    best, reasons = _proposal(plan.throw, recording)
    if reasons and reasons[0].code is Code.PALM:
        roomier = _roomier(plan.throw)
        best, reasons = (best, reasons) if roomier is None else _proposal(roomier, recording)
    if reasons is not None:
        words = reasons[0].words if reasons else "it would land no nearer than the last"
        raise InputError(f"the corrected motion is not sent: {words}")
    return SentMotion.of(best.sent), best.expected


def _roomier(plan: Throw) -> Throw | None:
    """Another throw to the target, planned with more palm clearance."""
    scene = plan.scene
    assert scene.workspace is not None and scene.workspace.palm_clearance is not None
    clearance = scene.workspace.palm_clearance + LEARNING.palm_clearance
    workspace = dataclasses.replace(scene.workspace, palm_clearance=clearance)
    found = Planner(scene.replace(workspace=workspace)).plan(plan.target)
    if not found.solved or found.throw is None:
        return None
    return dataclasses.replace(found.throw.deciding, scene=scene)


def _proposal(plan: Throw, recording: Recording) -> tuple[Proposal, tuple[Finding, ...] | None]:
    """The best motion to send for a throw, and the limits that forbid it, None if it may be sent.

    No limits: it would land no nearer than the last throw.
    """
    control = LearningControl.of(plan, recording)
    found = _rounds(control, control.start())
    best = min(found, key=lambda each: (not each.verdict.ok, each.error))
    nearest = min(found, key=lambda each: each.error)
    allowed = max(LEARNING.progress * _error(recording.throw(plan)), 1.0)
    if best.verdict.ok and best.error < allowed:
        return best, None
    # First those that the nearest landing breaks.
    return best, (*nearest.verdict.broken, *best.verdict.broken)


def _rounds(control: LearningControl, point: Array) -> list[Proposal]:
    """Motions of falling cost by sequential quadratic programs, until one is good."""
    found, cost, step = [Proposal.of(control, point)], control.cost(point), 1.0
    for _ in range(LEARNING.rounds):
        if found[-1].good:
            break
        trial, predicted = control.step_from(point, step)
        if cost - predicted < LEARNING.min_gain * cost:
            break
        now = control.cost(trial)
        # The trust region shrinks if the cost falls by much less than predicted.
        share = (cost - now) / (cost - predicted)
        step *= 0.4 if share < 0.25 else 2.0 if share > 0.75 else 1.0
        if share > 0.0:
            point, cost = trial, now
            found.append(Proposal.of(control, point))
    return found


def _error(throw: Throw) -> float:
    """Pose error of a landing over `LearningSettings.accurate`; infinite without a landing."""
    dx, dtheta = throw.miss()
    error = throw.scene.object.pose_error(dx, dtheta) / LEARNING.accurate
    return error if math.isfinite(error) else math.inf
