"""`throwplan report`: error against run time, stability, reach and robustness, measured."""

from .run import FILES, SECTIONS, make_report

__all__ = ["FILES", "SECTIONS", "make_report"]
