"""`throwplan identify`: contact parameters from measured throws."""

from __future__ import annotations

import argparse
from typing import Any

from .command import DONE, command


def add_identify(commands: Any) -> None:
    """Adds `throwplan identify`."""
    example = "throwplan identify out/throws --model ls-step --out out/fit"
    command(
        commands, "identify", _identify, "fit friction and patch radius to measured throws", example
    )


def _identify(options: argparse.Namespace) -> int:
    return DONE
