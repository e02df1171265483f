"""`throwplan validate`: release models on measured throws."""

from __future__ import annotations

import argparse
from typing import Any

from .command import DONE, command


def add_validate(commands: Any) -> None:
    """Adds `throwplan validate`."""
    example = "throwplan validate out/throws --out out/validation"
    command(commands, "validate", _validate, "compare release models on measured throws", example)


def _validate(options: argparse.Namespace) -> int:
    return DONE
