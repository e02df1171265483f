"""The seven reference cases as releases."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from throwplan.models import Body, Contact, LinearRelease, Patch, Release, ReleaseCase
from throwplan.models import Path as Motion

VALUES: dict[str, Any] = {
    name: case
    for name, case in json.loads(
        (Path(__file__).parent.parent / "data" / "release.json").read_text()
    ).items()
    if isinstance(case, dict) and "detach" in case
}
STILL = {"theta0": 0.0, "v0": [0.0, 0.0], "omega0": 0.0, "a": [0.0, 0.0], "alpha": 0.0}


def reference_case(name: str) -> ReleaseCase:
    values = VALUES[name]
    body, contact = values["object"], values["contact"]
    hand = STILL if values["hand"] == "drop" else values["hand"]
    return ReleaseCase(
        Body(body["m"], body["I"], body["h"]),
        Contact(contact["mu"], contact["r"], contact["c"], contact["faces"]),
        LinearRelease(values["fN0"], 0.0, values["T"]),
        Motion.accelerating(
            (0.0, 0.0, hand["theta0"]),
            (*hand["v0"], hand["omega0"]),
            (*hand["a"], hand["alpha"]),
        ),
    )


def expected(name: str, model: str) -> np.ndarray:
    """x, z, theta, v_x, v_z, omega at detach."""
    values = VALUES[name]["detach"][model]
    return np.array([*values["x"], values["theta"], *values["v"], values["omega"]])


def detached(release: Release) -> np.ndarray:
    return np.concatenate([release.com[:, -1], release.com_twist[:, -1]])


def landed(release: Release, below: float = 1.0) -> tuple[float, float]:
    """x [m] and theta [rad] `below` metres under the hand's first position."""
    end = release.detach
    time = (end.v_z + np.sqrt(end.v_z**2 + 2 * 9.81 * (end.z + below))) / 9.81
    return float(end.x + end.v_x * time), float(end.theta + end.omega * time)


def sliding_wrench(patch: Patch, twist: np.ndarray) -> np.ndarray:
    """Coulomb friction (3,) of a patch whose points slip with a twist (3,), over mu f_N."""
    u_x, u_z = twist[0] - twist[2] * patch.z, twist[1] + twist[2] * patch.x
    share = patch.weights / np.hypot(u_x, u_z)
    force_x, force_z = -share * u_x, -share * u_z
    torque = patch.x * force_z - patch.z * force_x
    return np.array([force_x.sum(), force_z.sum(), torque.sum()])
