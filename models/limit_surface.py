"""Limit surfaces of a patch contact: which wrenches friction can give, and which it gives.

Sliding with contact twist v, friction is the wrench on the ellipsoid (19) whose normal is along
-v: Gamma(v) per newton of normal force.

As long as a body sticks, the wrench that it needs is known along the hand's motion, (28)
and (31). Slip begins where that wrench first reaches the surface of the falling grip
force. From there the contact moves along the surface's normal, so turning and sliding
begin at one instant; a motion that the normal does not have, such as turning where no
torque is carried, has not begun.
"""

from __future__ import annotations

import math

import numpy as np

from .body import Array, Contact, pivot_wrench
from .release import ReleaseCase

#: Even intervals of the opening that are searched for the first slip.
INTERVALS = 200
#: Share of the surface's normal below which a motion does not begin.
SMALL = 1e-6
#: Share of the full grip that is nothing: a wrench of rounding errors does not slip.
NOTHING = 1e-11


def sliding_wrench(contact: Contact, twist: Array) -> Array:
    """Gamma(v) = -A^-1 v / sqrt(v^T A^-1 v) of the ellipsoid (19).

    Friction (3,) per newton of normal force for a contact twist (3,) that is not 0.
    """
    image = contact.friction**2 * np.array([1.0, 1.0, contact.torsion_arm**2]) * twist
    return np.asarray(-image / math.sqrt(float(twist @ image)))


# When slip begins.


def slip_onset(case: ReleaseCase) -> tuple[float | None, float | None]:
    """Times [s] at which pivot and slide begin on the ellipsoid, None for what does not.

    To 1e-12 of the opening; 0 for a body that the full grip does not hold.
    """
    from scipy.optimize import brentq

    def excess(times: Array) -> Array:
        """How far the needed wrench is beyond the surface, over it."""
        f_x, f_z, torque = held_wrench(case, times)
        force = case.grip.force(times) + NOTHING * case.grip.full
        return np.asarray(case.contact.utilisation_squared(f_x, f_z, torque, force) - 1.0)

    times = np.linspace(0.0, case.grip.opening, INTERVALS + 1)
    above = np.flatnonzero(excess(times) > 0)
    if above.size == 0:
        return None, None
    i = int(above[0])
    onset = float(times[i])
    if i > 0:
        ends = times[i - 1], onset
        onset = float(brentq(lambda t: float(excess(np.array([t]))[0]), *ends, xtol=1e-12))
    return onsets(onset, held_wrench(case, np.array([onset]))[:, 0], case.contact.torsion_arm)


def onsets(time: float, load: Array, arm: float) -> tuple[float | None, float | None]:
    """Pivot and slide [s] that begin at `time`: along a wrench (3,) in newtons, torque over arm."""
    sizes = np.abs(load / [1.0, 1.0, arm])
    least = SMALL * sizes.max()
    return time if sizes[2] > least else None, time if sizes[:2].max() > least else None


def held_wrench(case: ReleaseCase, times: Array) -> Array:
    """Contact wrench (3, K) that a sticking body needs, world axes."""
    hand = case.hand.at(times)
    theta, h = hand.pose[2] + case.grasp_angle, case.body.com_offset
    lever = h * np.cos(theta), h * np.sin(theta)
    wrench = pivot_wrench(case.body, case.gravity, hand.motion, hand.twist[2], *lever)
    return np.array(np.broadcast_arrays(*wrench))
