"""Benchmarks of throwplan: `python -m benchmarks`, in the project's root, writes the page of tables
docs/performance.md.

Not part of the package, which is used here by its public names and, where there is none for what
is measured, by the faces of its packages. A section is a module with `make(effort)`, which returns
a `Section`.
"""

from .report import PAGE, SECTIONS, make_report
