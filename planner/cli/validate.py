"""`throwplan validate`: release models on measured throws."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ...problems import InputError
from .command import DONE, add_out, command, say
from .progress import ProgressLine


def add_validate(commands: Any) -> None:
    """Adds `throwplan validate`."""
    example = "throwplan validate out/throws --out out/validation"
    words = "compare release models on measured throws"
    parser = command(commands, "validate", _validate, words, example)
    parser.add_argument("data", metavar="DATA", help="a folder with dataset.toml and throws.csv")
    parser.add_argument(
        "--models",
        metavar="A,B,C",
        help="release models, with commas (default: ls,sp,sp-paper,ils,ls-step)",
    )
    parser.add_argument(
        "--factor",
        nargs="+",
        metavar="NAME",
        action="extend",
        default=[],
        help="more columns of throws.csv: its first label is compared with its last",
    )
    add_out(parser, "validation.md, tables as CSV and six pictures")


def _validate(options: argparse.Namespace) -> int:
    from ...problems import load_throws, prepare_folder
    from ..identify import PAPER_MODELS, as_dict, as_text, save_validation, validate
    from ..identify import VALIDATION_FILES as FILES

    models = PAPER_MODELS if options.models is None else _names(options.models)
    data = load_throws(options.data)
    if options.out is not None:
        prepare_folder(Path(options.out), FILES)
    line = ProgressLine("", "throws")
    with line:
        found = validate(data, models, options.factor, line.about)
    if options.out is not None:
        say(options, f"{data.name}: writing {options.out}")
        save_validation(found, Path(options.out))
    if options.json:
        print(json.dumps(as_dict(found), indent=2, allow_nan=False))
    else:
        print(as_text(found))
        print(f"\n{found.seconds:.0f} s")
        if options.out is not None:
            print(f"written to {options.out}")
    return DONE


def _names(words: str) -> tuple[str, ...]:
    """The models of `--models a,b,c`, checked."""
    from ..identify import check_model

    names = tuple(dict.fromkeys(word.strip() for word in words.split(",") if word.strip()))
    if not names:
        raise InputError(f"--models {words!r}: names no model")
    for name in names:
        try:
            check_model(name)
        except InputError as error:
            raise error.within("--models") from None
    return names
