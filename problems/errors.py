"""The exceptions that a user of throwplan can meet."""

from __future__ import annotations


class ThrowplanError(Exception):
    """Base of all of throwplan's own exceptions."""


class InputError(ThrowplanError, ValueError):
    """Wrong input. The message is one line: where, which value, what is allowed."""

    def within(self, place: str) -> InputError:
        """The same error with `place` (a file, a section) put before the message."""
        return InputError(f"{place}: {self}")
