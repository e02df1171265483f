"""`throwplan validate`: release models on measured throws."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...problems import InputError, load_throws, prepare_folder
from ..identify import (
    PAPER_MODELS,
    VALIDATION_FILES,
    as_dict,
    as_text,
    check_model,
    save_validation,
    validate,
)
from .common import DONE, Progress, add_out, answer, say, written

EXAMPLE = "throwplan validate out/throws --out out/validation"


def arguments(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    add = parser.add_argument
    add("data", metavar="DATA", help="a folder with dataset.toml and throws.csv")
    add(
        "--models",
        metavar="A,B,C",
        help=f"release models, with commas (default: {','.join(PAPER_MODELS)})",
    )
    add(
        "--factor",
        nargs="+",
        metavar="NAME",
        action="extend",
        default=[],
        help="more columns of throws.csv: its first label is compared with its last",
    )
    add_out(parser, "validation.md, tables as CSV and three pictures")


def run(options: argparse.Namespace) -> int:
    """Compares, writes and prints."""
    models = PAPER_MODELS if options.models is None else _models(options.models)
    data = load_throws(options.data)
    if options.out is not None:
        prepare_folder(Path(options.out), VALIDATION_FILES)
    with Progress() as progress:
        found = validate(data, models, options.factor, progress.about)
    if options.out is not None:
        say(f"{data.name}: writing {options.out}")
        save_validation(found, Path(options.out))
    text = f"{as_text(found)}\n\n{found.seconds:.0f} s" + written(options)
    answer(options, as_dict(found), text)
    return DONE


def _models(words: str) -> tuple[str, ...]:
    """The models of `--models a,b,c`, checked."""
    names = tuple(dict.fromkeys(word.strip() for word in words.split(",") if word.strip()))
    if not names:
        raise InputError(f"--models {words!r}: names no model")
    for name in names:
        try:
            check_model(name)
        except InputError as error:
            raise error.within("--models") from None
    return names
