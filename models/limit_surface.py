"""Limit surfaces of a patch contact: which wrenches friction can give, and which it gives.

A surface is described by its gauge: the normal force [N] (all faces together) at which
a wrench (f_x, f_z, torque) is just at the limit, sqrt(H(f)) for the ellipsoid of (19).
The gauge is homogeneous of degree one. Sliding with contact twist v, friction is the
wrench on the surface whose normal is along -v: Gamma(v) per newton of normal force.

As long as a body sticks, the wrench that it needs is known along the hand's motion, (28)
and (31). Slip begins where that wrench first reaches the surface of the falling grip
force. From there the contact moves along the surface's normal, so turning and sliding
begin at one instant; a motion that the normal does not have, such as turning where no
torque is carried, has not begun.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .body import Array, Contact, pivot_wrench
from .release import ReleaseCase

#: Normal force [N], all faces, at which wrenches (3, K) slip on a hand at angles (K,).
Gauge = Callable[[Array, Array], Array]

#: Even intervals of the opening that are searched for the first slip.
INTERVALS = 200
#: Share of the surface's normal below which a motion does not begin.
SMALL = 1e-6
#: Share of the full grip that is nothing: a wrench of rounding errors does not slip.
NOTHING = 1e-11


def ellipsoid_gauge(contact: Contact) -> Gauge:
    """The gauge of the ellipsoid (19), which does not turn with the hand."""
    return lambda wrench, _: np.asarray(
        contact.faces * np.sqrt(contact.utilisation_squared(wrench[0], wrench[1], wrench[2], 1.0))
    )


def sliding_wrench(contact: Contact, twist: Array) -> Array:
    """Gamma(v) = -A^-1 v / sqrt(v^T A^-1 v) of the ellipsoid (19).

    Friction (3,) per newton of normal force for a contact twist (3,) that is not 0.
    """
    image = contact.friction**2 * np.array([1.0, 1.0, contact.torsion_arm**2]) * twist
    return np.asarray(-image / math.sqrt(float(twist @ image)))


# When slip begins.


def slip_onset(
    case: ReleaseCase, gauge: Gauge, intervals: int = INTERVALS
) -> tuple[float | None, float | None]:
    """Times [s] at which pivot and slide begin, None for what does not.

    To 1e-12 of the opening; 0 for a body that the full grip does not hold.
    """
    from scipy.optimize import brentq

    opening = case.grip.opening

    def excess(times: Array) -> Array:
        """Normal force [N] that the body lacks."""
        wrench, angle = held_wrench(case, times)
        force = case.grip.force(times) + NOTHING * case.grip.full
        return np.asarray(gauge(wrench, angle) - case.contact.faces * force)

    times = np.linspace(0.0, opening, intervals + 1)
    above = np.flatnonzero(excess(times) > 0)
    if above.size == 0:
        return None, None
    i = int(above[0])
    onset = float(times[i])
    if i > 0:
        onset = float(
            brentq(lambda t: float(excess(np.array([t]))[0]), times[i - 1], onset, xtol=1e-12)
        )
    pivots, slides = _moves(case, gauge, onset)
    return onset if pivots else None, onset if slides else None


def held_wrench(case: ReleaseCase, times: Array) -> tuple[Array, Array]:
    """Contact wrench (3, K) that a sticking body needs, world axes, and the hand's angle (K,)."""
    hand = case.hand.at(times)
    theta, h = hand.pose[2] + case.grasp_angle, case.body.com_offset
    lever = h * np.cos(theta), h * np.sin(theta)
    wrench = pivot_wrench(case.body, case.gravity, hand.motion, hand.twist[2], *lever)
    return np.array(np.broadcast_arrays(*wrench)), hand.pose[2]


def _moves(case: ReleaseCase, gauge: Gauge, time: float) -> tuple[bool, bool]:
    """Whether the surface's normal at the held wrench turns, and whether it slides."""
    wrench, angle = held_wrench(case, np.array([time]))
    # In newtons: a torque counts by the patch's torsion arm.
    scale = np.array([1.0, 1.0, case.contact.torsion_arm])
    step = 1e-4 * np.linalg.norm(wrench[:, 0] / scale)
    sides = np.concatenate([step * np.diag(scale), -step * np.diag(scale)], axis=1)
    values = gauge(wrench + sides, np.repeat(angle, 6))
    normal = np.abs(values[:3] - values[3:])
    total = float(normal.max())
    return bool(normal[2] > SMALL * total), bool(normal[:2].max() > SMALL * total)
