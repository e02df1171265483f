"""`throwplan replay`: a plan thrown in MuJoCo."""

from __future__ import annotations

import argparse
from typing import Any

from .command import DONE, command


def add_replay(commands: Any) -> None:
    """Adds `throwplan replay`."""
    example = "throwplan replay out/cup/plan.json"
    command(commands, "replay", _replay, "throw a plan's release in MuJoCo", example)


def _replay(options: argparse.Namespace) -> int:
    return DONE
