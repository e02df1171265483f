"""How an arm's joints follow what is sent to them: a lag per joint, fitted to a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models import Array
from ..check import TICK

#: Least and most of the lag's rate [1/s].
RATES = (2.0, 500.0)


@dataclass(frozen=True, eq=False)
class Response:
    """Joint by joint dq = rate (sent - q) + share d(sent)/dt: rate [1/s] and share, each (n,).

    A lag of (1 - share) / rate; a share below 0 is a delay beside it.
    """

    rate: Array
    share: Array

    @classmethod
    def fitted(cls, sent: Array, q: Array) -> Response:
        """Of least squares to joints (N, n) [rad] sent and measured at 1 kHz from rest on."""
        found = []
        for u, y in zip((sent - sent[0]).T, (q - q[0]).T, strict=True):
            behind = TICK * (u - y)[1:]
            law = np.column_stack([behind, np.diff(u)])
            rate, share = np.linalg.lstsq(law, np.diff(y), rcond=None)[0]
            if not RATES[0] <= rate <= RATES[1]:
                # It follows at once, or this joint hardly moved.
                rate, share = RATES[1], 1.0
            found.append((rate, share))
        return cls(*np.array(found).T)

    def of(self, joint: int, sent: Array) -> Array:
        """What joint number `joint` of these does of `sent` (N, ...), which begins at rest."""
        from scipy.signal import bilinear, lfilter

        rate, share = self.rate[joint], self.share[joint]
        law = bilinear([share, rate], [1.0, rate], 1 / TICK)
        return np.asarray(sent[0] + lfilter(*law, sent - sent[0], axis=0))

    def all(self, sent: Array) -> Array:
        """The same of all joints (N, n)."""
        return np.column_stack([self.of(j, column) for j, column in enumerate(sent.T)])
