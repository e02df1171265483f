"""A patch of LuGre bristles: a band for compliant pads, not the truth.

Each point has a bristle z in the plane (Canudas de Wit et al. 1995, without Stribeck's
effect, g(v) = mu, which makes the law passive for any damping):

    z' = v - sigma_0 |v| z / mu,   f = -(sigma_0 z + sigma_1 z' + sigma_2 v) N(t).

The stiffness falls with the normal force N: with a fixed one the bristles of a resting
bar would never relax. Backward Euler eliminates the bristles, y = sigma_0 z / mu obeys
y (c + |u|) = u + c y_old with c = mu / (sigma_0 dt), so three unknowns remain, and the
step is that of a rigid patch with a memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .batch import ReleaseBatch
from .patch import Pressure
from .patch_release import Bristles, PatchThrows, march_patch, patch_batch, single_release
from .release import Release, ReleaseCase

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class LuGreRelease:
    """LuGre bristles on about `points` points, loaded at time 0 so that the body rests.

    stiffness sigma_0 [1/m]: mu / sigma_0 is the travel to full friction; damping_ratio of
    the body on the bristles at full grip, above 0; viscous sigma_2 [s/m]; steps over the
    opening, first order. Raises ValueError for settings out of range.
    """

    points: int = 64
    pressure: Pressure = "uniform"
    stiffness: float = 1e7
    damping_ratio: float = 1.0
    viscous: float = 0.0
    steps: int = 500

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping_ratio"):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                raise ValueError(f"{name}: must be above 0 and finite, got {value:g}")
        if not 0 <= self.viscous < np.inf:
            raise ValueError(f"viscous: must not be negative, got {self.viscous:g}")

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case; `trouble` says so if a step was not solved."""
        throws = PatchThrows.of(case, self.steps)
        return single_release(
            march_patch(throws, self.points, self.pressure, self.bristles(throws))
        )

    def batch(self, batch: ReleaseBatch) -> Array:
        """Detach states (N, 6) of a batch; NaN for a throw with a step that was not solved."""
        return patch_batch(batch, self.steps, self.points, self.pressure, self.bristles)

    def bristles(self, throws: PatchThrows) -> Bristles:
        """The bristles, damped as the full grip (that of the first step) asks for."""
        grip = throws.contact.faces * throws.forces[0]
        damping = self.damping_ratio * critical_damping(throws.body.mass, grip, self.stiffness)
        return Bristles(self.stiffness, damping, self.viscous)


def critical_damping(mass: Array | float, normal_force: Array | float, stiffness: float) -> Array:
    """sigma_1 [s/m] that just stops a mass [kg] swinging on bristles under a force [N].

    m s'' + N sigma_1 s' + N sigma_0 s = 0 with damping ratio 1.
    """
    held = np.maximum(np.asarray(normal_force, float), 1e-9)
    return np.asarray(2.0 * np.sqrt(stiffness * np.asarray(mass) / held))
