"""Units in which people read uncertain parameters: in a sweep's table and on its pictures."""

from __future__ import annotations

import math

from ...problems import UNCERTAIN_PARAMETERS

#: Names, factor from SI, unit; the others are lengths, or angles.
UNITS = (
    (("hand_vx", "hand_vz"), 1e3, "mm/s"),
    (("hand_omega",), math.degrees(1.0), "deg/s"),
    (("delay", "opening"), 1e3, "ms"),
    (("friction",), 1.0, ""),
    (("mass",), 1e3, "g"),
    (("inertia",), 1e6, "kg mm²"),
)


def unit_of(name: str) -> tuple[float, str]:
    """Factor and unit in which people read a parameter."""
    for names, factor, unit in UNITS:
        if name in names:
            return factor, unit
    return (math.degrees(1.0), "deg") if UNCERTAIN_PARAMETERS[name].degrees else (1e3, "mm")
