"""A scene's given hand motion through release models."""

from __future__ import annotations

import difflib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..problems.errors import InputError
from ..problems.scene import Motion, Scene
from .rollout import (
    LIMIT_SURFACE_STEPS,
    SLIDING_PIVOT_STEPS,
    HandSamples,
    Landing,
    Release,
    landing,
    limit_surface_along,
    sliding_pivot_along,
)

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Simulation:
    """One release by one model; landing is None where the scene gives no height."""

    model: str
    release: Release
    landing: Landing | None
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """SI units, radians; events in s from the start of the opening."""
        end = self.release.detach
        detach = {"x": end.x, "z": end.z, "theta": end.theta}
        detach |= {"vx": end.v_x, "vz": end.v_z, "omega": end.omega}
        land = self.landing
        pose = None if land is None else {"x": land.x, "z": land.z, "theta": land.theta}
        return {
            "detach": {k: float(v) for k, v in detach.items()},
            "landing": pose and {k: _number(v) for k, v in pose.items()},
            "events": {"pivot": self.release.pivot, "slide": self.release.slide},
            "time": self.seconds,
        }


def _sliding_pivot(scene: Scene, motion: Motion) -> Release:
    instants = _instants(scene, 2 * SLIDING_PIVOT_STEPS)
    return sliding_pivot_along(scene, given_hand(motion, instants), instants)


def _sliding_pivot_paper(scene: Scene, motion: Motion) -> Release:
    instants = _instants(scene, 2 * SLIDING_PIVOT_STEPS)
    return sliding_pivot_along(scene, given_hand(motion, instants), instants, "paper")


def _limit_surface(scene: Scene, motion: Motion) -> Release:
    instants = _instants(scene, LIMIT_SURFACE_STEPS)
    return limit_surface_along(scene, given_hand(motion, instants), instants)


#: Release models by their names on the command line.
MODELS: dict[str, Callable[[Scene, Motion], Release]] = {
    "sp": _sliding_pivot,
    "sp-paper": _sliding_pivot_paper,
    "ls-step": _limit_surface,
}


def simulate(scene: Scene, model: str = "all") -> dict[str, Simulation]:
    """The scene's [motion] through `model`, or through all of them.

    Raises InputError for a scene without a motion and for an unknown model.
    """
    if scene.motion is None:
        raise InputError(f"{scene.place}: has no section [motion] to simulate")
    names = list(MODELS) if model == "all" else [model]
    if names[0] not in MODELS:
        near = difflib.get_close_matches(model, MODELS, 1, 0.4)
        hint = f", did you mean '{near[0]}'?" if near else ""
        raise InputError(f"model = {model!r}: must be all or one of {', '.join(MODELS)}{hint}")
    return {name: _run(scene, name, scene.motion) for name in names}


def _run(scene: Scene, name: str, motion: Motion) -> Simulation:
    start = time.perf_counter()
    release = MODELS[name](scene, motion)
    height = None if scene.target is None else scene.target.z
    land = None if height is None else landing(release, height, scene.gravity)
    return Simulation(name, release, land, time.perf_counter() - start)


def given_hand(motion: Motion, times: Array) -> HandSamples:
    """The hand of a constant-acceleration motion at `times` [s] after the opening's start."""
    start = np.array([*motion.position, motion.angle])[:, None]
    rate = np.array([*motion.velocity, motion.rate])[:, None]
    acceleration = np.array([*motion.acceleration, motion.angular_acceleration])[:, None]
    return HandSamples(
        times,
        start + rate * times + acceleration * times**2 / 2,
        rate + acceleration * times,
        np.repeat(acceleration, len(times), axis=1),
    )


def _instants(scene: Scene, steps: int) -> Array:
    return np.linspace(0.0, scene.gripper.profile().opening, steps + 1)


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
