"""`throwplan simulate`: a given hand motion through release models."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ...problems import load_scene
from .command import DONE, add_out, add_scene, command, say


def add_simulate(commands: Any) -> None:
    """Adds `throwplan simulate`."""
    words = "throw a given hand motion by release models"
    parser = command(commands, "simulate", _simulate, words, "throwplan simulate drop --model sp")
    add_scene(parser)
    names = (
        "a model's name, or all; also variants that are not part of all: ls-step-quartic, "
        "ils-radau, ... (an unknown name lists them)"
    )
    parser.add_argument("--model", default="all", metavar="NAME", help=names)
    add_out(parser, "simulation.json and five pictures")


def _simulate(options: argparse.Namespace) -> int:
    from ..check import simulate

    scene = load_scene(options.scene)
    results = {name: run.to_dict() for name, run in simulate(scene, options.model).items()}
    text = json.dumps({"scene": scene.name, "models": results}, indent=2, allow_nan=False)
    if options.out is not None:
        from ...problems import save_text

        save_text(text + "\n", Path(options.out), "simulation.json")
        from ..show import draw_release_pictures

        say(options, f"{scene.name}: drawing")
        draw_release_pictures(scene, Path(options.out))
    if options.json:
        print(text)
        return DONE
    _print_simulations(scene.name, results)
    return DONE


def _print_simulations(name: str, results: dict[str, Any]) -> None:
    """A table of detach states and events, landings where there is a height, and statuses."""
    keys = ("x", "z", "theta", "vx", "vz", "omega")
    print(f"{name}: object at detach, SI units")
    wide = max(10, *(len(model) for model in results))
    print(
        f"  {'model':{wide}}" + "".join(f"{key:>12}" for key in keys) + "       pivot       slide"
    )
    for model, result in results.items():
        numbers = "".join(_cell(result["detach"][key], 12, 5) for key in keys)
        events = (result["events"][event] for event in ("pivot", "slide"))
        onsets = "".join(_cell(None if e is None else 1e3 * e, 9, 2, " ms") for e in events)
        print(f"  {model:{wide}}{numbers}{onsets}")
    for model, result in results.items():
        if result["landing"] is not None:
            x, theta = (_cell(result["landing"][key], 10, 4) for key in ("x", "theta"))
            print(f"  {model:{wide}} lands at x{x} m, theta{theta} rad")
    for model, result in results.items():
        if result["status"] != "ok":
            print(f"  {model}: not to be trusted: {result['status']}")


def _cell(value: float | None, width: int, digits: int, unit: str = "") -> str:
    """A number for a table, a dash where there is none."""
    if value is None:
        return f"{'-':>{width + len(unit)}}"
    return f"{value:{width}.{digits}f}{unit}"
