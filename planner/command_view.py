"""`throwplan view`: a plan in 3-D in the browser."""

from __future__ import annotations

import argparse
from typing import Any

from .command import DONE, command


def add_view(commands: Any) -> None:
    """Adds `throwplan view`."""
    example = "throwplan view out/cup/plan.json"
    command(commands, "view", _view, "look at a plan in 3-D in the browser", example)


def _view(options: argparse.Namespace) -> int:
    return DONE
