"""The throws that every release model is run on, and how far two detach states are apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...models import Body, Contact, LinearRelease, Path, Release, ReleaseCase, held_wrench, land
from .page import Cell, Table

Array = npt.NDArray[np.float64]

#: Height of the landing [m]; the hand is at 0 when its grip begins to fall.
HEIGHT = -0.9


@dataclass(frozen=True)
class Throw:
    """One of the report's releases. length [m] of the object, for the scaled error (39)."""

    key: str
    title: str
    case: ReleaseCase
    length: float


def four_throws() -> list[Throw]:
    """Drop, decelerating and accelerating throw, slow opening; the full grip holds all."""
    bar, long_bar = Body(0.24, 535e-6, 0.10), Body(0.24, 802e-6, 0.16)
    pads = Contact(1.0, 0.0025, 0.6, 2)

    def case(
        body: Body, contact: Contact, grip: tuple[float, float], *hand: Sequence[float]
    ) -> ReleaseCase:
        full, opening = grip
        return ReleaseCase(
            body, contact, LinearRelease(full, 0.0, opening), Path.accelerating(*hand)
        )

    still = (0.0, 0.0, 0.0)
    drop = case(
        Body(0.2, 5e-4, 0.10), Contact(0.8, 0.0075, 0.6, 2), (50.0, 0.05), still, still, still
    )
    start, twist = (0.0, 0.0, 0.6), (1.6, 1.2, 4.2)
    slower = case(bar, pads, (50.0, 0.05), start, twist, (-6.0, -8.0, -15.0))
    faster = case(bar, pads, (100.0, 0.05), start, twist, (4.0, 3.0, 8.0))
    slow = case(long_bar, pads, (100.0, 0.2), (0.0, 0.0, 1.0), (1.4, 1.6, 3.0), (-4.0, -6.0, -10.0))
    return [
        Throw("drop", "drop from a still hand", drop, 0.20),
        Throw("decelerating", "decelerating throw", slower, 0.26),
        Throw("accelerating", "accelerating throw", faster, 0.26),
        Throw("slow", "slow opening, 200 ms", slow, 0.26),
    ]


def detached(release: Release) -> Array:
    """x, z, theta, v_x, v_z, omega (6,) at the end of the opening."""
    return np.concatenate([release.com[:, -1], release.com_twist[:, -1]])


def differences(found: Array, truth: Array, gravity: float, length: float) -> Array:
    """Errors (4, N) of detach states (N, 6): landing x [m] and theta [rad], detach twist
    |dv| + |d omega| l / 2 [m/s], and the scaled landing error (39), |dx| + |d theta| l / 2 [m].
    """
    a, b = land(found, HEIGHT, gravity), land(truth, HEIGHT, gravity)
    x, theta = np.abs((a - b)[:, :2]).T
    off = found - truth
    twist = np.hypot(off[:, 3], off[:, 4]) + np.abs(off[:, 5]) * length / 2
    return np.array([x, theta, twist, x + theta * length / 2])


def off(throw: Throw, found: Array, truth: Array) -> Array:
    """Errors (4,) of one detach state (6,)."""
    errors = differences(found[None], truth[None], throw.case.gravity, throw.length)
    return np.asarray(errors[:, 0])


def throws_table(throws: Sequence[Throw]) -> Table:
    """The numbers of the throws."""
    rows: list[list[Cell]] = []
    for throw in throws:
        case = throw.case
        body, pads, hand = case.body, case.contact, case.hand.at(np.zeros(1))
        f_x, f_z, torque = held_wrench(case, np.zeros(1))[0][:, 0]
        use = math.sqrt(pads.utilisation_squared(f_x, f_z, torque, case.grip.full))
        pose, twist, a = (np.asarray(v)[:, 0] for v in (hand.pose, hand.twist, hand.acceleration))
        numbers = [1e3 * body.mass, 1e6 * body.inertia, 1e3 * body.com_offset, 1e3 * throw.length]
        numbers += [pads.friction, 1e3 * pads.patch_radius, pads.torsion, float(pads.faces)]
        numbers += [case.grip.full, 1e3 * case.grip.opening, math.degrees(pose[2])]
        rows.append([throw.title, *(float(v) for v in (*numbers, *twist, *a, use))])
    columns = ["throw", "m [g]", "I [kg mm²]", "h [mm]", "l [mm]", "μ", "r_p [mm]", "c", "faces"]
    columns += ["grip [N]", "opening [ms]", "hand θ [deg]", "v_x [m/s]", "v_z [m/s]", "ω [rad/s]"]
    columns += ["a_x [m/s²]", "a_z [m/s²]", "α [rad/s²]", "use of the full grip"]
    words = (
        "The four throws: grip falling linearly from the first instant, hand accelerating evenly"
    )
    return Table("models-throws", words, columns, rows)
