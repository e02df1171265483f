"""`throwplan report`: error against run time, stability, reach and robustness, measured.

A section is a module with `make(effort)`, which gives figures, tables and pictures.
"""

from .judge import Verdict, judged
from .page import Effort, Picture, ReportSection
from .run import SECTIONS, make_report
from .summary import PAGE
