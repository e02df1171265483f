"""A scene's given hand motion through release models."""

from __future__ import annotations

import dataclasses
import difflib
import math
import time
from dataclasses import dataclass
from typing import Any

from ..models.limit_surface_release import ImplicitRelease, KarnoppRelease
from ..models.lugre_release import LuGreRelease
from ..models.patch_release import PatchRelease
from ..models.release import Release, ReleaseCase, ReleaseModel
from ..models.sliding_pivot_release import SlidingPivotRelease
from ..models.time_stepping_release import SteppedRelease
from ..problems.errors import InputError
from ..problems.scene import Scene
from .given_motion import given_hand
from .rollout import Landing, case_of, landing


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
            "status": self.release.trouble or "ok",
            "detach": {k: _number(v) for k, v in detach.items()},
            "landing": pose and {k: _number(v) for k, v in pose.items()},
            "events": {"pivot": self.release.pivot, "slide": self.release.slide},
            "time": self.seconds,
        }


#: Release models by their names on the command line.
MODELS: dict[str, ReleaseModel] = {
    "sp": SlidingPivotRelease(steps=100, events=True),
    "sp-paper": SlidingPivotRelease("paper", steps=100, events=True),
    "ls": KarnoppRelease(),
    "ls-smooth": KarnoppRelease(half_band=0.01),
    "ils": ImplicitRelease(),
    "ls-step": SteppedRelease(),
    "patch": PatchRelease(),
    "lugre": LuGreRelease(),
}


def simulate(scene: Scene, model: str = "all") -> dict[str, Simulation]:
    """The scene's [motion] through `model`, or through all of them.

    Raises InputError for a scene without a motion and for an unknown model.
    """
    case = case_of(scene, given_hand(scene))
    names = list(MODELS) if model == "all" else [model]
    if names[0] not in MODELS:
        near = difflib.get_close_matches(str(model), MODELS, 1, 0.4)
        hint = f", did you mean '{near[0]}'?" if near else ""
        raise InputError(f"model = {model!r}: must be all or one of {', '.join(MODELS)}{hint}")
    return {name: _run(scene, name, case) for name in names}


def _run(scene: Scene, name: str, case: ReleaseCase) -> Simulation:
    start = time.perf_counter()
    model = MODELS[name]
    if isinstance(model, PatchRelease | LuGreRelease):
        hertz = scene.contact.pressure == "hertz"
        model = dataclasses.replace(model, pressure="hertz" if hertz else "uniform")
    release = model.release(case)
    height = None if scene.target is None else scene.target.z
    land = None if height is None else landing(release, height, scene.gravity)
    return Simulation(name, release, land, time.perf_counter() - start)


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
