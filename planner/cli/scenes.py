"""`throwplan scenes`: the built-in scenes, and what a scene file may hold."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ...problems import InputError, load_scene, scene_names, scene_text
from .command import DONE, command


def add_scenes(commands: Any) -> None:
    """Adds `throwplan scenes`."""
    example = "throwplan scenes --write cup"
    parser = command(commands, "scenes", _scenes, "list the built-in scenes", example)
    parser.add_argument("--write", metavar="NAME", help="copy that scene's file to NAME.toml here")
    parser.add_argument(
        "--reference", action="store_true", help="print all keys of a scene file as Markdown"
    )


def _scenes(options: argparse.Namespace) -> int:
    if options.reference:
        if options.write is not None:
            raise InputError("--write and --reference: give one of them")
        from ...problems import scene_reference

        text = scene_reference()
        print(json.dumps({"reference": text}) if options.json else text, end="")
        return DONE
    if options.write is not None:
        from ...problems import copy_out

        path = Path(f"{options.write}.toml")
        copy_out(scene_text(options.write), path)
        print(json.dumps({"file": str(path)}) if options.json else f"wrote {path}")
        return DONE
    descriptions = {name: load_scene(name).description for name in scene_names()}
    if options.json:
        print(json.dumps({"scenes": descriptions}))
    else:
        for name, description in descriptions.items():
            print(f"{name:12} {description}")
    return DONE
