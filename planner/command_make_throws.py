"""`throwplan make-throws`: a synthetic batch of measured throws."""

from __future__ import annotations

import argparse
from typing import Any

from .command import DONE, command


def add_make_throws(commands: Any) -> None:
    """Adds `throwplan make-throws`."""
    example = "throwplan make-throws --out out/throws"
    command(
        commands, "make-throws", _make_throws, "make a synthetic batch of measured throws", example
    )


def _make_throws(options: argparse.Namespace) -> int:
    return DONE
