"""The motion that is sent: samples every millisecond, from rest to rest.

The compiled core samples the planned motion and adds the brake: after detach each coordinate brakes
as fast as its limits allow. Where the planned motion breaks a limit on velocity, acceleration or
jerk, Ruckig follows its samples tick by tick within the limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...core import library, out, sampled
from ...models import Array, Flags, ReadOnly, Trajectory
from .manipulator import Limits, Manipulator

#: Sampling interval [s] of everything that is sent: 1 kHz.
TICK = 0.001
#: Ruckig's limits as a share of the real ones, so that rounded samples stay inside these.
SHARE = 0.999
#: Ruckig is on a sample if position, rate and acceleration differ by less than these [SI units].
ON_SAMPLE = np.array([[1e-9], [1e-8], [1e-6]])
#: Times [s] of a tick and of a piece's end are equal if they differ by less.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Samples(ReadOnly):
    """Coordinates every millisecond from t = 0: q, dq, ddq, each (N, n)."""

    q: Array
    dq: Array
    ddq: Array

    @classmethod
    def known(cls, rows: Array, times: Array, quintics: Array, kinks: Array) -> Samples:
        """Samples (3, N, n) with the motion between them as the core made it: see `Trajectory`."""
        found = cls(*rows)
        vars(found)["path"] = Trajectory(times, quintics, kinks, held=True)
        return found

    def __getitem__(self, which: Any) -> Samples:
        """Some of the samples, or of their coordinates, as of an array (N, n)."""
        return Samples(self.q[which], self.dq[which], self.ddq[which])

    @property
    def rows(self) -> Array:
        """Coordinates, rates and accelerations (3, N, n)."""
        return np.array([self.q, self.dq, self.ddq])

    @property
    def times(self) -> Array:
        """Sample times (N,) [s]."""
        return np.asarray(TICK * np.arange(len(self.q)))

    @cached_property
    def path(self) -> Trajectory:
        """The motion: quintics with position, rate and acceleration of the samples at both ends."""
        return Trajectory.quintics(TICK, self.q, self.dq, self.ddq)


#: No samples: nothing is sent.
NO_SAMPLES = Samples(*(np.empty((0, 0)) for _ in range(3)))


class SmoothingError(Exception):
    """The planned motion cannot be sent within the limits."""


def send(manipulator: Manipulator, planned: Trajectory) -> Samples:
    """Samples of the launch and release, then of the brake to rest.

    Raises SmoothingError where Ruckig finds no motion within the limits.
    """
    found = _sent_as_planned(manipulator, planned)
    if found is not None:
        return found
    return braked(manipulator.hard, _followed(manipulator, planned))


def _sent_as_planned(manipulator: Manipulator, planned: Trajectory) -> Samples | None:
    """Samples of a motion within the limits and of its brake; None for a motion beyond these."""
    limits, path = manipulator.hard, planned.core
    rows, n = math.ceil((planned.end + limits.longest_brake) / TICK) + 4, path.n
    found, curves, kinks = (np.empty(shape) for shape in ((3, rows, n), 6 * n * rows, 4 * rows))
    found[1:, 0] = manipulator.initial_motion
    samples = sampled(TICK, *found)
    arrays = out(curves, 6, n, rows - 1), out(kinks, 4 * rows)
    corners = library().send_motion(path, limits.core, samples, *arrays)
    if corners < 0:
        return None
    pieces = samples.rows - 1
    given = curves[: 6 * n * pieces].reshape(6, n, pieces, 1)
    sent = found[:, : samples.rows]
    return Samples.known(sent, TICK * np.arange(pieces + 1.0), given, kinks[:corners])


def braked(limits: Limits, samples: Samples, ease: float = 1.0) -> Samples:
    """Samples, and after the last of them the brake to rest within the limits.

    ease: share of the acceleration limit that the brake uses.
    """
    given, rows = len(samples.q), (samples.q, samples.dq, samples.ddq)
    core = replace(limits, ddq=ease * limits.ddq).core
    # The first call has no room for the brake and returns the number of samples with it.
    count = library().brake(core, given, sampled(TICK, *rows))
    found = np.empty((3, count, samples.q.shape[1]))
    found[:, :given] = rows
    library().brake(core, given, sampled(TICK, *found))
    return Samples(*found)


class Excess(NamedTuple):
    """A sample, or a difference of samples, beyond a limit: which of `KINDS`, of which joint,
    value and limit [rad and per s, s^2, s^3; m], and when [s]."""

    kind: str
    joint: str
    value: float
    limit: float
    time: float


#: Limited quantities; the second velocity is for limits that depend on the position.
KINDS = ("position", "velocity", "acceleration", "velocity", "jerk")


def excesses(manipulator: Manipulator, sent: Samples) -> list[Excess]:
    """The largest excess of samples and their differences over the real limits, of each kind."""
    return joint_excesses(manipulator.hard, manipulator.joints, sent)


def joint_excesses(limits: Limits, names: tuple[str, ...], sent: Samples) -> list[Excess]:
    """`excesses` of coordinates with these limits and names."""
    found = dict[tuple[str, int], Excess]()
    values = _excess(limits, sent)
    for row, joint in zip(*np.nonzero(values[..., 0] > 0.0), strict=True):
        kind, worst = KINDS[row], values[row, joint, 1:].tolist()
        found.setdefault((kind, joint), Excess(kind, names[joint], *worst))
    return list(found.values())


def _excess(limits: Limits, sent: Samples) -> Array:
    """Largest excess (5, n, 4) of samples and their differences over the limits, then its value,
    limit and time [s]; rows as in `KINDS`."""
    found = np.empty((len(KINDS), sent.q.shape[1], 4))
    rows = sampled(TICK, sent.q, sent.dq, sent.ddq)
    library().excess(rows, limits.core, out(found, 5, rows.n, 4))
    return found


def _followed(manipulator: Manipulator, planned: Trajectory) -> Samples:
    """Ruckig follows the planned samples: in each tick it heads for the next one.

    SmoothingError if it finds no motion within the limits.
    """
    import ruckig

    limits = manipulator.hard
    # Where the planned motion keeps the limits for a tick, Ruckig arrives at the tick's end too,
    # as its shortest duration is a tick.
    kept = np.empty(math.ceil(planned.end / TICK - ROUNDING), bool)
    library().kept_ticks(planned.core, limits.core, TICK, len(kept), out(kept, len(kept)))
    rows = planned.at(TICK * np.arange(len(kept) + 1))
    wanted = np.array([values.T for values in rows])
    sent = wanted.copy()
    sent[1:, 0] = manipulator.initial_motion
    kept[0] &= (sent[:, 0] == wanted[:, 0]).all()
    done = 0
    try:
        for tick in np.flatnonzero(~kept).tolist():
            if tick >= done:
                done = _chase(limits, wanted, sent, kept, tick)
    except ruckig.RuckigError as error:
        raise SmoothingError(f"Ruckig: {' '.join(str(error).split())}") from None
    return Samples(*sent)


def _chase(limits: Limits, wanted: Array, sent: Array, kept: Flags, first: int) -> int:
    """Ruckig from sample `first` on; returns the sample where it is back on the planned motion.

    wanted, sent (3, N, n): positions, rates and accelerations; `sent` is changed.
    """
    import ruckig

    n = len(limits.dq)
    most = SHARE * np.array([limits.dq, limits.ddq, limits.jerk])
    otg, trajectory, order = ruckig.Ruckig(n), ruckig.Trajectory(n), ruckig.InputParameter(n)
    order.max_velocity, order.max_acceleration, order.max_jerk = most.tolist()
    order.minimum_duration = TICK
    goals = wanted.copy()
    goals[1:] = np.clip(wanted[1:], -most[:2, None], most[:2, None])
    state, states = sent[:, first].tolist(), []
    for i in range(first + 1, goals.shape[1]):
        goal = goals[:, i]
        order.current_position, order.current_velocity, order.current_acceleration = state
        order.target_position, order.target_velocity, order.target_acceleration = goal.tolist()
        result = otg.calculate(order, trajectory)
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise SmoothingError(f"Ruckig could not follow at t = {i * TICK:.3f} s: {result.name}")
        state = trajectory.at_time(TICK)
        if i < len(kept) and kept[i] and (np.abs(state - goal) <= ON_SAMPLE).all():
            break
        states.append(state)
    back = first + 1 + len(states)
    sent[:, first + 1 : back] = np.array(states).reshape(-1, 3, n).swapaxes(0, 1)
    return back
