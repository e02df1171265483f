"""The fastest motion between two states that breaks no limit: Ruckig's, slowed by the verdict."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from ..clearance import SpatialScene
from ..throw import Limits, Samples, State, joint_limits, transfer
from ..verdict import Code, Finding, first_finding, grip_use
from .cycle import UnsolvedError

#: Most motions that are judged to find one slow enough, and to quicken it again.
SLOWINGS, QUICKENINGS = 30, 3
#: Share of a limit that a slowed motion is to use, and bounds of a slowing's factor.
AIM, FACTORS = 0.99, (0.5, 0.97)


@dataclass(frozen=True)
class Shares:
    """Shares of the limits: on velocity; on acceleration and jerk of the joints that throw, and of
    the others, which tilt the object out of the pads' plane; on jerk alone besides."""

    velocity: float = 1.0
    throwing: float = 1.0
    aside: float = 1.0
    jerk: float = 1.0

    def limits(self, space: SpatialScene) -> Limits:
        """The limits of all joints, reduced."""
        arm = space.kinematics.arm
        limits, scale = joint_limits(arm, range(1, arm.joints + 1)), np.full(arm.joints, self.aside)
        scale[np.array(space.kinematics.throwing_joints) - 1] = self.throwing
        assert limits.jerk is not None
        ends = limits.q_min, limits.q_max
        jerk = self.jerk * scale * limits.jerk
        return Limits(*ends, self.velocity * limits.dq, scale * limits.ddq, jerk)

    def smaller(self, finding: Finding, tilts: bool) -> Shares | None:
        """Smaller shares against a broken limit; None if slowing does not help.

        tilts: the object is tilted or pulled out of the pads, more than it slips.
        """
        low, high = FACTORS
        factor = min(max(AIM * finding.limit / max(abs(finding.value), 1e-9), low), high)
        match finding.code:
            case Code.TOOL_SPEED | Code.JOINT_VELOCITY:
                return dataclasses.replace(self, velocity=factor * self.velocity)
            case Code.CARRY if tilts:
                return dataclasses.replace(self, aside=factor * self.aside)
            case Code.TORQUE_RATE:
                return dataclasses.replace(self, jerk=factor * self.jerk)
            case Code.CARRY | Code.TORQUE:
                throwing, aside = factor * self.throwing, factor * self.aside
                return dataclasses.replace(self, throwing=throwing, aside=aside)
        return None


def slowed_transfer(space: SpatialScene, start: State, goal: State, *, held: bool) -> Samples:
    """The fastest motion of all joints between two states of motion that breaks no limit.

    Ruckig's, with its limits reduced until grip (if `held`), torques and tool speed are kept, then
    raised again as far as that is allowed. Samples (N, joints), both states included. Raises
    UnsolvedError with the broken limit that no slower motion avoids.
    """
    shares, trouble = Shares(), ""
    for _ in range(SLOWINGS):
        found = transfer(shares.limits(space), start, goal)
        if found is None:
            break
        broken = first_finding(space, found.samples, held=held)
        if broken is None:
            return _quickened(space, start, goal, held, shares, found.samples)
        trouble, tilts = broken.words, False
        if broken.code is Code.CARRY:
            grip = grip_use(space, found.samples)
            worst = int(grip.use.argmax())
            rest = Samples(found.samples.q, *np.zeros((2, *found.samples.q.shape)))
            if grip_use(space, rest).use.max() > 1.0:
                break
            tilts = bool(grip.tilting[worst] + grip.lifting[worst] > grip.friction[worst])
        smaller = shares.smaller(broken, tilts)
        if smaller is None:
            break
        shares = smaller
    raise UnsolvedError(trouble or "a state is beyond the limits of the joints")


def _quickened(
    space: SpatialScene, start: State, goal: State, held: bool, shares: Shares, found: Samples
) -> Samples:
    """The motion with larger shares, where these are allowed and as quick."""
    for name in ("jerk", "aside", "throwing", "velocity"):
        low, high = getattr(shares, name), 1.0
        for _ in range(QUICKENINGS if low < 1.0 else 0):
            middle = (low + high) / 2
            larger = dataclasses.replace(shares, **{name: middle})
            other = transfer(larger.limits(space), start, goal)
            if (
                other is not None
                and other.ticks < len(found.q)
                and first_finding(space, other.samples, held=held) is None
            ):
                shares, found, low = larger, other.samples, middle
            else:
                high = middle
    return found
