"""A sweep as files: sweep.json, sweep.csv and its pictures. All or nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...problems import filling
from .pictures import draw_sweep

if TYPE_CHECKING:
    from .sweep import Sweep

#: What a sweep leaves in its folder.
FILES = ("landings.png", "delay.png", "histogram.png", "tornado.png", "sweep.csv", "sweep.json")
#: Rows of sweep.csv that are put into words at a time.
ROWS = 8192


def save_sweep(sweep: Sweep, folder: Path) -> None:
    """Write a sweep's files into `folder`."""
    with filling(folder, FILES) as scratch:
        draw_sweep(sweep, scratch)
        write_samples(sweep, scratch / "sweep.csv")
        text = json.dumps(sweep.to_dict(), indent=2, allow_nan=False)
        (scratch / "sweep.json").write_text(text + "\n", encoding="utf-8")


def write_samples(sweep: Sweep, path: Path) -> None:
    """sweep.csv: a row a sample, its number, parameters, landing and success (0 or 1)."""
    names = sweep.sampler.names
    landings = sweep.landings
    header = ["sample", *names, "x", "theta", "flight_time", "success", "held"]
    columns = [
        sweep.numbers,
        *sweep.values.T,
        *landings.pose.T,
        sweep.success,
        landings.held,
    ]
    formats = ["%d", *["%.9g"] * (len(names) + 3), "%d", "%d"]
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(header) + "\n")
        for first in range(0, sweep.samples, ROWS):
            rows = np.column_stack([column[first : first + ROWS] for column in columns])
            np.savetxt(file, rows, delimiter=",", fmt=formats)
