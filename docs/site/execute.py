"""Runs the notebooks of examples/ and writes each with its output: NAME.py to NAME.ipynb.

    python docs/site/execute.py [NAME ...]

A notebook is a script in Jupytext's percent format. What differs from run to run for no
reason (times of execution, random names of cells, versions) is left out of the .ipynb.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import jupytext
import nbclient
import nbformat

FOLDER = Path(__file__).parents[2] / "examples"
#: In the order in which they are to be read.
NOTEBOOKS = sorted(path.stem for path in FOLDER.glob("*.py"))
#: Longest time of one cell [s].
LONGEST = 300


def notebook(name: str) -> nbformat.NotebookNode:
    """The notebook of a script, without output."""
    made = jupytext.read(FOLDER / f"{name}.py")
    for number, cell in enumerate(made.cells, start=1):
        cell["id"] = f"cell-{number}"
        cell["metadata"] = {}
    kernel = {"display_name": "Python 3 (ipykernel)", "language": "python", "name": "python3"}
    made.metadata = nbformat.from_dict({"kernelspec": kernel})
    return made


def executed(name: str) -> nbformat.NotebookNode:
    """The same, run from top to bottom; nbclient's CellExecutionError if a cell fails."""
    made = notebook(name)
    client = nbclient.NotebookClient(
        made, timeout=LONGEST, kernel_name="python3", record_timing=False
    )
    client.execute()
    made.metadata["language_info"] = nbformat.from_dict({"name": "python"})
    return made


def main() -> None:
    """Runs the notebooks that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(NOTEBOOKS))
    options = parser.parse_args()
    for name in options.names or NOTEBOOKS:
        start = time.perf_counter()
        made = executed(Path(name).stem)
        path = FOLDER / f"{Path(name).stem}.ipynb"
        nbformat.write(made, path)
        size = path.stat().st_size / 1e6
        print(f"{path.name}: {time.perf_counter() - start:.0f} s, {size:.2f} MB")


if __name__ == "__main__":
    main()
