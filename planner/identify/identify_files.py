"""What identification found, as files: identify.json, grids, pictures, contact.toml."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from ...problems import filling
from .fit_scene import contact_text
from .grid import Grid
from .identify_run import Identified
from .predict import model_names

#: What may be left in the folder.
FILES = (
    "identify.json",
    "contact.toml",
    "fit.png",
    *(f"grid-{model}.{ending}" for model in model_names() for ending in ("csv", "png")),
)


def save_identified(found: list[Identified], folder: Path) -> None:
    """Write the files of one or more models; contact.toml and fit.png are of the last."""
    from .identify_pictures import draw_fit, draw_grid

    with filling(folder, FILES) as scratch:
        for one in found:
            if one.grid is not None:
                write_grid(one.grid, scratch / f"grid-{one.model}.csv")
                draw_grid(one, scratch / f"grid-{one.model}.png")
        last = next((one for one in reversed(found) if one.fit is not None), None)
        if last is not None:
            draw_fit(last, scratch / "fit.png")
            shared = last.data.shared
            head = f"# from {len(last.data.throws)} throws of {last.data.name}, by {last.model}\n"
            text = head + contact_text(last.posterior, shared.torsion, shared.faces)
            (scratch / "contact.toml").write_text(text, encoding="utf-8")
        text = json.dumps([one.to_dict() for one in found], indent=2, allow_nan=False)
        (scratch / "identify.json").write_text(text + "\n", encoding="utf-8")


def write_grid(grid: Grid, path: Path) -> None:
    """A row a cell: friction, patch_radius [m], mean scaled error [m], throws that missed."""
    mu, radius = (v.ravel() for v in np.meshgrid(grid.friction, grid.patch_radius, indexing="ij"))
    rows = np.column_stack([mu, radius, grid.error.ravel(), grid.missed.ravel()])
    names = "friction,patch_radius_m,mean_error_m,missed"
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.9g")
