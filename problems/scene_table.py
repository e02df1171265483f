"""A whole scene as one table of plain values, for a plan's file, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .arm_file import arm_from, arm_table
from .errors import InputError
from .load import SECTIONS, scene_from
from .scene import Scene
from .section import table_of
from .uncertainty import Uncertainty, uncertainty_table


def scene_table(scene: Scene) -> dict[str, Any]:
    """The scene as its file would say it, with the data of its arm as the table `arm`.

    What the file takes from other files (a recorded grip force) is in it.
    """
    table: dict[str, Any] = {"name": scene.name, "description": scene.description}
    table["gravity"] = scene.gravity
    for key in SECTIONS:
        section = getattr(scene, key)
        if isinstance(section, Uncertainty):
            table[key] = uncertainty_table(section)
        elif section is not None:
            table[key] = table_of(section)
    # Its rows are there.
    for key in ("table", "raw"):
        table["gripper"].pop(key, None)
    if scene.arm is not None:
        table["arm"] = arm_table(scene.arm)
    return {key: value for key, value in table.items() if value not in ({}, "")}


def scene_from_table(table: Mapping[str, Any]) -> Scene:
    """The scene that `scene_table` made the table from; InputError for what is wrong in it."""
    sections = {key: value for key, value in table.items() if key != "arm"}
    if "arm" not in table:
        return scene_from(sections)
    try:
        arm = arm_from(table["arm"])
    except InputError as error:
        raise InputError(f"arm: {error}") from None
    return scene_from(sections, arm=arm)
