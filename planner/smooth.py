"""The motion that is sent: samples every millisecond, from rest to rest.

For an arm Ruckig follows the planned states tick by tick within the real limits on
velocity, acceleration and jerk, and brakes after detach. A hand has no jerk limit:
its planned motion is sampled and it brakes at constant acceleration.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from .motion import TICK, PlannedMotion, SampledMotion
from .mover import Limits, Mover

Array = npt.NDArray[np.float64]

#: Ruckig's limits as a share of the real ones: differences of rounded samples stay inside.
SHARE = 0.999


def send(mover: Mover, planned: PlannedMotion) -> SampledMotion:
    """Samples of the launch and release, then of the brake to rest."""
    if mover.hard.jerk is None:
        parts = _braked_hand(mover.hard, planned)
    else:
        ticks = math.ceil(planned.times[-1] / TICK - 1e-9)
        q, dq, ddq = (values.T for values in planned.at(np.asarray(TICK * np.arange(ticks + 1))))
        q, dq, ddq = _follow(mover.hard, mover.hard.jerk, q, dq, ddq)
        brake = _jerk_limited_brake(mover.hard, mover.hard.jerk, q[-1], dq[-1], ddq[-1])
        parts = [np.vstack(pair) for pair in zip((q, dq, ddq), brake, strict=True)]
    return SampledMotion(*parts)


def _follow(limits: Limits, jerk: Array, q: Array, dq: Array, ddq: Array) -> list[Array]:
    """Ruckig chases the samples: each tick heads for the next one, from where it got to."""
    import ruckig

    n = q.shape[1]
    otg, trajectory = ruckig.Ruckig(n), ruckig.Trajectory(n)
    order = ruckig.InputParameter(n)
    order.max_velocity = list(SHARE * limits.dq)
    order.max_acceleration = list(SHARE * limits.ddq)
    order.max_jerk = list(SHARE * jerk)
    order.minimum_duration = TICK
    state = (list(q[0]), [0.0] * n, [0.0] * n)
    sent = [state]
    for i in range(1, len(q)):
        order.current_position, order.current_velocity, order.current_acceleration = state
        order.target_position = list(q[i])
        order.target_velocity = list(np.clip(dq[i], -SHARE * limits.dq, SHARE * limits.dq))
        order.target_acceleration = list(np.clip(ddq[i], -SHARE * limits.ddq, SHARE * limits.ddq))
        result = otg.calculate(order, trajectory)
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise SmoothingError(f"Ruckig could not follow at t = {i * TICK:.3f} s: {result.name}")
        state = trajectory.at_time(TICK)
        sent.append(state)
    return [np.array([tick[k] for tick in sent]) for k in range(3)]


def _jerk_limited_brake(
    limits: Limits, jerk: Array, q: Array, dq: Array, ddq: Array
) -> list[Array]:
    """Samples after the given state until rest, time-optimal per joint."""
    import ruckig

    n = len(q)
    otg, trajectory = ruckig.Ruckig(n), ruckig.Trajectory(n)
    order = ruckig.InputParameter(n)
    order.control_interface = ruckig.ControlInterface.Velocity
    order.current_position, order.current_velocity = list(q), list(dq)
    order.current_acceleration = list(ddq)
    order.target_velocity = order.target_acceleration = [0.0] * n
    order.max_acceleration = list(SHARE * limits.ddq)
    order.max_jerk = list(SHARE * jerk)
    result = otg.calculate(order, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise SmoothingError(f"Ruckig could not brake: {result.name}")
    ticks = math.ceil(trajectory.duration / TICK) + 1
    states = [trajectory.at_time(TICK * (i + 1)) for i in range(ticks)]
    return [np.array([state[k] for state in states]) for k in range(3)]


def _braked_hand(limits: Limits, planned: PlannedMotion) -> list[Array]:
    """Samples of a hand's planned motion, then of its brake from detach on.

    Each axis brakes by itself, at nearly its acceleration limit.
    """
    detach = float(planned.times[-1])
    ticks = math.floor(detach / TICK + 1e-9)
    moved = [values.T for values in planned.at(np.asarray(TICK * np.arange(ticks + 1)))]
    q, dq, _ = (values[:, 0] for values in planned.at(planned.times[-1:]))
    braking = -np.sign(dq) * SHARE * limits.ddq
    stop = np.abs(dq) / (SHARE * limits.ddq)
    count = math.ceil((detach + float(stop.max())) / TICK) - ticks + 1
    since = (TICK * (ticks + np.arange(1, count + 1)) - detach)[:, None]
    t = np.minimum(since, stop)
    braked = [
        q + dq * t + braking * t * t / 2,
        np.where(since < stop, dq + braking * t, 0.0),
        np.where(since < stop, braking, 0.0),
    ]
    return [np.vstack(pair) for pair in zip(moved, braked, strict=True)]


class SmoothingError(Exception):
    """The planned motion cannot be sent within the limits."""
