"""`throwplan import-robot`: a robot's URDF as an arm data file."""

from __future__ import annotations

import argparse
from typing import Any

from .command import DONE, command


def add_import(commands: Any) -> None:
    """Adds `throwplan import-robot`."""
    example = "throwplan import-robot my.urdf --joints j1 j2 j3 j4 j5 j6"
    command(commands, "import-robot", _import, "turn a robot's URDF into an arm data file", example)


def _import(options: argparse.Namespace) -> int:
    return DONE
