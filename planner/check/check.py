"""Whether a motion throws where it should and breaks nothing: the promise behind `solved`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from ...models import Release, ReleaseCase
from ...problems import Pose, Scene
from .exact_release import limit_surface_release, sliding_pivot_release
from .motion import TICK, PiecewiseMotion, SampledMotion
from .mover import Limits, Mover
from .rollout import Landing, MoverTrack, case_of, kinks_of, landing, slip_while_carrying

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Thrown:
    """A motion thrown by a non-smooth release model: the sliding pivot or the limit surface."""

    release: Release
    landing: Landing
    carried: Callable[[], float]

    @cached_property
    def grip_use(self) -> float:
        """Largest friction use before the opening (1 is the limit)."""
        # Corrections ask for it of their last throw only.
        return self.carried()

    def miss(self, target: Pose) -> tuple[float, float]:
        """(Δx [m], Δtheta [rad]) to the target; 0 where it leaves theta open."""
        angle = 0.0 if target.theta is None else self.landing.theta - target.theta
        return self.landing.x - target.plane_x, angle


def throw(
    scene: Scene, mover: Mover, motion: PiecewiseMotion, opening_time: float, height: float
) -> Thrown:
    """The exact throw of `motion`: held from rest, opened at `opening_time`, flown to `height`."""
    return _thrown(sliding_pivot_release, scene, mover, motion, opening_time, height)


def limit_surface_throw(
    scene: Scene, mover: Mover, motion: PiecewiseMotion, opening_time: float, height: float
) -> Thrown:
    """The same motion thrown by the time-stepping limit surface."""
    return _thrown(limit_surface_release, scene, mover, motion, opening_time, height)


def _thrown(
    model: Callable[[ReleaseCase, Array], Release],
    scene: Scene,
    mover: Mover,
    motion: PiecewiseMotion,
    opening_time: float,
    height: float,
) -> Thrown:
    """A motion thrown by `model`, which takes the release and its kinks."""
    use = partial(slip_while_carrying, scene, mover, motion, opening_time)
    case = case_of(scene, MoverTrack(mover, motion, opening_time))
    release = model(case, kinks_of(motion, opening_time, case.grip.opening))
    return Thrown(release, landing(release, height, scene.gravity), use)


def broken_limits(limits: Limits, names: tuple[str, ...], sent: SampledMotion) -> list[str]:
    """Limits that any sample, or any difference of samples, breaks."""
    broken = []
    rate, acceleration = np.diff(sent.q, axis=0) / TICK, np.diff(sent.dq, axis=0) / TICK
    checks = [
        ("position", np.maximum(limits.q_min - sent.q, sent.q - limits.q_max), 0 * limits.dq),
        ("velocity", np.abs(sent.dq), limits.dq),
        ("velocity", np.abs(rate), limits.dq),
        ("acceleration", np.abs(sent.ddq), limits.ddq),
        ("acceleration", np.abs(acceleration), limits.ddq),
    ]
    if limits.slowing is not None:
        middle = (sent.q[1:] + sent.q[:-1]) / 2
        for q, dq in ((sent.q, sent.dq), (middle, rate)):
            low, high = limits.velocity(q)
            checks.append(("velocity", np.maximum(dq - high, low - dq), 0 * limits.dq))
    if limits.jerk is not None:
        checks.append(("jerk", np.abs(np.diff(sent.ddq, axis=0) / TICK), limits.jerk))
    for kind, values, limit in checks:
        # Room for rounding in the last digits only.
        for i in np.flatnonzero((values > limit + 1e-7 * np.maximum(limit, 1.0)).any(axis=0)):
            broken.append(f"{names[i]} {kind}")
    return list(dict.fromkeys(broken))
