"""The limit surface of a patch of points with Coulomb friction each, as a gauge.

Friction in the direction of a wrench f is at its limit under the normal force

    f . v / (mu sum_i w_i |u_i(v)|),   v the contact twist that makes this largest,

u_i the slip of point i: by the principle of maximum dissipation. That v makes the work
sum_i w_i |u_i| least among all with f . v = 1.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .contact import Contact
from .patch import Patch, Pressure, scaled_patch
from .slip_onset import Gauge

Array = npt.NDArray[np.float64]

#: Most iterations, and the relative change of the gauge that ends them.
ITERATIONS = 500
TOLERANCE = 1e-12


def patch_gauge(contact: Contact, pressure: Pressure = "uniform", points: int = 64) -> Gauge:
    """Gauge of the contact's patch, which turns with the hand."""
    patch, arm = scaled_patch(contact, pressure, points)

    def gauge(wrench: Array, angle: Array) -> Array:
        cos, sin = np.cos(angle), np.sin(angle)
        force_x, force_z = cos * wrench[0] + sin * wrench[1], cos * wrench[1] - sin * wrench[0]
        scaled = np.array([force_x, force_z, wrench[2] / arm])
        return np.asarray(_gauge(patch, scaled) / contact.friction)

    return gauge


def _gauge(patch: Patch, wrench: Array) -> Array:
    """Gauge (K,) of wrenches (3, K) on a patch with mu = 1, torque as a force.

    Weighted least squares again and again (Weiszfeld): with the last |u_i| below the
    line, the least sum of w_i |u_i|^2 / |u_i| with f . v = 1 is a linear problem.
    """
    one, zero = np.ones_like(patch.x), np.zeros_like(patch.x)
    slips = np.array([[one, zero, -patch.z], [zero, one, patch.x]])  # (2, 3, P)
    size = np.maximum(np.linalg.norm(wrench, axis=0), 1e-300)
    f = (wrench / size).T
    share = np.broadcast_to(patch.weights, (len(f), len(one)))
    work = np.full(len(f), np.inf)
    for _ in range(ITERATIONS):
        matrix = np.einsum("jap,kp,jbp->kab", slips, share, slips)
        image = np.linalg.solve(matrix, f[:, :, None])[:, :, 0]
        twist = image / np.einsum("ka,ka->k", f, image)[:, None]
        speed = np.sqrt((np.einsum("jap,ka->jkp", slips, twist) ** 2).sum(axis=0))
        last, work = work, speed @ patch.weights
        if (np.abs(last - work) <= TOLERANCE * work).all():
            break
        share = patch.weights / np.maximum(speed, 1e-12)
    return np.asarray(size / work)
