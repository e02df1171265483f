"""Colours of a throw, the same in its pictures and in the 3-D view."""

from __future__ import annotations

from .timeline import PHASES

COLOURS = dict(zip(PHASES, ("#8a8f98", "#4c78a8", "#f2a33a", "#d1495b", "#2a9d6f"), strict=True))
ARM = "#3d4450"
