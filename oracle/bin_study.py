"""Scenes with a random bin as their target."""

from __future__ import annotations

import math

import numpy as np
import throwplan as tp

#: Arms whose shipped scenes are varied.
ARMS = ("box", "fr3")
#: Ranges: lengths and widths, radii, depths, heights of rims [m]; distances of the centres from the
#: base [m] and their azimuths [rad]; clearances [m].
SIZES, RADII, DEPTHS, RIMS = (0.12, 0.40), (0.07, 0.20), (0.06, 0.25), (0.08, 0.35)
AWAY, AZIMUTHS, CLEARANCES = (0.6, 1.15), (-1.0, 1.0), (0.003, 0.015)


def random_bin(shape: str, random: np.random.Generator) -> tp.Scene:
    """A shipped scene with a random bin of a shape, `box` or `round`."""
    scene = tp.load_scene(ARMS[random.integers(2)])
    away, turn, rim = (float(random.uniform(*span)) for span in (AWAY, AZIMUTHS, RIMS))
    depth, clearance = (float(random.uniform(*span)) for span in (DEPTHS, CLEARANCES))
    if shape == "round":
        sizes = {"radius": float(random.uniform(*RADII))}
    else:
        length, width = (float(random.uniform(*SIZES)) for _ in range(2))
        sizes = {"length": length, "width": width}
        sizes["yaw"] = float(random.uniform(-math.pi / 2, math.pi / 2))
    place = {"x": away * math.cos(turn), "y": away * math.sin(turn), "rim": rim}
    into = tp.Bin(shape=shape, depth=depth, clearance=clearance, **place, **sizes)
    return scene.replace(bin=into, target=None)
