"""`throwplan simulate`: a given hand motion through release models."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ...models.release import MODELS
from ...problems import load_scene
from ...problems.files import filling, write_json
from ..show import draw_releases
from ..simulation import simulate
from .common import DONE, Add, Progress, add_out, add_scene, notes, print_result


def arguments(add: Add) -> None:
    """The command's options."""
    add_scene(add)
    names = f"all (default), or one of {', '.join(MODELS)}"
    add("--model", default="all", metavar="NAME", help=names)
    add_out(add, "simulation.json and releases.png")


def run(options: argparse.Namespace) -> int:
    """Simulate, write and print."""
    scene = load_scene(options.scene)
    with Progress(f"{scene.name}: throwing"):
        runs = simulate(scene, options.model)
    models = {name: run.to_dict() for name, run in runs.items()}
    result = {"scene": scene.name, "models": models}
    if options.out is not None:
        files = filling(Path(options.out), ("simulation.json", "releases.png"))
        with Progress(f"{scene.name}: drawing"), files as scratch:
            write_json(scratch / "simulation.json", result)
            draw_releases(scene, runs, scratch / "releases.png")
    print_result(options, result, _table(scene.name, models) + notes(scene))
    return DONE


def _table(name: str, models: dict[str, Any]) -> str:
    """Detach states and events, landings where there is a height, and statuses."""
    keys = ("x", "z", "theta", "vx", "vz", "omega")
    wide = max(10, *(len(model) for model in models))
    lines = [f"{name}: object at detach, SI units"]
    heads = "".join(f"{key:>12}" for key in keys)
    lines.append(f"  {'model':{wide}}{heads}{'pivot':>12}{'slide':>12}")
    for model, found in models.items():
        cells = "".join(_cell(found["detach"][key], 12, 5) for key in keys)
        for moment in (found["events"]["pivot"], found["events"]["slide"]):
            cells += _cell(None if moment is None else 1e3 * moment, 9, 2, " ms")
        lines.append(f"  {model:{wide}}{cells}")
    for model, found in models.items():
        landing = found["landing"]
        if landing is not None:
            x, theta = (_cell(landing[key], 10, 4) for key in ("x", "theta"))
            lines.append(f"  {model:{wide}} lands at x{x} m, theta{theta} rad")
    for model in models:
        lines.append(f"  {model:{wide}} {MODELS[model].summary()}")
    for model, found in models.items():
        if found["status"] != "ok":
            lines.append(f"  {model}: not to be trusted: {found['status']}")
    return "\n".join(lines)


def _cell(value: float | None, width: int, digits: int, unit: str = "") -> str:
    """A number for a table, a dash for None."""
    if value is None:
        return f"{'-':>{width + len(unit)}}"
    return f"{value:{width}.{digits}f}{unit}"
