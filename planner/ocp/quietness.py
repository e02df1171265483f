"""How quiet a release is: what the pads would transmit while they may open."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...problems import Scene
from ..check import Motion, Mover, friction_use, hand_samples
from .window import Window, window_of

Array = npt.NDArray[np.float64]

#: Instants of the window that are looked at.
SAMPLES = 141


def load_curve(
    scene: Scene, mover: Mover, motion: Motion, opening_time: float
) -> tuple[Array, Array]:
    """Times (K,) [s] over the window and the load there (K,).

    The load is the wrench that would keep the object moving with the hand, as a share of
    the full grip's friction limit: 1 is what the grip can hold, 0 is the object's own free
    flight.
    """
    window: Window = window_of(scene)
    begin = opening_time - window.early * window.step
    end = opening_time + scene.gripper.profile().opening + window.late * window.step
    times = np.linspace(max(begin, 0.0), end, SAMPLES)
    force, torque = friction_use(scene, hand_samples(mover, motion, times))
    return times, np.asarray(np.hypot(force, torque))


def peak_load(scene: Scene, mover: Mover, motion: Motion, opening_time: float) -> float:
    """The largest load over the window."""
    return float(load_curve(scene, mover, motion, opening_time)[1].max())
