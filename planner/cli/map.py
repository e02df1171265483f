"""`throwplan map`: the reachable landing poses."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from ...problems import load_scene
from ...problems.files import prepare_folder
from ..reach import MAP_FILES, MOST, check_map, reach_map
from ..throw import make_manipulator
from .common import (
    DONE,
    NO_THROW,
    Add,
    Progress,
    add_out,
    add_scene,
    integer,
    notes,
    number,
    print_result,
    written,
)


def arguments(add: Add) -> None:
    """The command's options."""
    add_scene(add)
    add("--z", type=number(), metavar="Z", help="height of the landing (default: the target's)")
    words = "sampled states (default: 200000)"
    add("--samples", type=integer(1, MOST), metavar="N", default=200_000, help=words)
    add_out(add, "map.png and map.npz")


def run(options: argparse.Namespace) -> int:
    """Compute the map, write and print it."""
    z, samples = options.z, options.samples
    check_map(z, samples, "--")
    scene = load_scene(options.scene)
    # Refuse a scene that cannot be planned before making a folder.
    make_manipulator(scene)
    if options.out is not None:
        prepare_folder(Path(options.out), MAP_FILES)
    with Progress(scene.name) as progress:
        result = reach_map(scene, z, samples, progress=progress)
    if not result.reachable:
        if options.json:
            print(json.dumps(result.to_dict(), indent=2, allow_nan=False))
        print(f"throwplan: {result.message}", file=sys.stderr)
        return NO_THROW
    file = None
    if options.out is not None:
        with Progress(f"{scene.name}: writing {options.out}"):
            file = result.save(options.out)
    print_result(options, result.to_dict(file), result.summary() + notes(scene) + written(options))
    return DONE
