"""Prints the table of docs/performance.md: every built-in scene planned in a fresh process.

Error and run time side by side, with both solvers in one run:

    .venv/bin/python examples/figures.py
"""

import json
import math
import platform
import subprocess
import sys
import time

import casadi
import throwplan as tp


def row(name: str, solver: str) -> str:
    """One scene with one solver, in a fresh process, as a table row."""
    command = [sys.executable, "-m", "throwplan", "plan", name, "--json", "--solver", solver]
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - start
    result = json.loads(done.stdout)
    counted, target = result["error"][result["decides"]], result["target"]
    pivot = result["error"]["sent"]
    cells = [
        name,
        result["solver"]["name"],
        result["status"],
        f"{1e3 * counted['position']:.3f} mm",
        "open" if target["theta"] is None else f"{math.degrees(counted['angle']):.3f}°",
        f"{1e3 * pivot['position']:.2f} mm",
        f"{result['solver']['iterations']}",
        f"{1e3 * result['time']['solve']:.0f} ms",
        f"{seconds:.1f} s",
    ]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table for all scenes that have something to plan."""
    print(
        f"{platform.machine()}, Python {platform.python_version()}, CasADi {casadi.__version__}\n"
    )
    print(
        "| scene | solver | status | position error | angle error | sliding pivot "
        "| iterations | solve | fresh process |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in tp.scene_names():
        if tp.load_scene(name).motion is None:
            for solver in ("fatrop", "ipopt"):
                print(row(name, solver), flush=True)


if __name__ == "__main__":
    main()
