"""`throwplan scenes`: the built-in scenes, and the keys of a scene file."""

from __future__ import annotations

import argparse
import json
from importlib.resources import files
from pathlib import Path

from ...problems import InputError, load_scene, scene_names, scene_text
from ...problems.files import copy_out
from .common import DONE, Add, add_force, print_result


def arguments(add: Add) -> None:
    """The command's options."""
    add("--write", metavar="NAME", help="copy the scene's file to NAME.toml in this folder")
    add_force(add)
    add("--reference", action="store_true", help="print all keys of a scene file as Markdown")


def run(options: argparse.Namespace) -> int:
    """List the scenes, write one, or print the reference."""
    if options.reference and options.write is not None:
        raise InputError("--write and --reference: give one of them")
    if options.reference:
        # Made by examples/scene_reference.py: all keys of scene and arm files.
        text = (files("throwplan") / "docs/scene-reference.md").read_text(encoding="utf-8")
        print(json.dumps({"reference": text}) if options.json else text, end="")
    elif options.write is not None:
        path = Path(f"{options.write}.toml")
        copy_out(scene_text(options.write), path, force=options.force)
        print_result(options, {"file": str(path)}, f"wrote {path}")
    else:
        scenes = {name: load_scene(name).description for name in scene_names()}
        lines = [f"{name:12} {description}" for name, description in scenes.items()]
        print_result(options, {"scenes": scenes}, "\n".join(lines))
    return DONE
