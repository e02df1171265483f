"""A body that two pads pinch, under a wrench in space: friction, tilting and lifting together.

In the pads' plane the limit surface holds, as in a throw. Across it pads only press: a torque that
tilts the body shifts the middle of the pressure of one pad one way, and of the other pad the other
way. Each stays inside its patch of radius r_p, so the torque is at most r_p times the force of the
pads. A force along their normal lets one pad press less, and a pad does not adhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .body import Array, Contact, ReadOnly

#: Halvings of the interval in which the use lies: to rounding.
HALVINGS = 60
#: A use below this is rounding.
NEGLIGIBLE = 1e-12


@dataclass(frozen=True, eq=False)
class PinchUse(ReadOnly):
    """Share (N,) of the pads' force that a wrench needs: above 1 the body slips, tilts or lifts.

    Its parts, each by itself: friction in the pads' plane, tilting out of it, the force across it.
    """

    use: Array
    friction: Array
    tilting: Array
    lifting: Array


def pinch_use(contact: Contact, force: Array, torque: Array, normal_force: float) -> PinchUse:
    """Use of a pinch at `normal_force` [N] of one pad, by wrenches on the body.

    force [N], torque [N m] about the middle of the pads: rows (3, N) along the hand, across it in
    the pads' plane, and along the pads' normal, which completes them right-handed.

    A tilt by the share d of r_p leaves each pad a disc of radius (1 - d) r_p about the middle of
    its pressure, with the torsional friction of that radius: a lower bound. The force across takes
    from the pads' force; the pad that it presses on counts no more than before. With only a wrench
    in the pads' plane the use is the root of `Contact.utilisation_squared`.
    """
    pads = contact.faces * normal_force

    def planar(forces: Array, torsion: Array) -> Array:
        return np.asarray(
            np.sqrt(contact.utilisation_squared(forces[0], forces[1], torsion, normal_force))
        )

    tilting = np.hypot(torque[0], torque[1]) / (contact.patch_radius * pads)
    lifting, friction = np.abs(force[2]) / pads, planar(force[:2], torque[2])
    # The use u solves u = planar(torque u / (u - tilting)); searched is u - tilting. The right side
    # falls with it, and the upper bound follows from convexity.
    low = np.zeros_like(friction)
    high = planar(force[:2], 0 * torque[2]) + planar(0 * force[:2], torque[2])
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        torsion = torque[2] * (1.0 + tilting / np.maximum(middle, NEGLIGIBLE))
        above = planar(force[:2], torsion) > middle + tilting
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    held = np.where(tilting > 0.0, high + tilting, friction)
    return PinchUse(held + lifting, friction, tilting, lifting)
