"""`throwplan map`: which landing poses are in reach."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...problems import load_scene
from .command import DONE, NO_THROW, add_out, add_scene, command, number, say, whole
from .progress import ProgressLine

if TYPE_CHECKING:
    from ..reach import ReachMap


def add_map(commands: Any) -> None:
    """Adds `throwplan map`."""
    words = "show which landing poses are in reach"
    parser = command(commands, "map", _map, words, "throwplan map pose --out out/map")
    add_scene(parser)
    parser.add_argument("--z", metavar="Z", help="height of the landing (default: the target's)")
    parser.add_argument(
        "--samples", metavar="N", default="200000", help="sampled states (default: 200000)"
    )
    add_out(parser, "map.png and map.npz")


def _map(options: argparse.Namespace) -> int:
    from ...problems import prepare_folder
    from ..check import make_mover
    from ..reach import FILES, MOST, check_map, reach_map

    z = None if options.z is None else number("--z", options.z)
    samples = whole("--samples", options.samples, 1, MOST)
    check_map(z, samples, "--")
    scene = load_scene(options.scene)
    # A scene that cannot be planned is refused before a folder is made.
    make_mover(scene)
    if options.out is not None:
        prepare_folder(Path(options.out), FILES)
    with ProgressLine(scene.name) as show:
        found = reach_map(scene, z, samples, progress=show)
    if not found.reachable:
        if options.json:
            print(json.dumps(found.to_dict(), indent=2, allow_nan=False))
        print(f"throwplan: {found.message}", file=sys.stderr)
        return NO_THROW
    file = None
    if options.out is not None:
        say(options, f"{scene.name}: writing {options.out}")
        file = found.save(options.out)
    if options.json:
        print(json.dumps(found.to_dict(file), indent=2, allow_nan=False))
    else:
        _print_map(found, options.out)
    return DONE


def _print_map(found: ReachMap, out: str | None) -> None:
    """A map in three lines."""
    wide, angle = found.widths
    size = f"{100 * wide:g} cm" + ("" if angle is None else f" x {math.degrees(angle):g} deg")
    written = "" if out is None else f"; written to {out}"
    print(
        f"{found.scene.name}: {found.reachable:,} bins of {size} in reach at z {found.z:g} m "
        f"({found.x.size:,} landings of {found.samples:,} samples){written}"
    )
    words = f"x {found.x.min():.2f} to {found.x.max():.2f} m"
    if angle is not None:
        low, high = (math.degrees(v) for v in (found.theta.min(), found.theta.max()))
        words += f", theta {low:.0f} to {high:.0f} deg"
    best = float(found.margin[found.landings > 0].max())
    print(f"  {words}; best margin {100 * best:.0f} % (left of the limit that is used most)")
    print(f"  {_target(found)}")


def _target(found: ReachMap) -> str:
    """Whether the scene's target is in reach."""
    target = found.scene.target
    assert target is not None  # a scene with a map has one
    words = f"target x {target.plane_x:g} m"
    if target.theta is not None:
        words += f", theta {math.degrees(target.theta):g} deg"
    where = found.bin_of(target.plane_x, target.theta)
    if where is not None and found.landings[where]:
        count, margin = found.solutions[where], found.margin[where]
        different = "1 throw" if count == 1 else f"{count:,} different throws"
        return f"{words}: in reach, {different} in its bin, best margin {100 * margin:.0f} %"
    away = found.distance(target.plane_x, target.theta)
    return f"{words}: in no bin that was hit, nearest landing {away:.3f} m away (scaled)"
