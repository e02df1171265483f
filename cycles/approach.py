"""The way between a pick and its surroundings: straight along the approach of the hand."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import polynomial

from ..models import Array
from ..planner import (
    Limits,
    Samples,
    SpatialScene,
    State,
    first_finding,
    joint_limits,
    make_manipulator,
    transfer,
)
from .cycle import UnsolvedError
from .inverse_kinematics import joint_rates
from .job_files import Jobs, Pick

#: Length [m] of the way.
LENGTH = 0.05
#: Number of steps that integrate the joints along it, and degree of the polynomial through them.
STEPS, DEGREE = 20, 6
#: Speeds [m/s] of the hand at the far end.
SPEEDS = (0.45, 0.25, 0.0)
#: Shares of the joints' limits on acceleration and on jerk, of which the first is taken that the
#: verdict allows.
SHARES = (
    *((0.85, share) for share in (0.85, 0.5, 0.3, 0.2, 0.12)),
    *((share, share) for share in (0.5, 0.3, 0.2, 0.1, 0.05, 0.02)),
)


@dataclass(frozen=True, eq=False)
class Approach:
    """The straight way between a pick with `joints` (joints,) [rad] and a place `LENGTH` behind it,
    with the hand turned as it is."""

    space: SpatialScene
    joints: Array

    @cached_property
    def _curve(self) -> Array:
        """Coefficients (DEGREE + 1, joints) of the joints over the way [m] from the pick."""
        q, step, rows = self.joints, LENGTH / STEPS, [self.joints]
        back = -self.space.spatial.pads(*np.array([[q], [0 * q], [0 * q]])).pose[0, :3, 2]
        for _ in range(STEPS):
            middle = q + step / 2 * joint_rates(self.space, q, back)
            q = q + step * joint_rates(self.space, middle, back)
            rows.append(q)
        ways = np.linspace(0.0, LENGTH, STEPS + 1)
        return np.asarray(polynomial.polyfit(ways, np.array(rows), DEGREE))

    @cached_property
    def _limits(self) -> Limits:
        """Limits of the way [m] by those of the joints, but for the way's curvature."""
        arm = self.space.kinematics.arm
        limits = joint_limits(arm, range(1, arm.joints + 1))
        slopes = np.abs(self._at(1, np.linspace(0.0, LENGTH, STEPS))).max(axis=0)
        most = (
            np.array([np.min(limit / np.maximum(slopes, 1e-9))])
            for limit in (limits.dq, limits.ddq, limits.jerk)
        )
        return Limits(np.zeros(1), np.full(1, LENGTH), *most)

    def _at(self, order: int, ways: Array) -> Array:
        """Derivatives (N, joints) of the joints at ways (N,) [m] from the pick."""
        return np.asarray(polynomial.polyval(ways, polynomial.polyder(self._curve, order)).T)

    def leaving(self, speed: float, shares: tuple[float, float]) -> Samples | None:
        """The motion (N, joints) from rest at the pick to the far end, where the hand has a speed
        [m/s] and does not accelerate; None where that is too fast.

        shares: of the joints' limits on acceleration and jerk.
        """
        most = self._limits
        ddq, jerk = shares[0] * most.ddq, shares[1] * most.jerk
        start, end = (State(*np.array([[x], [v], [0.0]])) for x, v in ((0.0, 0.0), (LENGTH, speed)))
        found = transfer(Limits(most.q_min, most.q_max, most.dq, ddq, jerk), start, end)
        if found is None:
            return None
        (way,), (rate,), (change,) = (rows.T for rows in found.samples.rows)
        if way.min() < -1e-9 or way.max() > LENGTH + 1e-9:
            return None
        q, slope, bend = (self._at(order, way) for order in range(3))
        q[0] = self.joints
        rate, change = rate[:, None], change[:, None]
        return Samples(q, slope * rate, bend * rate**2 + slope * change)

    @cached_property
    def leads(self) -> list[tuple[float, tuple[float, float], Samples]]:
        """Of `SPEEDS` those that the verdict allows with the object in the hand, each with its
        shares and the motion away from the pick. Raises UnsolvedError without one."""
        found, trouble = list[tuple[float, tuple[float, float], Samples]](), ""
        for speed, share in itertools.product(SPEEDS, SHARES):
            way = None if found and found[-1][0] == speed else self.leaving(speed, share)
            broken = None if way is None else first_finding(self.space, way, held=True)
            if broken is not None:
                trouble = broken.words
            elif way is not None:
                found.append((speed, share, way))
        if not found:
            raise UnsolvedError(f"straight from the pick: {trouble or 'out of reach'}")
        return found

    @property
    def away(self) -> list[Samples]:
        """The motions away from the pick, the fastest first."""
        return [way for *_, way in self.leads]

    @cached_property
    def towards(self) -> list[Samples]:
        """The motions backwards, to rest at the pick."""
        return [Samples(way.q[::-1], -way.dq[::-1], way.ddq[::-1]) for way in self.away]


def approach_of(jobs: Jobs, pick: Pick) -> Approach:
    """The way of a pick with joints."""
    scene = jobs.scene_of(pick, jobs.bins_of(pick)[0])
    return Approach(SpatialScene(scene, make_manipulator(scene)), np.array(pick.joints))
