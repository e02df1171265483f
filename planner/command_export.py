"""`throwplan export`: a plan for robot controllers."""

from __future__ import annotations

import argparse
from typing import Any

from .command import DONE, command


def add_export(commands: Any) -> None:
    """Adds `throwplan export`."""
    example = "throwplan export out/cup/plan.json --franka out/franka"
    command(commands, "export", _export, "write a plan for a robot controller", example)


def _export(options: argparse.Namespace) -> int:
    return DONE
