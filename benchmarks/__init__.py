"""Benchmarks of throwplan: error against run time, stability, reach and robustness.

Not part of the package, which is used here as anyone uses it: by its public names and, where
there is none for what is measured, by the faces of its packages. `python -m benchmarks`, in the
project's root, writes docs/report. A section is a module with `make(effort)`, which gives figures,
tables and pictures.
"""

from .page import Effort, Picture, ReportSection
from .run import FROZEN, SECTIONS, make_report
from .summary import PAGE
