"""The response of an arm's joints to what is sent: a lag per joint, fitted to measured joints."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...models import Array, ReadOnly
from ...planner import TICK
from ...problems import InputError

#: Smallest and largest rate [1/s] of a joint's lag.
RATES = (2.0, 500.0)


@dataclass(frozen=True, eq=False)
class Response(ReadOnly):
    """Joint by joint dq = rate (sent - q) + share d(sent)/dt: rate [1/s] and share, each (n,).

    A lag of (1 - share) / rate; a share below 0 is a delay beside it.
    """

    rate: Array
    share: Array

    def __post_init__(self) -> None:
        """InputError for other than finite numbers, as many of both."""
        super().__post_init__()
        for values in (self.rate, self.share):
            if np.ndim(values) != 1 or np.shape(values) != np.shape(self.rate):
                raise InputError("rate, share: must be one number per joint each")
            if np.asarray(values).dtype.kind not in "fiu" or not np.isfinite(values).all():
                raise InputError("rate, share: must be finite numbers")
        if not np.all(self.rate > 0.0):
            raise InputError("rate: must be above 0")

    @classmethod
    def fitted(cls, sent: Array, q: Array) -> Response:
        """Least-squares fit to joints (N, n) [rad] sent and measured at 1 kHz from rest on.

        InputError if they are not finite numbers of equal shape.
        """
        sent, q = np.asarray(sent, float), np.asarray(q, float)
        right = sent.shape == q.shape and sent.ndim == 2 and len(sent) > 1 and sent.shape[1] > 0
        if not right or not np.isfinite([sent, q]).all():
            raise InputError("sent, q: must be finite numbers, a row per ms and a column per joint")
        found = []
        for u, y in zip((sent - sent[0]).T, (q - q[0]).T, strict=True):
            # The law from sample to sample, as of `_lagging`.
            behind = TICK * ((u - y)[1:] + (u - y)[:-1]) / 2
            law = np.column_stack([behind, np.diff(u)])
            rate, share = np.linalg.lstsq(law, np.diff(y), rcond=None)[0]
            if rate > RATES[1]:
                # The same lag, at the largest rate.
                rate, share = RATES[1], 1.0 - (1.0 - share) * RATES[1] / rate
            elif not rate >= RATES[0]:
                # The joint hardly moved: it is taken to follow at once.
                rate, share = RATES[1], 1.0
            found.append((rate, share))
        return cls(*np.array(found).T)

    def of(self, joint: int, sent: Array) -> Array:
        """The response of joint `joint`, from 0 on, to `sent` (N, ...), which begins at rest."""
        sent = np.asarray(sent, float)
        if not 0 <= joint < len(self.rate) or not len(sent):
            raise InputError(f"joint, sent: must be below {len(self.rate)}, with at least one row")
        return _lagging(self.rate[joint], self.share[joint], sent)

    def all(self, sent: Array) -> Array:
        """The response of all joints to `sent` (..., N, n); of rates and accelerations alike."""
        sent = np.asarray(sent, float)
        if sent.ndim < 2 or not sent.shape[-2] or sent.shape[-1] != len(self.rate):
            raise InputError(f"sent: must have rows of {len(self.rate)} joints")
        return np.moveaxis(_lagging(self.rate, self.share, np.moveaxis(sent, -2, 0)), 0, -2)


def _lagging(rate: Array, share: Array, sent: Array) -> Array:
    """The law from sample to sample (N, ...), by the bilinear transform.

    rate and share go with the last axes.
    """
    from scipy.signal import lfilter

    twice, moved = 2.0 / TICK, sent - sent[0]
    now, before, decay = (share * twice + rate, rate - share * twice, twice - rate) / (twice + rate)
    found = np.empty_like(moved)
    for joint in np.ndindex(np.shape(rate)):
        law = [now[joint], before[joint]], [1.0, -decay[joint]]
        found[..., *joint] = lfilter(*law, moved[..., *joint], axis=0)
    return np.asarray(sent[0] + found)


@dataclass(frozen=True)
class FollowerSettings:
    """Settings of the fit. Its law has, per joint, the lag's logarithm, share and offset [rad].

    mean: prior of an unknown joint. deviations, known_deviations: standard deviations of the
    prior of an unknown joint, and of one with a known response. noise [rad]: standard deviation of
    a measured joint. step: of logarithm and share for derivatives. bounds: least and largest
    logarithm and share.
    """

    mean: tuple[float, float, float] = (math.log(0.02), 1.0, 0.0)
    deviations: tuple[float, float, float] = (1.0, 0.5, 3e-3)
    known_deviations: tuple[float, float, float] = (0.1, 0.1, 3e-3)
    noise: float = 1e-3
    step: float = 1e-4
    bounds: tuple[tuple[float, float], tuple[float, float]] = (
        (-math.log(RATES[1]), -4.0),
        (-math.log(RATES[0]), 1.5),
    )


SETTINGS = FollowerSettings()


class Follower:
    """The response of joints, learnt while they move from a prior law.

    Each measurement of the joints adds a Gauss-Newton step over all measurements: the law is fitted
    to the joints, not to their differences, in which noise prevails.
    """

    def __init__(self, joints: int, known: Response | None) -> None:
        self._mean = np.tile(SETTINGS.mean, (joints, 1))
        self._weight = np.tile(np.array(SETTINGS.deviations) ** -2, (joints, 1))
        if known is not None:
            self._mean[:, 0], self._mean[:, 1] = -np.log(known.rate), known.share
            self._weight[:] = np.array(SETTINGS.known_deviations) ** -2
        self._law = self._mean.copy()
        self._times: list[float] = []
        self._joints: list[Array] = []

    @property
    def response(self) -> Response:
        """The law learnt until now."""
        return Response(np.exp(-self._law[:, 0]), self._law[:, 1])

    def expected(self, sent: Array) -> Array:
        """Joints, rates and accelerations (3, N, n) in response to those that are sent."""
        found = self.response.all(sent)
        found[0] += self._law[:, 2]
        return found

    def learn(self, time: float, q: Array, sent: Array) -> None:
        """Learns from joints (n,) measured at `time` [s]; sent (N, n): from time 0 on."""
        self._times.append(time)
        self._joints.append(q)
        count, law, step = min(int(time / TICK) + 2, len(sent)), self._law, SETTINGS.step
        # Joints (N, 3, n) by the law and by two laws a step beside it, then at the measured times.
        near = law[:, :2].T[:, None] + step * np.array([[0, 1, 0], [0, 0, 1]])[:, :, None]
        sent = np.broadcast_to(sent[:count, None], (count, 3, len(law)))
        moved = _lagging(np.exp(-near[0]), near[1], sent)
        times = np.array(self._times) / TICK
        tick = np.minimum(times.astype(int), count - 1)
        after, share = np.minimum(tick + 1, count - 1), (times - tick)[:, None, None]
        here, *beside = np.moveaxis(moved[tick] * (1 - share) + moved[after] * share, 1, 0)
        slope = np.array([*((one - here) / step for one in beside), np.ones_like(here)])
        left = np.array(self._joints) - here - law[:, 2]
        square = np.einsum("aij,bij->jab", slope, slope) / SETTINGS.noise**2
        square[:, range(3), range(3)] += self._weight
        off = np.einsum("aij,ij->ja", slope, left) / SETTINGS.noise**2
        off -= self._weight * (law - self._mean)
        law = law + np.linalg.solve(square, off[..., None])[..., 0]
        law[:, :2] = np.clip(law[:, :2], *SETTINGS.bounds)
        self._law = law
