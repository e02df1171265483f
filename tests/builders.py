"""What tests of several files build alike: scenes with other values, NLPs, edited plan files."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import throwplan as tp
from throwplan.models.robot import LinkInertia
from throwplan.planner.ocp import Request, ThrowNlp, build_nlp
from throwplan.planner.throw import make_manipulator


def varied(scene: tp.Scene, limits: dict[str, Any] | None = None, **sections: Any) -> tp.Scene:
    """The scene with other values in its sections, and in its arm's limits."""
    if limits is not None:
        assert scene.arm is not None
        other = dataclasses.replace(scene.arm.limits, **limits)
        sections["arm"] = sections.get("arm", {}) | {"limits": other}
    for name, values in sections.items():
        if isinstance(values, dict):
            sections[name] = dataclasses.replace(getattr(scene, name), **values)
    return scene.replace(**sections)


def request_of(scene: tp.Scene) -> Request:
    """The scene's own target, planned as usual."""
    return Request(scene, make_manipulator(scene), scene.target)


def nlp_of(scene: tp.Scene) -> ThrowNlp:
    return build_nlp(request_of(scene))


def inertia_matrix(link: LinkInertia) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = link.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def merged(table: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    both = {
        name: merged(table[name], value)
        for name, value in changes.items()
        if isinstance(value, dict) and isinstance(table.get(name), dict)
    }
    return table | changes | both


def edit_plan(folder: Path, **changes: Any) -> Path:
    """Values of a plan.json, or of tables in it, changed; the folder."""
    path = folder / "plan.json"
    path.write_text(json.dumps(merged(json.loads(path.read_text()), changes)))
    return folder
