"""`throwplan scenes`: the built-in scenes, and what a scene file may hold."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from ...problems import InputError, copy_out, load_scene, scene_names, scene_reference, scene_text
from .common import DONE, Add, add_force, answer


def arguments(add: Add) -> None:
    """The command's options."""
    add("--write", metavar="NAME", help="copy that scene's file to NAME.toml here")
    add_force(add)
    add("--reference", action="store_true", help="print all keys of a scene file as Markdown")


def run(options: argparse.Namespace) -> int:
    """Lists the scenes, or writes one, or prints the reference."""
    if options.reference and options.write is not None:
        raise InputError("--write and --reference: give one of them")
    if options.reference:
        text = scene_reference()
        print(json.dumps({"reference": text}) if options.json else text, end="")
    elif options.write is not None:
        path = Path(f"{options.write}.toml")
        copy_out(scene_text(options.write), path, force=options.force)
        answer(options, {"file": str(path)}, f"wrote {path}")
    else:
        scenes = {name: load_scene(name).description for name in scene_names()}
        lines = [f"{name:12} {description}" for name, description in scenes.items()]
        answer(options, {"scenes": scenes}, "\n".join(lines))
    return DONE
