"""Whether the full grip holds the object until each throw's own opening."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...models import Body, Contact, HandMotion, pivot_wrench
from ..check import TICK, Throw, friction_use

Array = npt.NDArray[np.float64]

#: Looked at are the instants that use this share of the most, this many of them at most.
SHARE, INSTANTS = 0.5, 120


@dataclass(frozen=True)
class CarryHold:
    """The hand where its motion asks most of the grip: times (T,) from the planned opening
    [s], hand (5, T): theta, omega, a_x, a_z, alpha. full [N]: the grip of one pad.
    """

    times: Array
    hand: Array
    full: float

    def held(
        self, body: Body, contact: Contact, gravity: float, angle: Array, delays: Array
    ) -> npt.NDArray[np.bool_]:
        """Which of N throws stick until they open, `delays` (N,) [s] after the planned time.

        angle (N,): of the object's axis against the hand's.
        """
        worst = np.zeros(delays.size)
        for time, column in zip(self.times, self.hand.T, strict=True):
            hand = HandMotion(*column)
            theta, h = hand.theta + angle, body.com_offset
            x_r, z_r = h * np.cos(theta), h * np.sin(theta)
            wrench = pivot_wrench(body, gravity, hand, hand.omega, x_r, z_r)
            use = contact.utilisation_squared(*wrench, self.full)
            worst = np.where(time <= delays, np.maximum(worst, use), worst)
        return np.asarray(worst <= 1.0)


def carry_hold(throw: Throw, latest: float) -> CarryHold:
    """The demanding instants of a throw from rest to `latest` [s] after its opening."""
    scene, opening_time = throw.scene, throw.opening_time
    times = np.arange(0.0, max(opening_time + latest, 0.0) + TICK / 2, TICK)
    hand = throw.mover.hand(throw.to_rest).at(times)
    force, torque = friction_use(scene, hand)
    use = np.hypot(force, torque)
    kept = np.flatnonzero(use >= SHARE * use.max())
    thinned = kept[:: -(-kept.size // INSTANTS)]
    chosen = np.union1d(thinned, np.argmax(use))
    motions = hand.motion
    rows = [motions.theta, motions.omega, motions.a_x, motions.a_z, motions.alpha]
    return CarryHold(
        times[chosen] - opening_time,
        np.array([row[chosen] for row in rows]),
        scene.gripper.profile().full,
    )
