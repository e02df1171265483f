"""Measured throws written to a folder."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ...models import Array
from ..files import (
    filling,
    shipped,
    toml_key,
    toml_lines,
)
from ..grip import ThrownObject
from ..section import InputError, meanings, table_of
from .data import MeasuredThrow, Shared, ThrowData
from .reading import LANDING

#: Format of every number: nine digits.
FORMAT = "%.9g"
#: Files and folders of a data set, dataset.toml last.
THROW_DATA_FILES = ("motion", "grip", "track", "throws.csv", "dataset.toml")


def write_throws(
    data: ThrowData, folder: str | Path, objects: Mapping[ThrownObject, str] | None = None
) -> None:
    """Write dataset.toml, throws.csv and the recordings into `folder`, made if need be, in place
    of those of an earlier data set.

    `load_throws` reads it back to 9 digits; the grip force is sampled at 1 kHz.
    objects: their names in the files, else object1, object2 and so on. Raises InputError
    for a folder that cannot be written and an arm's file that `folder` does not hold.
    """
    folder = Path(folder)
    kinds = dict.fromkeys(throw.object for throw in data.throws)
    names = {one: f"object{i}" for i, one in enumerate(kinds, start=1)} | dict(objects or {})
    arm = data.shared.arm
    if arm is not None and arm not in shipped("arms") and not (folder / arm).is_file():
        raise InputError(f"{folder}: holds no {arm}: copy the arm's file there first")
    files = _file_names(data.throws)
    text = _head_text(data, {one: names[one] for one in kinds})
    with filling(folder, THROW_DATA_FILES) as scratch:
        for kind in ("motion", "grip", "track"):
            if kind != "track" or any(throw.track is not None for throw in data.throws):
                (scratch / kind).mkdir()
        (scratch / "dataset.toml").write_text(text, encoding="utf-8")
        (scratch / "throws.csv").write_text(_rows_text(data, names, files), encoding="utf-8")
        for throw, file in zip(data.throws, files, strict=True):
            _write_recordings(throw, scratch, file, data.arm is not None)


def _head_text(data: ThrowData, objects: Mapping[ThrownObject, str]) -> str:
    """dataset.toml."""
    table = table_of(data.shared) | {"objects": {n: table_of(o) for o, n in objects.items()}}
    words = {"": meanings(Shared)}
    words |= {f"objects.{toml_key(name)}": meanings(ThrownObject) for name in objects.values()}
    if data.truth:
        table["truth"] = {key: float(value) for key, value in data.truth.items()}
        words["truth"] = {"": "what made the throws: for comparison only, no fit reads it"}
    return "\n".join(toml_lines(table, words)) + "\n"


def _rows_text(data: ThrowData, objects: Mapping[ThrownObject, str], files: Sequence[str]) -> str:
    """throws.csv."""
    factors = list(data.factors)
    columns = ["throw", "object", *factors, "command", "grasp_offset", "grasp_angle_deg"]
    columns += [*LANDING, "motion", "grip", "track"]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for throw, file in zip(data.throws, files, strict=True):
        grasp = (throw.command, throw.grasp.offset, np.degrees(throw.grasp.angle))
        landing = throw.landing or ("", "", "")
        writer.writerow(
            [throw.name, objects[throw.object]]
            + [throw.factors.get(name, "") for name in factors]
            + [value if isinstance(value, str) else FORMAT % value for value in (*grasp, *landing)]
            + [f"motion/{file}", f"grip/{file}", "" if throw.track is None else f"track/{file}"]
        )
    return text.getvalue()


def _file_names(throws: Sequence[MeasuredThrow]) -> list[str]:
    """A file's name per throw: the throw's own, or its number where that makes none."""
    names = [throw.name for throw in throws]
    plain = all(re.fullmatch(r"[A-Za-z0-9_-]+", name) for name in names)
    if plain and len({name.lower() for name in names}) == len(names):
        return [f"{name}.csv" for name in names]
    return [f"{number:04d}.csv" for number in range(1, len(names) + 1)]


def _write_recordings(throw: MeasuredThrow, folder: Path, file: str, joints: bool) -> None:
    """The recordings of one throw."""
    if joints:
        columns = ["t", *(f"q{j + 1}" for j in range(throw.motion.shape[1]))]
    else:
        columns = ["t", "x", "z", "theta"]
    _write(folder / "motion" / file, columns, np.column_stack([throw.times, throw.motion]))
    _write(folder / "grip" / file, ["t", "f_N"], throw.grip.samples())
    if throw.track is not None:
        _write(folder / "track" / file, ["t", "x", "z", "theta"], throw.track)


def _write(path: Path, columns: list[str], rows: Array) -> None:
    lines = [",".join(columns), *(",".join(FORMAT % value for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
