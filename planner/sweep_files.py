"""A sweep as files: sweep.json, sweep.csv and its pictures. All or nothing."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path

import numpy as np

from ..problems.errors import InputError
from .files import prepare_folder
from .sweep import Sweep

#: What a sweep leaves in its folder.
FILES = ("landings.png", "delay.png", "histogram.png", "tornado.png", "sweep.csv", "sweep.json")
#: Rows of sweep.csv that are put into words at a time.
ROWS = 8192


def prepare_sweep_folder(folder: Path) -> Path:
    """Make `folder` if need be and make sure it takes the files; InputError if not."""
    folder = prepare_folder(folder)
    for name in FILES:
        if (folder / name).is_dir():
            raise InputError(f"--out {folder}: {name} is a folder there")
    return folder


def save_sweep(sweep: Sweep, folder: Path) -> None:
    """Write a sweep's files into `folder`: into a folder of their own first, then moved."""
    from .sweep_pictures import draw_sweep

    folder = prepare_sweep_folder(folder)
    try:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            draw_sweep(sweep, Path(scratch))
            write_samples(sweep, Path(scratch) / "sweep.csv")
            text = json.dumps(sweep.to_dict(), indent=2, allow_nan=False)
            (Path(scratch) / "sweep.json").write_text(text + "\n", encoding="utf-8")
            for name in FILES:
                os.replace(Path(scratch) / name, folder / name)
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror or error}") from None


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
