"""Random throws that the full grip holds."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...models import (
    Body,
    Contact,
    HandMotion,
    LinearRelease,
    Path,
    ReleaseBatch,
    ReleaseCase,
    pivot_wrench,
)

Array = npt.NDArray[np.float64]

GRAVITY = 9.81
#: Share of the ellipsoid that the load may use at full grip: the patch's own limit
#: surface lies up to 6.6 % inside it.
HELD = 0.9
#: So many are drawn for each that is kept.
SPARE = 20
#: What is drawn, in words.
RANGES = (
    "h 2–20 cm, m 0.1–0.4 kg, hand 1–3 m/s, turning at 0–6 rad/s, accelerations to 8 m/s² along "
    "each axis and 20 rad/s², opening 30–100 ms, grip 20–235 N, μ 0.3–1, r_p 2.5–10 mm"
)


def random_throws(count: int, seed: int) -> ReleaseBatch:
    """`count` random throws (RANGES) that the full grip holds; the grip is a 2F-85's.

    Raises ValueError where too few of those drawn are held.
    """
    rng, many = np.random.default_rng(seed), SPARE * count

    def uniform(low: float, high: float) -> Array:
        return rng.uniform(low, high, many)

    mass = uniform(0.1, 0.4)
    body = Body(mass, mass * uniform(0.03, 0.08) ** 2, uniform(0.02, 0.2))
    contact = Contact(uniform(0.3, 1.0), uniform(0.0025, 0.01))
    speed, up, zero = uniform(1.0, 3.0), uniform(np.radians(10), np.radians(70)), np.zeros(many)
    pose = np.array([zero, zero, uniform(-np.pi / 3, np.pi / 2)])
    twist = np.array([speed * np.cos(up), speed * np.sin(up), uniform(0.0, 6.0)])
    acceleration = np.array([uniform(-8, 8), uniform(-8, 8), uniform(-20, 20)])
    full, opening = uniform(20, 235), uniform(0.03, 0.1)
    motion = HandMotion(pose[2], twist[2], *acceleration)
    x_r, z_r = body.com_offset * np.cos(pose[2]), body.com_offset * np.sin(pose[2])
    load = pivot_wrench(body, GRAVITY, motion, twist[2], x_r, z_r)
    held = np.flatnonzero(contact.utilisation_squared(*load, full) < HELD**2)[:count]
    if held.size < count:
        raise ValueError(f"only {held.size} of {many} random throws hold at full grip")
    hands = Path.accelerating(pose.T, twist.T, acceleration.T)
    grip = LinearRelease(1.0, 0.0, 1.0)
    return ReleaseBatch(many, body, contact, grip, hands, opening, full, GRAVITY).part(held)


def throw_number(batch: ReleaseBatch, i: int) -> ReleaseCase:
    """Throw number i of `random_throws` by itself."""
    body, contact = batch.body, batch.contact
    return ReleaseCase(
        Body(*(float(v[i]) for v in (body.mass, body.inertia, body.com_offset))),
        Contact(
            float(contact.friction[i]),
            float(contact.patch_radius[i]),
            contact.torsion,
            contact.faces,
        ),
        LinearRelease(float(batch.force[i]), 0.0, float(batch.opening[i])),
        batch.hands.part(np.array([i])),
        GRAVITY,
    )
