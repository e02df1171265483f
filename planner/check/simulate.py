"""A scene's given hand motion through release models."""

from __future__ import annotations

import dataclasses
import difflib
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...models import (
    ImplicitRelease,
    KarnoppRelease,
    LuGreRelease,
    PatchRelease,
    Quartic,
    Release,
    ReleaseCase,
    ReleaseModel,
    SlidingPivotRelease,
    SteppedRelease,
    rotated_ellipsoid,
)
from ...problems import InputError, Scene, as_scene
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

#: Variants of them: asked for by name only, not part of all. The paper's integrator; other
#: limit surfaces; other stiff integrators and the consistent norm, whose half-band is
#: smaller by about c r_p; Hertz's pressure; softer bristles [1/m].
VARIANTS: dict[str, ReleaseModel] = {
    "sp-euler": SlidingPivotRelease(steps=500, integrator="euler"),
    "sp-paper-euler": SlidingPivotRelease("paper", steps=500, integrator="euler"),
    "ls-rotated": KarnoppRelease(shape=rotated_ellipsoid),
    "ls-quartic": KarnoppRelease(shape=Quartic),
    "ils-rotated": ImplicitRelease(shape=rotated_ellipsoid),
    "ils-quartic": ImplicitRelease(shape=Quartic),
    "ils-radau": ImplicitRelease(method="Radau"),
    "ils-bdf": ImplicitRelease(method="BDF"),
    "ils-consistent": ImplicitRelease(5e-5, norm="consistent"),
    "ls-step-rotated": SteppedRelease(shape=rotated_ellipsoid),
    "ls-step-quartic": SteppedRelease(shape=Quartic),
    "patch-hertz": PatchRelease(pressure="hertz"),
    "lugre-1e6": LuGreRelease(stiffness=1e6),
    "lugre-1e5": LuGreRelease(stiffness=1e5),
}


def simulate(scene: Scene | str | Path, model: str = "all") -> dict[str, Simulation]:
    """The [motion] of a scene, built-in name or TOML file through a release model.

    model: a name of MODELS or VARIANTS, or 'all' for all of MODELS.
    Raises InputError for a scene without a motion and for an unknown model.
    """
    scene = as_scene(scene)
    case = case_of(scene, given_hand(scene))
    if model == "all":
        return {name: _run(scene, name, known, case) for name, known in MODELS.items()}
    named = MODELS | VARIANTS
    if model not in named:
        near = difflib.get_close_matches(str(model), named, 1, 0.4)
        hint = f", did you mean '{near[0]}'?" if near else ""
        raise InputError(
            f"model = {model!r}: must be all or one of {', '.join(MODELS)}, or a variant: "
            f"{', '.join(VARIANTS)}{hint}"
        )
    return {model: _run(scene, model, named[model], case)}


def _run(scene: Scene, name: str, model: ReleaseModel, case: ReleaseCase) -> Simulation:
    start = time.perf_counter()
    if isinstance(model, PatchRelease | LuGreRelease) and scene.contact.pressure == "hertz":
        model = dataclasses.replace(model, pressure="hertz")
    release = model.release(case)
    height = None if scene.target is None else scene.target.z
    land = None if height is None else landing(release, height, scene.gravity)
    return Simulation(name, release, land, time.perf_counter() - start)


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
