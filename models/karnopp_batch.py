"""Many releases by the non-smoothed limit surface with explicit Euler steps (`ls`).

The equations of `limit_surface_release.KarnoppRelease` with the axis-aligned ellipsoid,
for arrays: for identifying contact parameters, which throws every throw hundreds of times.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .batch import BatchRelease, ReleaseBatch, by_chunks
from .contact import HandMotion, contact_twist, pivot_wrench
from .limit_surface import Norm
from .release import sticking_state

Array = npt.NDArray[np.float64]

#: Steps per second of opening: the paper's 0.1 ms.
RATE = 10_000.0
#: Most steps for an opening that lasts long.
MOST_STEPS = 20_000


def throw_karnopp(
    batch: ReleaseBatch,
    steps: int | None = None,
    *,
    dead_zone: float = 1e-8,
    norm: Norm = "paper",
) -> BatchRelease:
    """N releases by Karnopp's routine, (20)-(25).

    steps over each throw's opening (0.1 ms each where not given); dead_zone delta [m/s];
    norm of |v| in it, as in `limit_surface.slip_size`.
    """
    if steps is None:
        longest = float(np.max(batch.opening))
        steps = int(np.clip(np.ceil(longest * RATE - 1e-9), 1, MOST_STEPS))
    return by_chunks(batch, lambda part: _chunk(part, steps, dead_zone, norm))


def karnopp_batch(batch: ReleaseBatch) -> Array:
    """Detach states (N, 6) by the non-smoothed limit surface in steps of 0.1 ms."""
    return throw_karnopp(batch).detach


def _chunk(part: ReleaseBatch, steps: int, dead_zone: float, norm: Norm) -> BatchRelease:
    body, contact, gravity = part.body, part.contact, part.gravity
    shares = np.linspace(0.0, 1.0, steps + 1)
    shape = part.grip.force(shares * part.grip.opening) / part.grip.full
    arm = contact.torsion_arm
    zone = 1.0 if norm == "paper" else arm
    dt = part.opening / steps
    pose, twist, acceleration = part.hands.at(np.zeros_like(part.opening))
    x, z, theta, v_x, v_z, omega = sticking_state(
        pose, twist, part.grasp_angle, part.body.com_offset
    )
    x, z, theta, v_x, v_z, omega = (np.array(v, float) for v in (x, z, theta, v_x, v_z, omega))
    for k in range(steps):
        x_r, z_r = x - pose[0], z - pose[1]
        slip_x, slip_z, slip = contact_twist(v_x, v_z, omega, x_r, z_r)
        slip_x, slip_z, slip = slip_x - twist[0], slip_z - twist[1], slip - twist[2]
        limit = contact.force_limit(part.force * shape[k])
        # Sliding: on the ellipsoid, its normal along -v.
        turning = arm * slip
        size = np.sqrt(slip_x**2 + slip_z**2 + turning**2)
        scale = limit / np.maximum(size, 1e-300)
        # Sticking: the wrench that keeps the body with the hand, cut off at the surface.
        motion = HandMotion(pose[2], twist[2], *acceleration)
        h_x, h_z, h_t = pivot_wrench(body, gravity, motion, omega, x_r, z_r)
        needed = np.sqrt(h_x**2 + h_z**2 + (h_t / arm) ** 2)
        share = np.minimum(limit / np.maximum(needed, 1e-300), 1.0)
        slides = np.sqrt(slip_x**2 + slip_z**2 + (zone * slip) ** 2) > dead_zone
        f_x = np.where(slides, -scale * slip_x, share * h_x)
        f_z = np.where(slides, -scale * slip_z, share * h_z)
        torque = np.where(slides, -scale * arm * turning, share * h_t)
        turned = torque + f_x * z_r - f_z * x_r
        x, z, theta = x + dt * v_x, z + dt * v_z, theta + dt * omega
        v_x, v_z = v_x + dt * f_x / body.mass, v_z + dt * (f_z / body.mass - gravity)
        omega = omega + dt * turned / body.inertia
        pose, twist, acceleration = part.hands.at(shares[k + 1] * part.opening)
    detach = np.array([x, z, theta, v_x, v_z, omega]).T
    detach[~np.isfinite(detach).all(axis=1)] = np.nan
    return BatchRelease(detach, np.zeros(part.count, bool))
