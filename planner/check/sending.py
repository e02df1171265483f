"""The motion that is sent: samples every millisecond, from rest to rest.

For an arm Ruckig follows the planned states tick by tick within the real limits on
velocity, acceleration and jerk. Where the planned motion keeps these limits itself Ruckig
would come out on its samples: there they are taken as they are, by the compiled core where
that is so all along. After detach each joint brakes as fast as the limits let it. A hand has
no jerk limit: its planned motion is sampled and it brakes at constant acceleration.
"""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...core import SamplesC, address, library
from ...models import Array, Flags, Path
from .mover import Limits, Mover

#: Sampling interval [s] of everything that is sent: 1 kHz.
TICK = 0.001
#: Ruckig's limits as a share of the real ones: differences of rounded samples stay inside.
SHARE = 0.999
#: Ruckig is on a sample when position, rate and acceleration are this near to it.
ON_SAMPLE = (1e-9, 1e-8, 1e-6)
#: Times [s] of a tick and of a piece's end that differ by less are the same.
SAME = 1e-9
#: Most jerk, acceleration and rate of a motion of one tick that closes a gap of one in
#: position, rate and acceleration, in ticks. By the quintic that is at rest at first.
CLOSING = np.array([[60.0, 96.0, 75.0], [5.8, 9.8, 9.0], [1.9, 3.9, 3.0]])


@dataclass(frozen=True, eq=False)
class Samples:
    """Coordinates every millisecond from t = 0: q, dq, ddq, each (N, n)."""

    q: Array
    dq: Array
    ddq: Array

    @property
    def times(self) -> Array:
        """Sample times (N,) [s]."""
        return np.asarray(TICK * np.arange(len(self.q)))

    @cached_property
    def path(self) -> Path:
        """The motion between them: the quintics that meet all three at both samples."""
        return Path.quintics(TICK, self.q, self.dq, self.ddq)


#: Kept back [rad/s] of velocity limits that depend on the position, as libfranka does (kLimitEps of
#: rate_limiting.h) and an FR3's controller asks.
KEPT_BACK = 1e-3
#: Nothing is sent.
NO_SAMPLES = Samples(*(np.empty((0, 0)) for _ in range(3)))


class SmoothingError(Exception):
    """The planned motion cannot be sent within the limits."""


def send(mover: Mover, planned: Path, *, as_planned: bool = False) -> Samples:
    """Samples of the launch and release, then of the brake to rest.

    as_planned: takes no motion that breaks the limits itself, so that Ruckig would have to follow
    it. Raises SmoothingError then, and where Ruckig finds no motion within the limits.
    """
    if mover.hard.jerk is None:
        return Samples(*_braked_hand(mover.hard, planned))
    found = _sent_by_core(mover, planned)
    if found is not None:
        return found
    import ruckig

    limits = _bounds(mover.hard)
    if as_planned and not _kept_ticks(limits, planned, planned.end).all():
        raise SmoothingError("the planned motion breaks the limits")
    try:
        moved = _follow(limits, planned, mover.begins)
    except ruckig.RuckigError as error:
        raise SmoothingError(f"Ruckig: {' '.join(str(error).split())}") from None
    return braked(mover, Samples(*moved))


def _sent_by_core(mover: Mover, planned: Path) -> Samples | None:
    """The same by the compiled core; None without it, and where Ruckig has to follow."""
    core, path, limits = library(), planned.core, mover.hard
    if core is None or path is None or limits.core is None:
        return None
    rows, n = math.ceil((planned.end + limits.longest_brake) / TICK) + 4, path.n
    found, curves, kinks = (np.empty(shape) for shape in ((3, rows, n), 6 * n * rows, 4 * rows))
    found[1:, 0] = mover.begins
    samples, by = SamplesC.of(TICK, *found), ctypes.byref
    outputs = map(ctypes.c_void_p, map(address, (curves, kinks)))
    corners = core.send_motion(by(path), by(limits.core), by(samples), *outputs)
    if corners < 0:
        return None
    sent, pieces = Samples(*found[:, : samples.rows]), samples.rows - 1
    given = curves[: 6 * n * pieces].reshape(6, n, pieces, 1)
    # The motion through them is known already.
    vars(sent)["path"] = Path(sent.times, given, kinks[:corners], held=True)
    return sent


def braked(mover: Mover, samples: Samples, ease: float = 1.0) -> Samples:
    """An arm's samples, and after the last of them its brake to rest.

    ease: share of the acceleration limit that it brakes with.
    """
    limits, until = _bounds(mover.hard), (samples.q, samples.dq, samples.ddq)
    limits = replace(limits, ddq=ease * limits.ddq)
    brake = _brake(limits, *(values[-1] for values in until))
    return Samples(*(np.vstack(pair) for pair in zip(until, brake, strict=True)))


def broken_limits(mover: Mover, sent: Samples) -> list[str]:
    """Real limits that any sample, or any difference of samples, breaks, in words."""
    limits, kinds = mover.hard, ("position", "velocity", "acceleration", "velocity", "jerk")
    broken = np.argwhere(_excess(limits, sent) > limits.rounding).tolist()
    return list(dict.fromkeys(f"{mover.joints[i]} {kinds[k]}" for k, i in broken))


def keeps(limits: Limits, sent: Samples) -> bool:
    """Whether samples and their differences keep the limits."""
    return not (_excess(limits, sent) > limits.rounding).any()


def _excess(limits: Limits, sent: Samples) -> Array:
    """How far (5, n) samples and their differences are beyond the limits at most.

    Rows: position, velocity, acceleration, velocity where it depends on the position, jerk.
    """
    core, found = library(), np.empty((5, sent.q.shape[1]))
    if core is not None and limits.core is not None:
        samples, output = SamplesC.of(TICK, sent.q, sent.dq, sent.ddq), address(found)
        core.excess(ctypes.byref(samples), ctypes.byref(limits.core), ctypes.c_void_p(output))
        return found
    found.fill(-np.inf)
    q = sent.q
    rate, acceleration, jerk = (np.diff(v, axis=0) / TICK for v in (q, sent.dq, sent.ddq))
    found[0] = np.maximum(limits.q_min - q, q - limits.q_max).max(axis=0)
    found[1] = np.abs(np.vstack([sent.dq, rate])).max(axis=0) - limits.dq
    found[2] = np.abs(np.vstack([sent.ddq, acceleration])).max(axis=0) - limits.ddq
    if limits.slowing is not None:
        # A difference counts at its later sample, as the controller counts it.
        places = np.vstack([q, q[1:]])
        (low, high), speeds = limits.velocity(places), np.vstack([sent.dq, rate])
        found[3] = np.maximum(speeds - high, low - speeds).max(axis=0) + KEPT_BACK
    if limits.jerk is not None:
        found[4] = np.abs(jerk).max(axis=0, initial=0.0) - limits.jerk
    return found


@dataclass(frozen=True)
class _Bounds:
    """What is sent keeps these, each (n,): velocity, acceleration and jerk."""

    dq: Array
    ddq: Array
    jerk: Array

    def order(self) -> Any:
        """A task for Ruckig within the limits on acceleration and jerk."""
        import ruckig

        order = ruckig.InputParameter(len(self.jerk))
        order.max_acceleration, order.max_jerk = self.ddq.tolist(), self.jerk.tolist()
        return order


def _bounds(limits: Limits) -> _Bounds:
    """What keeps an arm's limits."""
    assert limits.jerk is not None
    return _Bounds(*(SHARE * most for most in (limits.dq, limits.ddq, limits.jerk)))


def _follow(limits: _Bounds, planned: Path, begins: tuple[Array, Array]) -> list[Array]:
    """Ruckig chases the planned samples: each tick heads for the next, from where it got to.

    begins: rate and acceleration (n,) at first.
    """
    times = TICK * np.arange(math.ceil(planned.end / TICK - 1e-9) + 1)
    wanted = [values.T for values in planned.at(times)]
    kept = _kept_ticks(limits, planned, times[-1])
    sent = [values.copy() for values in wanted]
    sent[1][0], sent[2][0] = begins
    kept[0] &= all((sent[k][0] == wanted[k][0]).all() for k in (1, 2))
    done = 0
    for tick in np.flatnonzero(~kept).tolist():
        if tick >= done:
            done = _chase(limits, wanted, sent, kept, tick)
    return sent


def _chase(limits: _Bounds, wanted: list[Array], sent: list[Array], kept: Flags, first: int) -> int:
    """Ruckig from sample `first` on; the sample where it is back and the next tick is kept."""
    import ruckig

    n = len(limits.jerk)
    otg, trajectory, order = ruckig.Ruckig(n), ruckig.Trajectory(n), limits.order()
    order.max_velocity = limits.dq.tolist()
    order.minimum_duration = TICK
    q = wanted[0].tolist()
    dq = np.clip(wanted[1], -limits.dq, limits.dq).tolist()
    ddq = np.clip(wanted[2], -limits.ddq, limits.ddq).tolist()
    state = tuple(values[first].tolist() for values in sent)
    states = []
    for i in range(first + 1, len(q)):
        order.current_position, order.current_velocity, order.current_acceleration = state
        order.target_position, order.target_velocity = q[i], dq[i]
        order.target_acceleration = ddq[i]
        result = otg.calculate(order, trajectory)
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise SmoothingError(f"Ruckig could not follow at t = {i * TICK:.3f} s: {result.name}")
        state = trajectory.at_time(TICK)
        if i < len(kept) and kept[i] and _on_sample(state, (q[i], dq[i], ddq[i])):
            break
        states.append(state)
    followed = np.array(states).reshape(-1, 3, n)
    back = first + 1 + len(states)
    for k, values in enumerate(sent):
        values[first + 1 : back] = followed[:, k]
    return back


def _on_sample(state: tuple[list[float], ...], sample: tuple[list[float], ...]) -> bool:
    for one, other, near in zip(state, sample, ON_SAMPLE, strict=True):
        for a, b in zip(one, other, strict=True):
            if not abs(a - b) <= near:
                return False
    return True


def _kept_ticks(limits: _Bounds, planned: Path, until: float) -> Flags:
    """Whether the planned motion keeps the limits all along each tick up to `until` [s].

    Then a motion of just one tick leads from sample to sample within the limits, and
    Ruckig, told to take a tick at least, arrives there as well.
    """
    begins = planned.breaks[:-1]
    ends = np.append(begins[1:], until)
    dt = (ends - begins)[:, None]
    q, dq, ddq, jerk = (planned.starts(k) for k in range(4))
    end = (
        q + dt * (dq + dt * (ddq / 2 + dt * jerk / 6)),
        dq + dt * (ddq + dt * jerk / 2),
        ddq + dt * jerk,
    )
    # Where the acceleration passes zero inside a piece the rate has its extreme.
    turns = ddq * end[2] < 0
    extreme = np.where(turns, dq - ddq**2 / (2 * np.where(turns, jerk, 1.0)), dq)
    rate = np.abs([dq, end[1], extreme]).max(axis=0)
    used = np.array([np.abs(jerk), np.abs([ddq, end[2]]).max(axis=0), rate])
    most = np.array([limits.jerk, limits.ddq, limits.dq])[:, None]
    # Closing the gap that the solver leaves between two pieces takes some motion too.
    gaps = np.abs([b[1:] - a[:-1] for a, b in zip(end, (q, dq, ddq), strict=True)])
    in_ticks = gaps / TICK ** np.array([3, 2, 1])[:, None, None]
    closing = np.einsum("ij,jkn->ikn", CLOSING, in_ticks) * TICK ** np.arange(3)[:, None, None]
    closes = np.maximum(used[:, 1:], used[:, :-1]) + closing <= most

    kept = np.ones(round(until / TICK), dtype=bool)
    meet = begins[1:]
    for piece in np.flatnonzero((used > most).any(axis=(0, 2))):
        kept[_ticks(begins[piece], ends[piece])] = False
    crowded = np.diff(meet, prepend=-1.0, append=until + 1.0) < TICK
    for i in np.flatnonzero(~closes.all(axis=(0, 2)) | crowded[1:] | crowded[:-1]):
        kept[_ticks(meet[i], meet[i])] = False
    return kept


def _ticks(begin: float, end: float) -> slice:
    """The ticks that [begin, end] [s] touches."""
    return slice(max(math.floor((begin - SAME) / TICK), 0), math.ceil((end + SAME) / TICK))


def _brake(limits: _Bounds, q: Array, dq: Array, ddq: Array) -> Array:
    """Samples (3, N, n) after the given state until rest, time-optimal per joint.

    The jerk pulls the acceleration to a peak, which may last at the limit, and back to none.
    """
    jerk = limits.jerk
    side = np.where(dq + ddq * np.abs(ddq) / (2 * jerk) < 0, -1.0, 1.0)
    v, a = side * dq, side * ddq
    peak = np.minimum(np.sqrt(np.maximum(jerk * v + a * a / 2, 0.0)), limits.ddq)
    peak = np.maximum(peak, -a)
    rest = v + a * a / (2 * jerk) - peak * peak / jerk
    level = np.divide(rest, peak, out=0 * peak, where=peak > 0).clip(0.0)
    lengths = [(a + peak) / jerk, level, peak / jerk]
    ticks = math.ceil(float(np.sum(lengths, axis=0).max()) / TICK) + 1
    left = np.repeat(TICK * np.arange(1.0, ticks + 1)[:, None], len(q), axis=1)
    q, dq, ddq = (np.repeat(values[None], ticks, axis=0) for values in (q, dq, ddq))
    for k, length in enumerate(lengths):
        u, j = np.minimum(left, length), side * jerk * (k - 1)
        q = q + u * (dq + u * (ddq / 2 + u * j / 6))
        dq = dq + u * (ddq + u * j / 2)
        ddq = ddq + u * j
        left = left - u
    return np.array([q, np.where(left > 0, 0.0, dq), np.where(left > 0, 0.0, ddq)])


def _braked_hand(limits: Limits, planned: Path) -> list[Array]:
    """Samples of a hand's planned motion, then of its brake from detach on.

    Each axis brakes by itself, at nearly its acceleration limit.
    """
    detach = planned.end
    ticks = math.floor(detach / TICK + 1e-9)
    moved = [values.T for values in planned.at(np.asarray(TICK * np.arange(ticks + 1)))]
    q, dq, _ = (values[:, 0] for values in planned.at(np.array([detach])))
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
